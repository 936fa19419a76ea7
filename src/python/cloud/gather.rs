//! Attributes of points: pixels or rows of an array of any dtype, picked by number.

use numpy::{Element, PyArray1, PyArrayDescrMethods, PyUntypedArray};
use pyo3::prelude::*;

use super::options::wrong_dtype;
use crate::parallel::check_interrupt;
use crate::python::detached;
use crate::python::image::ImageArray;
use crate::view::{Sample, buffer};

/// Samples that are moved, not computed with, one type for each size.
macro_rules! by_size {
    ($array:expr, $name:expr, $function:ident($($argument:expr),*)) => {
        match ($array.dtype().kind(), $array.dtype().itemsize()) {
            (b'b' | b'i' | b'u' | b'f', 1) => $function::<u8>($($argument),*),
            (b'b' | b'i' | b'u' | b'f', 2) => $function::<u16>($($argument),*),
            (b'b' | b'i' | b'u' | b'f', 4) => $function::<u32>($($argument),*),
            (b'b' | b'i' | b'u' | b'f', 8) => $function::<u64>($($argument),*),
            _ => Err(wrong_dtype($name, "a bool, integer or float dtype of 1, 2, 4 or 8 bytes", &$array.dtype(), "convert it first")),
        }
    };
}
pub(super) use by_size;

/// The pixels `y * width + x` of an image (H, W) or (H, W, C), as (N,) or (N, C).
pub(super) fn pixels<'py>(name: &str, image: &ImageArray<'py>, index: &[i64]) -> PyResult<Bound<'py, PyAny>> {
    by_size!(image, name, pixels_as(image, index))
}

fn pixels_as<'py, T: Sample + Element>(image: &ImageArray<'py>, index: &[i64]) -> PyResult<Bound<'py, PyAny>> {
    let py = image.dtype().py();
    let read = image.read()?;
    let view = &read.views::<T>()?[0];
    let width = view.width();
    let samples = detached::run(py, || {
        let mut samples = buffer::reserved("values", index.len().saturating_mul(view.channels()))?;
        for index in index.chunks(1 << 12) {
            check_interrupt()?;
            for &pixel in index {
                let pixel = pixel as usize; // of an image of this size, so it is one
                samples.extend_from_slice(view.pixel(pixel % width, pixel / width));
            }
        }
        Ok(samples)
    })?;
    let array = PyArray1::from_vec(py, samples).call_method1("view", (image.dtype(),))?;
    match image.shape() {
        [_, _] => Ok(array),
        _ => array.call_method1("reshape", ((index.len(), view.channels()),)),
    }
}

/// The rows of an (N,) or (N, C) array as an image of width 1, and whether it had columns; `None` where it has no rows.
pub(super) fn as_image<'py>(array: &Bound<'py, PyUntypedArray>) -> PyResult<Bound<'py, PyUntypedArray>> {
    let py = array.py();
    let numpy = py.import("numpy")?;
    Ok(numpy.call_method1("expand_dims", (array, 1))?.cast_into()?)
}
