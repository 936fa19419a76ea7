//! The options of a warp.

use numpy::{PyArrayDescr, PyArrayDescrMethods, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyBytes, PyFloat, PyInt, PyList, PyString, PyTuple};

use super::convert::type_name;
use super::error::classes::{ArgumentError, ArgumentTypeError};
use super::layout::Layout;
use crate::image::as_bytes_mut;
use crate::{BorderMode, Interpolation, Sample};

/// `"bilinear"`, `"nearest"`, `"area"` or `"mode"`.
pub(super) fn interpolation(object: &Bound<'_, PyAny>) -> PyResult<Interpolation> {
    let expected = "interpolation: expected \"bilinear\", \"nearest\", \"area\" or \"mode\"";
    match name(expected, object)? {
        "bilinear" => Ok(Interpolation::Bilinear),
        "nearest" => Ok(Interpolation::Nearest),
        "area" => Ok(Interpolation::Area),
        "mode" => Ok(Interpolation::Mode),
        other => Err(ArgumentError::new_err(format!("{expected}, got {other:?}"))),
    }
}

/// `"constant"`, `"replicate"` or `"reflect_101"`.
pub(super) fn border_mode(object: &Bound<'_, PyAny>) -> PyResult<BorderMode> {
    let expected = "border_mode: expected \"constant\", \"replicate\" or \"reflect_101\"";
    match name(expected, object)? {
        "constant" => Ok(BorderMode::Constant),
        "replicate" => Ok(BorderMode::Replicate),
        "reflect_101" => Ok(BorderMode::Reflect101),
        other => Err(ArgumentError::new_err(format!("{expected}, got {other:?}"))),
    }
}

/// `"HWC"`, `"CHW"`, `"NHWC"` or `"NCHW"`.
pub(super) fn layout(object: &Bound<'_, PyAny>) -> PyResult<Layout> {
    let expected = "layout: expected \"HWC\", \"CHW\", \"NHWC\" or \"NCHW\"";
    let got = name(expected, object)?;
    let found = Layout::ALL.into_iter().find(|layout| layout.name() == got);
    found.ok_or_else(|| ArgumentError::new_err(format!("{expected}, got {got:?}")))
}

fn name<'a>(expected: &str, object: &'a Bound<'_, PyAny>) -> PyResult<&'a str> {
    let Ok(text) = object.cast::<PyString>() else {
        return Err(ArgumentTypeError::new_err(format!("{expected}, got {}", type_name(object))));
    };
    text.to_str()
}

/// A number of threads: a whole number of at least 1.
pub(super) fn thread_count(name: &str, object: &Bound<'_, PyAny>) -> PyResult<usize> {
    let expected = || format!("{name}: expected a whole number of threads, at least 1");
    if object.is_instance_of::<PyBool>() {
        return Err(ArgumentTypeError::new_err(format!("{}, got a bool", expected())));
    }
    match object.extract::<i128>() {
        Ok(count) if count > 0 => Ok(usize::try_from(count).unwrap_or(usize::MAX)),
        Ok(count) => Err(ArgumentError::new_err(format!("{}, got {count}", expected()))),
        Err(_) if object.is_instance_of::<PyInt>() => {
            Err(ArgumentError::new_err(format!("{} and of a sensible size, got one beyond 128 bits", expected())))
        }
        Err(_) => Err(ArgumentTypeError::new_err(format!("{}, got {}", expected(), type_name(object)))),
    }
}

