//! Points to pixels, many at once.

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;

use crate::Camera;
use crate::cloud::{PointSample, Projections, project_into};
use crate::python::points::PointsArray;

/// uv, depth and valid.
pub(in crate::python) type Projected<'py> =
    (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<bool>>);

/// Projects an (N, 3) array.
pub(in crate::python) fn project<'py>(
    py: Python<'py>,
    camera: &Camera,
    points: &PointsArray<'py>,
    threads: Option<usize>,
) -> PyResult<Projected<'py>> {
    if points.is_f32() {
        project_as::<f32>(py, camera, points, threads)
    } else {
        project_as::<f64>(py, camera, points, threads)
    }
}

fn project_as<'py, T: PointSample>(
    py: Python<'py>,
    camera: &Camera,
    points: &PointsArray<'py>,
    threads: Option<usize>,
) -> PyResult<Projected<'py>> {
    let read = points.read()?;
    let view = read.view::<T>()?;
    // SAFETY: arrays of numbers that are all written before anyone else sees them. NumPy allocates them, because it asks
    // for huge pages, without which a million points take half as long again.
    let (uv, depth) =
        unsafe { (PyArray2::<f64>::new(py, [view.len(), 2], false), PyArray1::<f64>::new(py, view.len(), false)) };
    let valid = PyArray1::<bool>::zeros(py, view.len(), false);
    {
        let (mut uv, mut depth, mut valid) = (uv.readwrite(), depth.readwrite(), valid.readwrite());
        let out = Projections {
            uv: uv.as_slice_mut()?.as_chunks_mut().0,
            depth: depth.as_slice_mut()?,
            valid: valid.as_slice_mut()?,
        };
        py.detach(|| project_into(camera, &view, out, threads))?;
    }
    Ok((uv, depth, valid))
}
