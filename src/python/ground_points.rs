//! What needs no calibration: homographies from points, vanishing points.

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyTuple, PyType};

use super::arrays;
use super::camera::PyCamera;
use super::convert::{Call, Floats, matrix_to_numpy, size, tuple_text, type_name};
use super::detached;
use super::error::classes::{ArgumentError, ArgumentTypeError};
use super::grid::bev_grid;
use super::lut::PyLut;
use crate::{Lut, geometry};

#[doc = help!("homography_from_points")]
#[pyfunction]
#[expect(clippy::type_complexity, reason = "(image_from_ground, errors)")]
pub(super) fn homography_from_points<'py>(
    image_points: &Bound<'py, PyAny>,
    ground_points: &Bound<'py, PyAny>,
) -> PyResult<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<f64>>)> {
    let py = image_points.py();
    let (image, ground) = pairs(image_points, ground_points)?;
    let (image, ground) = (image.rows::<2>("image_points")?, ground.rows::<2>("ground_points")?);
    let found = detached::run(py, || geometry::homography_from_points(image, ground))?;
    Ok((matrix_to_numpy(py, &found.image_from_ground)?, PyArray1::from_vec(py, found.errors)))
}

#[doc = help!("vanishing_point")]
#[pyfunction]
#[pyo3(signature = (lines, *, camera = None))]
pub(super) fn vanishing_point(lines: &Bound<'_, PyAny>, camera: Option<&Bound<'_, PyAny>>) -> PyResult<(f64, f64)> {
    let camera = camera.map(|object| {
        object.cast::<PyCamera>().map(Bound::get).map_err(|_| {
            ArgumentTypeError::new_err(format!("camera: expected an ipm_rs.Camera, got {}", type_name(object)))
        })
    });
    let camera = camera.transpose()?;
    let floats = Floats::new("lines", "an (N, 2, 2) array", lines)?;
    if !matches!(floats.shape(), [_, 2, 2]) {
        let got = tuple_text(floats.shape());
        let expected = "shape (N, 2, 2), two points (u, v) of each line";
        return Err(ArgumentError::new_err(format!("lines: expected {expected}, got {got}")));
    }
    let lines = floats.values().as_chunks::<2>().0.as_chunks::<2>().0;
    let [u, v] = match camera {
        None => geometry::vanishing_point(lines)?,
        Some(camera) => camera.camera.vanishing_point(lines)?,
    };
    Ok((u, v))
}

#[pymethods]
impl PyLut {
    #[doc = help!("Lut.from_ground_points")]
    #[classmethod]
    #[pyo3(
        signature = (image_points, ground_points, grid, *positional, source_size = None),
        text_signature = "(image_points, ground_points, grid, *, source_size)"
    )]
    fn from_ground_points(
        _cls: &Bound<'_, PyType>,
        image_points: &Bound<'_, PyAny>,
        ground_points: &Bound<'_, PyAny>,
        grid: &Bound<'_, PyAny>,
        positional: &Bound<'_, PyTuple>,
        source_size: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        const EXAMPLE: &str = "Lut.from_ground_points(image_points, ground_points, grid, source_size=(1920, 1080))";
        let call = Call::new("Lut.from_ground_points", EXAMPLE, positional)?;
        let py = grid.py();
        let grid = bev_grid(grid)?;
        let source_size = size("source_size", call.needs("source_size", source_size)?)?;
        let (image, ground) = pairs(image_points, ground_points)?;
        let (image, ground) = (image.rows::<2>("image_points")?, ground.rows::<2>("ground_points")?);
        let lut = detached::run(py, || Lut::from_ground_points(image, ground, &grid.grid, source_size))?;
        Ok(lut.into())
    }
}

/// Both arrays before either is borrowed.
fn pairs<'py>(image: &Bound<'py, PyAny>, ground: &Bound<'py, PyAny>) -> PyResult<(Floats<'py>, Floats<'py>)> {
    let image = arrays::numbers("image_points", "an (N, 2) array, (u, v) in pixels,", image)?;
    let ground = arrays::numbers("ground_points", "an (N, 2) array, (x, y) in metres,", ground)?;
    Ok((Floats::of("image_points", &image)?, Floats::of("ground_points", &ground)?))
}
