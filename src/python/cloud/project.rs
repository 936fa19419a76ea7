//! Points to pixels, many at once.

use numpy::{PyArray1, PyArray2, PyArrayMethods, dtype};
use pyo3::prelude::*;

use crate::Camera;
use crate::cloud::{Projections, project_into};
use crate::python::detached;
use crate::python::image::empty_array;
use crate::python::points::PointsArray;
use crate::view::PointSample;

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
    // NumPy allocates them, because it asks for huge pages, without which a million points take half as long again
    let count = view.rows();
    let uv = empty_array(&[count, 2], dtype::<f64>(py))?.cast_into::<PyArray2<f64>>()?;
    let depth = empty_array(&[count], dtype::<f64>(py))?.cast_into::<PyArray1<f64>>()?;
    let valid = empty_array(&[count], dtype::<u8>(py))?.cast_into::<PyArray1<u8>>()?;
    valid.readwrite().as_slice_mut()?.fill(0); // any bits are a number, but not a bool
    let valid = valid.call_method1("view", (dtype::<bool>(py),))?.cast_into::<PyArray1<bool>>()?;
    {
        let (mut uv, mut depth, mut valid) = (uv.readwrite(), depth.readwrite(), valid.readwrite());
        let out = Projections {
            uv: uv.as_slice_mut()?.as_chunks_mut().0,
            depth: depth.as_slice_mut()?,
            valid: valid.as_slice_mut()?,
        };
        detached::run(py, || project_into(camera, &view, out, threads))?;
    }
    Ok((uv, depth, valid))
}
