//! Two published functions, value for value.

use nalgebra::Matrix3;
use numpy::{PyArray1, PyArrayDescrMethods, PyArrayMethods, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use super::gather;
use super::options::depth_image;
use crate::cloud::{carla_084_points, depth_to_lidar as lidar};
use crate::python::arrays;
use crate::python::convert::{float, matrix3, tuple_text, whole};
use crate::python::detached;
use crate::python::error::classes::{ArgumentError, ImageError};
use crate::python::image::ImageArray;
use crate::python::layout::Layout;
use crate::python::shared;
use crate::view::PointSample;

#[doc = help!("depth_to_lidar")]
#[pyfunction]
#[pyo3(
    signature = (normalized_depth, w, h, K, max_depth = None),
    text_signature = "(normalized_depth, w, h, K, max_depth=0.9)"
)]
#[expect(non_snake_case, reason = "the field's name for the intrinsic matrix")]
pub(in crate::python) fn depth_to_lidar<'py>(
    normalized_depth: &Bound<'py, PyAny>,
    w: &Bound<'py, PyAny>,
    h: &Bound<'py, PyAny>,
    K: &Bound<'py, PyAny>,
    max_depth: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyTuple>> {
    let size = (whole("w", w)? as usize, whole("h", h)? as usize);
    let (k, max_depth) = (matrix3("K", K)?, limit(max_depth)?);
    let image = normalized(arrays::numbers(DEPTH, "an array", normalized_depth)?, Some(size))?;
    if image.dtype().itemsize() == 4 {
        lidar_as::<f32>(&image, &k, max_depth)
    } else {
        lidar_as::<f64>(&image, &k, max_depth)
    }
}

fn lidar_as<'py, T: PointSample + numpy::Element>(
    image: &ImageArray<'py>,
    k: &Matrix3<f64>,
    max_depth: f64,
) -> PyResult<Bound<'py, PyTuple>> {
    let py = image.dtype().py();
    let (width, height) = image.size();
    let read = image.read()?;
    let view = read.views::<T>()?[0];
    let cloud = detached::run(py, || lidar(&view, k, max_depth))?;
    let points = PyArray1::from_vec(py, cloud.points).reshape([3, width * height])?;
    let metres = PyArray1::from_vec(py, cloud.metres).reshape([height, width])?;
    PyTuple::new(py, [points.into_any(), metres.into_any()])
}

#[doc = help!("depth_to_local_point_cloud")]
#[pyfunction]
#[pyo3(
    signature = (normalized_depth, fov, *, color = None, max_depth = None),
    text_signature = "(normalized_depth, fov, *, color=None, max_depth=0.9)"
)]
pub(in crate::python) fn depth_to_local_point_cloud<'py>(
    normalized_depth: &Bound<'py, PyAny>,
    fov: &Bound<'py, PyAny>,
    color: Option<&Bound<'py, PyAny>>,
    max_depth: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (fov, max_depth) = (float("fov", fov)?, limit(max_depth)?);
    if !(fov > 0.0 && fov < 180.0) {
        let message =
            format!("fov: expected the horizontal field of view in degrees, above 0 and below 180, got {fov}");
        return Err(ArgumentError::new_err(message));
    }
    let color = color.filter(|color| !color.is_none()).map(|color| shared::array("color", color, false)).transpose()?;
    let image = normalized(arrays::numbers(DEPTH, "an array", normalized_depth)?, None)?;
    let color = color.map(|color| ImageArray::new("color", color, Layout::Hwc)).transpose()?;
    if let Some(color) = &color
        && color.size() != image.size()
    {
        let (width, height) = image.size();
        let got = tuple_text(color.shape());
        let message = format!("color: expected shape ({height}, {width}, C), as the depth has, got {got}");
        return Err(ImageError::new_err(message));
    }
    let (width, height) = image.size();
    let focal = width as f64 / (2.0 * (fov * std::f64::consts::PI / 360.0).tan());
    let (cx, cy) = (width as f64 / 2.0, height as f64 / 2.0);
    let k = Matrix3::new(focal, 0.0, cx, 0.0, focal, cy, 0.0, 0.0, 1.0);
    if image.dtype().itemsize() == 4 {
        local_as::<f32>(&image, &k, max_depth, color.as_ref())
    } else {
        local_as::<f64>(&image, &k, max_depth, color.as_ref())
    }
}

fn local_as<'py, T: PointSample>(
    image: &ImageArray<'py>,
    k: &Matrix3<f64>,
    max_depth: f64,
    color: Option<&ImageArray<'py>>,
) -> PyResult<Bound<'py, PyAny>> {
    let py = image.dtype().py();
    let read = image.read()?;
    let view = read.views::<T>()?[0];
    let (points, index) = detached::run(py, || carla_084_points(&view, k, max_depth))?;
    let count = points.len();
    let points = PyArray1::from_vec(py, points.into_flattened()).reshape([count, 3])?.into_any();
    match color {
        Some(color) => Ok(PyTuple::new(py, [points, gather::pixels("color", color, &index)?])?.into_any()),
        None => Ok(points),
    }
}

/// The limit, which may be infinite but not NaN.
fn limit(object: Option<&Bound<'_, PyAny>>) -> PyResult<f64> {
    let limit = object.map_or(Ok(0.9), |object| float("max_depth", object))?;
    if limit.is_nan() {
        return Err(ArgumentError::new_err("max_depth: expected a number, got nan"));
    }
    Ok(limit)
}

const DEPTH: &str = "normalized_depth";

/// A depth image of float32, or of float64 where it was of anything else; flat ones are taken where the size is known.
fn normalized<'py>(array: Bound<'py, PyUntypedArray>, size: Option<(usize, usize)>) -> PyResult<ImageArray<'py>> {
    let array = match (array.dtype().kind(), array.dtype().itemsize()) {
        (b'f', 4) => arrays::require::<f32>(DEPTH, &array)?.as_untyped().clone(),
        _ => arrays::require::<f64>(DEPTH, &array)?.as_untyped().clone(),
    };
    let Some((width, height)) = size else { return depth_image(DEPTH, array) };
    if array.len() != width * height || array.is_empty() || array.ndim() > 3 {
        return Err(ImageError::new_err(format!(
            "{DEPTH}: expected {height} x {width} numbers, as h and w say, and at least one, got shape {}",
            tuple_text(array.shape())
        )));
    }
    depth_image(DEPTH, array.call_method1("reshape", ((height, width),))?.cast_into()?)
}