/// The border value in the image's own dtype: one sample, or one for each channel.
pub(super) fn border_value<T: Sample>(
    object: Option<&Bound<'_, PyAny>>,
    dtype: &Bound<'_, PyArrayDescr>,
) -> PyResult<Vec<T>> {
    let Some(object) = object else { return Ok(vec![T::default()]) };
    // Python's own numbers are read at once: asking NumPy takes a microsecond, a tenth of a small image's warp
    if is_number(object) {
        return Ok(vec![sample(object, dtype)?]);
    }
    if let Ok(tuple) = object.cast::<PyTuple>()
        && tuple.iter().all(|item| is_number(&item))
    {
        return tuple.iter().map(|item| sample(&item, dtype)).collect();
    }
    let refuse = || {
        let got = object.repr().map_or_else(|_| type_name(object), |text| text.to_string());
        ArgumentTypeError::new_err(format!("border_value: expected a number or one for each channel, got {got}"))
    };
    // NumPy tells numbers from everything else; integers beyond 64 bits are objects to it
    let numpy = object.py().import("numpy")?;
    let array = numpy.call_method1("asarray", (object,)).map_err(|_| refuse())?;
    let array = array.cast_into::<PyUntypedArray>().map_err(|_| refuse())?;
    let items = array.call_method0("ravel")?.call_method0("tolist")?.cast_into::<PyList>()?;
    if array.ndim() > 1 || !items.iter().all(|item| is_number(&item)) {
        return Err(refuse());
    }
    items.iter().map(|item| sample(&item, dtype)).collect()
}

fn is_number(object: &Bound<'_, PyAny>) -> bool {
    object.is_instance_of::<PyInt>() || object.is_instance_of::<PyFloat>()
}

/// A Python number as a sample of a dtype of `T`'s size, if it can hold the number.
fn sample<T: Sample>(number: &Bound<'_, PyAny>, dtype: &Bound<'_, PyArrayDescr>) -> PyResult<T> {
    let refuse = |expected: String| {
        let got = number.repr().map_or_else(|_| type_name(number), |text| text.to_string());
        Err(ArgumentError::new_err(format!("border_value: expected {expected} for {dtype}, got {got}")))
    };
    let of_bytes = |bytes: &[u8]| {
        let mut sample = [T::default()];
        as_bytes_mut(&mut sample).copy_from_slice(bytes);
        sample[0]
    };
    // beyond float64: as good as infinite, but not the infinity that a float dtype holds
    let value = number.extract::<f64>().ok();
    let bits = 8 * dtype.itemsize();
    if dtype.kind() == b'f' {
        let largest = match bits {
            16 => 65504.0,
            32 => f64::from(f32::MAX),
            _ => f64::MAX,
        };
        return match (value, bits) {
            (Some(value), _) if value.is_finite() && value.abs() > largest => {
                refuse(format!("a number within +-{largest:e}"))
            }
            (Some(value), 32) => Ok(of_bytes(&(value as f32).to_ne_bytes())),
            (Some(value), 64) => Ok(of_bytes(&value.to_ne_bytes())),
            (Some(value), _) => {
                let half = number.py().import("numpy")?.call_method1("float16", (value,))?;
                Ok(of_bytes(half.call_method0("tobytes")?.cast_into::<PyBytes>()?.as_bytes()))
            }
            (None, _) => refuse(format!("a number within +-{largest:e}")),
        };
    }
    let (lowest, highest) = match (dtype.kind(), bits) {
        (b'b', _) => (0, 1),
        (b'i', bits) => (-(1i128 << (bits - 1)), (1i128 << (bits - 1)) - 1),
        (_, bits) => (0, (1i128 << bits) - 1),
    };
    let whole = number.extract::<i128>().ok().or_else(|| {
        let whole = value.filter(|value| value.fract() == 0.0 && value.abs() < 2e19)?;
        Some(whole as i128)
    });
    match whole {
        Some(whole) if (lowest..=highest).contains(&whole) => Ok(match bits {
            8 => of_bytes(&(whole as u8).to_ne_bytes()),
            16 => of_bytes(&(whole as u16).to_ne_bytes()),
            32 => of_bytes(&(whole as u32).to_ne_bytes()),
            _ => of_bytes(&(whole as u64).to_ne_bytes()),
        }),
        _ => refuse(format!("a whole number from {lowest} to {highest}")),
    }
}
