//! What `ipm_rs.Mosaic` calls for each frame and tile; Python owns the tiles' arrays, their files and which there are.

use numpy::{
    Element, PyArray1, PyArray2, PyArrayDescrMethods, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn,
    PyReadwriteArrayDyn,
};
use pyo3::prelude::*;

use super::camera::PyCamera;
use super::detached;
use super::error::classes::ImageError;
use super::grid::PyBevGrid;
use super::ground::road;
use super::image::ImageArray;
use super::layout::Layout;
use super::shared;
use crate::Ground;
use crate::mosaic::{Frame, Kept, Layers, Tile, Value};

/// The arrays of a tile: weights, totals, counts, sums, squares, resolutions, bests, keys, samples.
type Arrays<'py> = (
    PyReadwriteArrayDyn<'py, u64>,
    PyReadwriteArrayDyn<'py, u64>,
    PyReadwriteArrayDyn<'py, u32>,
    PyReadwriteArrayDyn<'py, u64>,
    PyReadwriteArrayDyn<'py, u64>,
    PyReadwriteArrayDyn<'py, u16>,
    Bound<'py, PyAny>,
    PyReadwriteArrayDyn<'py, u32>,
    Bound<'py, PyAny>,
);

/// Where the frame's camera is in the map, which cells count, and how much.
#[derive(FromPyObject)]
pub(super) struct Placed<'py> {
    camera: PyRef<'py, PyCamera>,
    ground: Bound<'py, PyAny>,
    #[pyo3(attribute("at"))]
    from: [f64; 2],
    distance: (f64, f64),
    weight: f64,
    id: u32,
}

impl Placed<'_> {
    fn frame<'a>(&'a self, ground: &'a Ground) -> Frame<'a> {
        let (camera, mask) = (self.camera.camera, self.camera.mask.as_deref());
        Frame { camera, mask, ground, from: self.from, distance: self.distance, weight: self.weight, id: self.id }
    }
}

/// Which cells of a coarse grid a frame sees well enough.
#[pyfunction(name = "_mosaic_sees")]
pub(super) fn mosaic_sees<'py>(
    py: Python<'py>,
    placed: Placed<'py>,
    coarse: PyRef<'py, PyBevGrid>,
    finer: f64,
) -> PyResult<Bound<'py, PyArray2<bool>>> {
    let ground = road(Some(&placed.ground))?;
    let (frame, grid) = (placed.frame(&ground), &coarse.grid);
    let seen = detached::run(py, || frame.sees(grid, finer))?;
    PyArray1::from_vec(py, seen).reshape([grid.rows(), grid.columns()])
}

/// What a frame shows of a window, and which cells it resolves with at least so many pixels.
#[pyfunction(name = "_mosaic_shows")]
pub(super) fn mosaic_shows<'py>(
    placed: Placed<'py>,
    image: &Bound<'py, PyAny>,
    window: PyRef<'py, PyBevGrid>,
    least: f64,
    threads: Option<usize>,
) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyArray2<bool>>)> {
    let ground = road(Some(&placed.ground))?;
    let image = ImageArray::new("image", shared::array("image", image, false)?, Layout::Hwc)?;
    let (frame, grid) = (placed.frame(&ground), &window.grid);
    let (py, shape) = (window.py(), [grid.rows(), grid.columns()]);
    let read = image.read()?;
    let (values, seen) = if image.dtype().itemsize() == 1 {
        let view = read.views::<u8>()?.swap_remove(0);
        let (values, seen) = detached::run(py, || frame.shows(&view, grid, least, threads))?;
        (PyArray1::from_vec(py, values).into_any(), seen)
    } else {
        let view = read.views::<u16>()?.swap_remove(0);
        let (values, seen) = detached::run(py, || frame.shows(&view, grid, least, threads))?;
        (PyArray1::from_vec(py, values).into_any(), seen)
    };
    Ok((values, PyArray1::from_vec(py, seen).reshape(shape)?))
}

/// Adds a frame to a window of a tile; of `labels` the most frequent one of each cell.
#[pyfunction(name = "_mosaic_add")]
pub(super) fn mosaic_add<'py>(
    placed: Placed<'py>,
    image: &Bound<'py, PyAny>,
    window: PyRef<'py, PyBevGrid>,
    tile: Arrays<'py>,
    at: (usize, usize),
    labels: bool,
    threads: Option<usize>,
) -> PyResult<usize> {
    let ground = road(Some(&placed.ground))?;
    let image = ImageArray::new("image", shared::array("image", image, false)?, Layout::Hwc)?;
    let call = Call { frame: placed.frame(&ground), image, window: &window, at, labels, threads };
    match tile.6.cast::<PyArrayDyn<u8>>().is_ok() {
        true => call.run::<u8>(tile),
        false => call.run::<u16>(tile),
    }
}

