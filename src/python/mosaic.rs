//! What `ipm_rs.Mosaic` calls for each frame and tile; Python owns the tiles' arrays, their files and which there are.

use numpy::{
    Element, PyArray1, PyArray2, PyArrayDescrMethods, PyArrayDyn, PyArrayMethods, PyReadonlyArray1, PyReadonlyArrayDyn,
    PyReadwriteArrayDyn,
};
use pyo3::prelude::*;
use pyo3::types::PyList;

use super::camera::PyCamera;
use super::detached;
use super::grid::PyBevGrid;
use super::ground::road;
use super::image::ImageArray;
use super::layout::Layout;
use super::shared;
use crate::Ground;
use crate::ImageView;
use crate::mosaic::{Contribution, Frame, Kept, Layers, Tile, Value};

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

/// A window of a tile: the tile's key, the first row and column in it, and the cells.
type Part = ((i64, i64), (usize, usize), PyBevGrid);

/// The windows of tiles that a frame sees well.
#[pyfunction(name = "_mosaic_windows")]
pub(super) fn mosaic_windows(py: Python<'_>, placed: Placed<'_>, resolution: f64, side: usize) -> PyResult<Vec<Part>> {
    let ground = road(Some(&placed.ground))?;
    let frame = placed.frame(&ground);
    let found = detached::run(py, || frame.windows(resolution, side))?;
    Ok(found.into_iter().map(|window| (window.tile, window.at, PyBevGrid { grid: window.grid })).collect())
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

/// What a frame shows of a window of a tile: where the window begins, values, resolutions, weight and id.
type Shown<'py> = ((usize, usize), Bound<'py, PyAny>, Bound<'py, PyArray2<u16>>, u32, u32);

/// What a frame shows of a window whose first cell is a tile's cell `at`, of `labels` the most frequent one of each cell;
/// and how many cells count.
#[pyfunction(name = "_mosaic_shown")]
pub(super) fn mosaic_shown<'py>(
    placed: Placed<'py>,
    image: &Bound<'py, PyAny>,
    window: PyRef<'py, PyBevGrid>,
    at: (usize, usize),
    labels: bool,
    threads: Option<usize>,
) -> PyResult<(usize, Shown<'py>)> {
    fn run<'py, T: Value + Element>(
        py: Python<'py>,
        image: &ImageArray<'py>,
        look: impl FnOnce(&ImageView<'_, T>) -> crate::Result<Contribution<'static, T>> + Send,
    ) -> PyResult<(usize, Shown<'py>)> {
        let read = image.read()?;
        let view = read.views::<T>()?.swap_remove(0);
        let (counted, found) = detached::run(py, || {
            let found = look(&view)?;
            Ok((found.counted(), found))
        })?;
        let shape = [found.resolutions.len() / found.columns, found.columns];
        let values = PyArray1::from_vec(py, found.values.into_owned()).into_any();
        let resolutions = PyArray1::from_vec(py, found.resolutions.into_owned()).reshape(shape)?;
        Ok((counted, (found.at, values, resolutions, found.weight, found.id)))
    }
    let ground = road(Some(&placed.ground))?;
    let image = ImageArray::new("image", shared::array("image", image, false)?, Layout::Hwc)?;
    let (frame, grid, py) = (placed.frame(&ground), &window.grid, window.py());
    match image.dtype().itemsize() {
        1 => run::<u8>(py, &image, |view| frame.contribution(view, grid, at, labels, threads)),
        _ => run::<u16>(py, &image, |view| frame.contribution(view, grid, at, labels, threads)),
    }
}

/// Adds to a tile what frames show of it, and empties their list. It is not interrupted, so that no frame is added by half.
#[pyfunction(name = "_mosaic_add")]
pub(super) fn mosaic_add<'py>(tile: Arrays<'py>, waiting: &Bound<'py, PyList>, threads: Option<usize>) -> PyResult<()> {
    fn run<'py, T: Value + Element>(tile: Arrays<'py>, shown: &[Shown<'py>], threads: Option<usize>) -> PyResult<()> {
        let py = tile.6.py();
        let mut arrays = Numbers::<T>::of(tile)?;
        let kept = arrays.kept();
        let mut tile = arrays.tile(kept)?;
        let values = shown.iter().map(|one| one.1.extract()).collect::<PyResult<Vec<PyReadonlyArray1<'_, T>>>>()?;
        let resolutions = shown.iter().map(|one| one.2.readonly()).collect::<Vec<_>>();
        let layers = values.iter().zip(&resolutions);
        let contributions = shown.iter().zip(layers).map(|((at, _, _, weight, id), (values, resolutions))| {
            let columns = resolutions.as_array().ncols();
            let (values, resolutions) = (values.as_slice()?.into(), resolutions.as_slice()?.into());
            Ok(Contribution { at: *at, columns, values, resolutions, weight: *weight, id: *id })
        });
        let contributions = contributions.collect::<PyResult<Vec<_>>>()?;
        Ok(py.detach(|| tile.add(&contributions, threads))?)
    }
    let shown = waiting.extract::<Vec<Shown<'py>>>()?;
    match tile.6.cast::<PyArrayDyn<u8>>().is_ok() {
        true => run::<u8>(tile, &shown, threads)?,
        false => run::<u16>(tile, &shown, threads)?,
    }
    waiting.set_slice(0, waiting.len(), &PyList::empty(waiting.py()))
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
        let kept = arrays.kept();
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

    fn kept(&self) -> Kept {
        let numbers = |shape: &[usize]| shape.last().copied().unwrap_or(0);
        let channels = numbers(self.bests.as_array().shape());
        let samples = numbers(self.keys.as_array().shape());
        Kept { channels, samples, labels: self.totals.as_array().is_empty() }
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
