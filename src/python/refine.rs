//! The inner loops of `ipm_rs.refine`; Python walks downhill.

use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

use super::camera::PyCamera;
use super::detached;
use super::ground::PyPlane;
use crate::ImageView;
use crate::geometry::Pose;
use crate::python::convert::matrix4;
use crate::refine::{Crossing, Differences, Mounting, Moves, Normal, Slopes};

/// Two pictures of a drive, of which the second is looked at.
#[derive(FromPyObject)]
pub(super) struct Looked<'py> {
    camera: PyRef<'py, PyCamera>,
    picture: PyReadonlyArray2<'py, f32>,
    level: u32,
    mask: Option<PyReadonlyArray2<'py, bool>>,
    motion: Bound<'py, PyAny>,
    of_camera: bool,
    ground: PyRef<'py, PyPlane>,
}

/// What the second picture shows where the first looks along rays, and the derivatives by the mounting.
#[pyfunction(name = "_refine_shown")]
#[expect(clippy::type_complexity, reason = "(values, derivatives)")]
pub(super) fn refine_shown<'py>(
    py: Python<'py>,
    looked: Looked<'py>,
    rays: PyReadonlyArray2<'py, f64>,
    first: [f64; 6],
    second: [f64; 6],
    slopes: bool,
) -> PyResult<(Bound<'py, PyArray1<f64>>, Option<Bound<'py, PyArray2<f64>>>)> {
    let picture = looked.picture.as_array();
    let size = (picture.shape()[1], picture.shape()[0]);
    let motion = matrix4("motion", &looked.motion)?;
    let crossing = Crossing {
        camera: looked.camera.camera,
        picture: ImageView::new(looked.picture.as_slice()?, size, 1)?,
        level: looked.level,
        mask: looked.mask.as_ref().map(|mask| mask.as_slice()).transpose()?,
        motion: Pose::from_matrix(&motion).or_else(|_| Pose::nearest(&motion)).map_err(crate::Error::from)?,
        moves: if looked.of_camera { Moves::Camera } else { Moves::Vehicle },
        road: looked.ground.plane,
    };
    let mounting = |[roll, pitch, yaw, x, y, z]: [f64; 6]| Mounting { angles: [roll, pitch, yaw], position: [x, y, z] };
    let rays = rays.as_slice()?.as_chunks::<3>().0;
    let shown = detached::run(py, || crossing.shown(rays, [mounting(first), mounting(second)], slopes))?;
    let slopes = slopes.then(|| table(py, shown.slopes.into_flattened(), crate::refine::SLOPES)).transpose()?;
    Ok((PyArray1::from_vec(py, shown.values), slopes))
}

/// How brightness differs when gain and offset fit best, derivatives of that, and of which places.
#[pyfunction(name = "_refine_differences")]
#[expect(clippy::type_complexity, reason = "(off, derivatives, shown)")]
pub(super) fn refine_differences<'py>(
    py: Python<'py>,
    values: PyReadonlyArray1<'py, f64>,
    there: PyReadonlyArray1<'py, f64>,
    slopes: Option<PyReadonlyArray2<'py, f64>>,
    spread: Option<f64>,
) -> PyResult<(Bound<'py, PyArray1<f64>>, Option<Bound<'py, PyArray2<f64>>>, Bound<'py, PyArray1<bool>>)> {
    let columns = slopes.as_ref().map(|slopes| slopes.as_array().shape()[1]);
    let given = match (&slopes, columns) {
        (Some(slopes), Some(columns)) => Some(Slopes { values: slopes.as_slice()?, columns }),
        _ => None,
    };
    let (values, there) = (values.as_slice()?, there.as_slice()?);
    let found = detached::run(py, || Ok(Differences::new(values, there, given, spread)))?;
    let slopes = columns.map(|columns| table(py, found.slopes, columns)).transpose()?;
    Ok((PyArray1::from_vec(py, found.off), slopes, PyArray1::from_vec(py, found.shown)))
}

/// Tukey's loss of residuals, its gradient, and the Gauss-Newton matrix.
#[pyfunction(name = "_refine_normal")]
#[expect(clippy::type_complexity, reason = "(cost, gradient, hessian)")]
pub(super) fn refine_normal<'py>(
    py: Python<'py>,
    off: PyReadonlyArray1<'py, f64>,
    slopes: PyReadonlyArray2<'py, f64>,
    spread: f64,
) -> PyResult<(f64, Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<f64>>)> {
    let columns = slopes.as_array().shape()[1];
    let (off, slopes) = (off.as_slice()?, slopes.as_slice()?);
    let found = detached::run(py, || Ok(Normal::of(off, slopes, columns, spread)))?;
    Ok((found.cost, PyArray1::from_vec(py, found.gradient), table(py, found.hessian, columns)?))
}

/// Numbers as rows.
fn table(py: Python<'_>, numbers: Vec<f64>, columns: usize) -> PyResult<Bound<'_, PyArray2<f64>>> {
    let rows = numbers.len().checked_div(columns).unwrap_or(0);
    PyArray1::from_vec(py, numbers).reshape([rows, columns])
}
