//! What `ipm_rs.Mosaic` calls for each frame and tile; Python owns the tiles' arrays, their files and which there are.

use numpy::{Element, PyArray1, PyArray2, PyArrayDescrMethods, PyArrayDyn, PyArrayMethods, PyReadwriteArrayDyn};
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
use crate::mosaic::{Frame, Layers, Tile, Value};

/// The arrays of a tile: weights, totals, counts, sums, squares, resolutions, bests.
type Arrays<'py> = (
    PyReadwriteArrayDyn<'py, u64>,
    PyReadwriteArrayDyn<'py, u64>,
    PyReadwriteArrayDyn<'py, u32>,
    PyReadwriteArrayDyn<'py, u64>,
    PyReadwriteArrayDyn<'py, u64>,
    PyReadwriteArrayDyn<'py, u16>,
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
}

impl Placed<'_> {
    fn frame<'a>(&'a self, ground: &'a Ground) -> Frame<'a> {
        let (camera, mask) = (self.camera.camera, self.camera.mask.as_deref());
        Frame { camera, mask, ground, from: self.from, distance: self.distance, weight: self.weight }
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

/// Adds a frame to a window of a tile.
#[pyfunction(name = "_mosaic_add")]
pub(super) fn mosaic_add<'py>(
    placed: Placed<'py>,
    image: &Bound<'py, PyAny>,
    window: PyRef<'py, PyBevGrid>,
    tile: Arrays<'py>,
    at: (usize, usize),
    threads: Option<usize>,
) -> PyResult<usize> {
    let ground = road(Some(&placed.ground))?;
    let image = ImageArray::new("image", shared::array("image", image, false)?, Layout::Hwc)?;
    let call = Call { frame: placed.frame(&ground), image, window: &window, at, threads };
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
    threads: Option<usize>,
}

impl<'py> Call<'_, 'py> {
    fn run<T: Value + Element>(self, tile: Arrays<'py>) -> PyResult<usize> {
        let (mut weights, mut totals, mut counts, mut sums, mut squares, mut resolutions, bests) = tile;
        let py = bests.py();
        let mut bests: PyReadwriteArrayDyn<'_, T> = bests.extract()?;
        if self.image.dtype().itemsize() != size_of::<T>() || self.image.dtype().kind() != b'u' {
            return Err(ImageError::new_err("image: expected the dtype of the tile"));
        }
        let (side, channels) = (weights.as_array().shape()[0], self.image.channels());
        let layers = Layers {
            weights: weights.as_slice_mut()?,
            totals: totals.as_slice_mut()?,
            counts: counts.as_slice_mut()?,
            sums: sums.as_slice_mut()?,
            squares: squares.as_slice_mut()?,
            resolutions: resolutions.as_slice_mut()?,
            bests: bests.as_slice_mut()?,
        };
        let tile = Tile::new(side, channels, layers)?;
        let read = self.image.read()?;
        let view = read.views::<T>()?.swap_remove(0);
        let (frame, grid, at, threads) = (self.frame, &self.window.grid, self.at, self.threads);
        detached::run(py, || frame.add(&view, grid, tile, at, threads))
    }
}