struct Call<'a, 'py> {
    frame: Frame<'a>,
    image: ImageArray<'py>,
    window: &'a PyBevGrid,
    at: (usize, usize),
    labels: bool,
    threads: Option<usize>,
}

impl<'py> Call<'_, 'py> {
    fn run<T: Value + Element>(self, tile: Arrays<'py>) -> PyResult<usize> {
        let py = tile.6.py();
        if self.image.dtype().itemsize() != size_of::<T>() || self.image.dtype().kind() != b'u' {
            return Err(ImageError::new_err("image: expected the dtype of the tile"));
        }
        let mut arrays = Numbers::<T>::of(tile)?;
        let kept = Kept { channels: self.image.channels(), samples: arrays.samples_a_cell(), labels: self.labels };
        let tile = arrays.tile(kept)?;
        let read = self.image.read()?;
        let view = read.views::<T>()?.swap_remove(0);
        let (frame, grid, at, threads) = (self.frame, &self.window.grid, self.at, self.threads);
        detached::run(py, || frame.add(&view, grid, tile, at, threads))
    }
}

/// Keeps the best of a tile's samples and of another's.
#[pyfunction(name = "_mosaic_merge")]
pub(super) fn mosaic_merge<'py>(
    tile: Arrays<'py>,
    keys: PyReadonlyArrayDyn<'py, u32>,
    samples: &Bound<'py, PyAny>,
) -> PyResult<()> {
    fn run<'py, T: Value + Element>(
        tile: Arrays<'py>,
        keys: &PyReadonlyArrayDyn<'py, u32>,
        samples: &Bound<'py, PyAny>,
    ) -> PyResult<()> {
        let mut arrays = Numbers::<T>::of(tile)?;
        let channels = arrays.bests.as_array().shape()[2];
        let kept = Kept { channels, samples: arrays.samples_a_cell(), labels: arrays.totals.as_array().is_empty() };
        let samples: PyReadonlyArrayDyn<'_, T> = samples.extract()?;
        Ok(arrays.tile(kept)?.merge_samples(keys.as_slice()?, samples.as_slice()?)?)
    }
    match tile.6.cast::<PyArrayDyn<u8>>().is_ok() {
        true => run::<u8>(tile, &keys, samples),
        false => run::<u16>(tile, &keys, samples),
    }
}

/// The arrays of a tile, to be written.
struct Numbers<'py, T: Element> {
    weights: PyReadwriteArrayDyn<'py, u64>,
    totals: PyReadwriteArrayDyn<'py, u64>,
    counts: PyReadwriteArrayDyn<'py, u32>,
    sums: PyReadwriteArrayDyn<'py, u64>,
    squares: PyReadwriteArrayDyn<'py, u64>,
    resolutions: PyReadwriteArrayDyn<'py, u16>,
    bests: PyReadwriteArrayDyn<'py, T>,
    keys: PyReadwriteArrayDyn<'py, u32>,
    samples: PyReadwriteArrayDyn<'py, T>,
}

impl<'py, T: Value + Element> Numbers<'py, T> {
    fn of((weights, totals, counts, sums, squares, resolutions, bests, keys, samples): Arrays<'py>) -> PyResult<Self> {
        let (bests, samples) = (bests.extract()?, samples.extract()?);
        Ok(Self { weights, totals, counts, sums, squares, resolutions, bests, keys, samples })
    }

    fn samples_a_cell(&self) -> usize {
        self.keys.as_array().shape().last().copied().unwrap_or(0)
    }

    fn tile(&mut self, kept: Kept) -> PyResult<Tile<'_, T>> {
        let side = self.weights.as_array().shape()[0];
        let layers = Layers {
            weights: self.weights.as_slice_mut()?,
            totals: self.totals.as_slice_mut()?,
            counts: self.counts.as_slice_mut()?,
            sums: self.sums.as_slice_mut()?,
            squares: self.squares.as_slice_mut()?,
            resolutions: self.resolutions.as_slice_mut()?,
            bests: self.bests.as_slice_mut()?,
            keys: self.keys.as_slice_mut()?,
            samples: self.samples.as_slice_mut()?,
        };
        Ok(Tile::new(side, kept, layers)?)
    }
}
