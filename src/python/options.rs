//! The options of a warp.

use numpy::{PyArrayDescr, PyArrayDescrMethods};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyBytes, PyFloat, PyInt, PyString};

use super::convert::type_name;
use super::error::classes::{ArgumentError, ArgumentTypeError};
use super::image::Sample;
use crate::Interpolation;

/// `"bilinear"` or `"nearest"`.
pub(super) fn interpolation(object: &Bound<'_, PyAny>) -> PyResult<Interpolation> {
    let expected = "interpolation: expected \"bilinear\" or \"nearest\"";
    match object.extract::<String>().as_deref() {
        Ok("bilinear") => Ok(Interpolation::Bilinear),
        Ok("nearest") => Ok(Interpolation::Nearest),
        Ok(other) => Err(ArgumentError::new_err(format!("{expected}, got {other:?}"))),
        Err(_) => Err(ArgumentTypeError::new_err(format!("{expected}, got {}", type_name(object)))),
    }
}

/// A number of threads: a whole number of at least 1.
pub(super) fn thread_count(name: &str, object: &Bound<'_, PyAny>) -> PyResult<usize> {
    let expected = format!("{name}: expected a whole number of threads, at least 1");
    if object.is_instance_of::<PyBool>() {
        return Err(ArgumentTypeError::new_err(format!("{expected}, got a bool")));
    }
    match object.extract::<i64>() {
        Ok(count) => usize::try_from(count).ok().filter(|&count| count > 0).ok_or(()),
        Err(_) if object.is_instance_of::<PyInt>() => Err(()),
        Err(_) => return Err(ArgumentTypeError::new_err(format!("{expected}, got {}", type_name(object)))),
    }
    .map_err(|()| ArgumentError::new_err(format!("{expected}, got {object}")))
}

/// The border value in the image's own dtype: one sample, or one for each channel.
pub(super) fn border_value<T: Sample>(
    object: Option<&Bound<'_, PyAny>>,
    dtype: &Bound<'_, PyArrayDescr>,
) -> PyResult<Vec<T>> {
    let Some(object) = object else { return Ok(vec![T::default()]) };
    let mut numbers = Vec::new();
    match number(object, dtype)? {
        Some(one) => numbers.push(one),
        None => {
            let unusable = || {
                let got = type_name(object);
                ArgumentTypeError::new_err(format!(
                    "border_value: expected a number or one for each channel, got {got}"
                ))
            };
            if object.is_instance_of::<PyString>() || object.is_instance_of::<PyBytes>() {
                return Err(unusable());
            }
            for item in object.try_iter().map_err(|_| unusable())? {
                numbers.push(number(&item?, dtype)?.ok_or_else(unusable)?);
            }
        }
    }
    // NumPy knows how each dtype is stored, float16 too; the numbers are known to fit
    let array = object.py().import("numpy")?.call_method1("array", (numbers, dtype))?;
    let bytes = array.call_method0("tobytes")?.cast_into::<PyBytes>()?;
    Ok(bytes.as_bytes().chunks_exact(size_of::<T>()).map(T::from_bytes).collect())
}

/// A number that the dtype can hold, as a Python int or float; `None` where the object is no number.
fn number<'py>(object: &Bound<'py, PyAny>, dtype: &Bound<'py, PyArrayDescr>) -> PyResult<Option<Bound<'py, PyAny>>> {
    let refuse = |expected: String| {
        let got = object.repr().map_or_else(|_| type_name(object), |text| text.to_string());
        ArgumentError::new_err(format!("border_value: expected {expected} for {dtype}, got {got}"))
    };
    let is_float = object.is_instance_of::<PyFloat>();
    if dtype.kind() == b'f' {
        if object.is_instance_of::<PyString>() {
            return Ok(None);
        }
        let Ok(value) = object.extract::<f64>() else { return Ok(None) };
        let largest = match dtype.itemsize() {
            2 => 65504.0,
            4 => f64::from(f32::MAX),
            _ => f64::MAX,
        };
        if value.is_finite() && value.abs() > largest {
            return Err(refuse(format!("a number within +-{largest:e}")));
        }
        return Ok(Some(PyFloat::new(object.py(), value).into_any()));
    }
    let (lowest, highest) = match (dtype.kind(), 8 * dtype.itemsize()) {
        (b'b', _) => (0, 1),
        (b'i', bits) => (-(1i128 << (bits - 1)), (1i128 << (bits - 1)) - 1),
        (_, bits) => (0, (1i128 << bits) - 1),
    };
    let expected = || format!("a whole number from {lowest} to {highest}");
    let value = if let Ok(value) = object.extract::<i128>() {
        value
    } else if object.is_instance_of::<PyInt>() {
        return Err(refuse(expected())); // beyond 128 bits
    } else if let Ok(value) = object.extract::<f64>() {
        if value.fract() != 0.0 || value.abs() > 2e19 {
            return Err(refuse(expected())); // NaN and infinity too
        }
        value as i128
    } else if is_float {
        return Err(refuse(expected()));
    } else {
        return Ok(None);
    };
    if value < lowest || value > highest {
        return Err(refuse(expected()));
    }
    Ok(Some(value.into_pyobject(object.py())?.into_any()))
}
