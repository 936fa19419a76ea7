//! The options of a warp.

use numpy::{PyArrayDescr, PyArrayDescrMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyBytes, PyFloat, PyInt, PyList, PyTuple};

use super::arrays;
use super::convert::{Whole, text_of, type_name, whole_number, word};
use super::dtype::Taken;
use super::error::OrRefuse;
use super::error::classes::{ArgumentError, ArgumentTypeError};
use super::image::Output;
use super::layout::Layout;
use crate::error::TableError;
use crate::view::as_bytes_mut;
use crate::{BorderMode, Sample};

/// `"nearest"`, `"bilinear"`, `"cubic"`, `"lanczos4"`, `"area"` or `"mode"`.
pub(super) fn interpolation(object: &Bound<'_, PyAny>) -> PyResult<Taken> {
    one_of("interpolation", &Taken::ALL, Taken::name, object)
}

/// `"constant"`, `"replicate"`, `"reflect"`, `"reflect_101"`, `"wrap"` or `"transparent"`.
pub(super) fn border_mode(object: &Bound<'_, PyAny>) -> PyResult<BorderMode> {
    one_of("border_mode", &BorderMode::ALL, BorderMode::name, object)
}

/// What lies beyond the image of a table: [`border_mode`] without the one that only a warp can do.
pub(super) fn border_of_table(object: Option<&Bound<'_, PyAny>>) -> PyResult<BorderMode> {
    match object.map_or(Ok(BorderMode::Constant), border_mode)? {
        BorderMode::Transparent => Err(ArgumentError::new_err(format!(
            "{}; use lut.warp(image, border_mode=\"transparent\", out=view)",
            TableError::Transparent
        ))),
        mode => Ok(mode),
    }
}

/// Refuses a warp that keeps what its output holds, without an output.
pub(super) fn check_kept(border_mode: Option<BorderMode>, out: &Output<'_>) -> PyResult<()> {
    if border_mode == Some(BorderMode::Transparent) && out.array().is_none() {
        return Err(ArgumentError::new_err(
            "out: expected an array for border_mode=\"transparent\", whose cells outside the image keep what it holds, got \
             None; pass out=",
        ));
    }
    Ok(())
}

/// The one of these whose name a word is.
fn one_of<T: Copy>(what: &str, all: &[T], name: fn(T) -> &'static str, object: &Bound<'_, PyAny>) -> PyResult<T> {
    let names: Vec<_> = all.iter().map(|&one| format!("{:?}", name(one))).collect();
    let (last, others) = names.split_last().map_or(("", [].as_slice()), |(last, others)| (last.as_str(), others));
    let expected = format!("{what}: expected {} or {last}", others.join(", "));
    let got = word(&expected, object)?;
    let found = all.iter().copied().find(|&one| name(one) == got);
    found.ok_or_else(|| ArgumentError::new_err(format!("{expected}, got {got:?}")))
}

/// `"HWC"`, `"CHW"`, `"NHWC"` or `"NCHW"`.
pub(super) fn layout(object: &Bound<'_, PyAny>) -> PyResult<Layout> {
    let expected = "layout: expected \"HWC\", \"CHW\", \"NHWC\" or \"NCHW\"";
    let got = word(expected, object)?;
    let found = Layout::ALL.into_iter().find(|layout| layout.name() == got);
    found.ok_or_else(|| ArgumentError::new_err(format!("{expected}, got {got:?}")))
}

/// A number of threads: a whole number of at least 1.
pub(super) fn thread_count(name: &str, object: &Bound<'_, PyAny>) -> PyResult<usize> {
    let expected = || format!("{name}: expected a whole number of threads, at least 1");
    if object.is_instance_of::<PyBool>() {
        return Err(ArgumentTypeError::new_err(format!("{}, got a bool", expected())));
    }
    match whole_number(object)? {
        Whole::Number(count) if count > 0 => Ok(usize::try_from(count).unwrap_or(usize::MAX)),
        Whole::Number(count) => Err(ArgumentError::new_err(format!("{}, got {count}", expected()))),
        Whole::Beyond => {
            Err(ArgumentError::new_err(format!("{} and of a sensible size, got one beyond 128 bits", expected())))
        }
        Whole::Other => Err(ArgumentTypeError::new_err(format!("{}, got {}", expected(), type_name(object)))),
    }
}

/// A border value, read but of no dtype yet: reading it may run Python code, giving it a dtype does not.
pub(super) struct BorderValue<'py> {
    /// One, or one for each channel; `None` where nothing is said.
    numbers: Option<Vec<Number<'py>>>,
}

/// A Python number.
struct Number<'py> {
    object: Bound<'py, PyAny>,
    /// As a whole number; `None` where it has a fraction or 128 bits do not hold it.
    whole: Option<i128>,
    /// As float64; `None` beyond its range.
    value: Option<f64>,
}

impl<'py> BorderValue<'py> {
    /// Reads a number or a sequence of them; where nothing is said, it is 0.
    pub(super) fn new(object: Option<&Bound<'py, PyAny>>) -> PyResult<Self> {
        let Some(object) = object else { return Ok(Self { numbers: None }) };
        // Python's own numbers are read at once: asking NumPy takes a microsecond, a tenth of a small image's warp
        if is_number(object) {
            return Ok(Self { numbers: Some(vec![Number::new(object.clone())?]) });
        }
        if let Ok(tuple) = object.cast::<PyTuple>()
            && tuple.iter().all(|item| is_number(&item))
        {
            return Ok(Self { numbers: Some(tuple.iter().map(Number::new).collect::<PyResult<_>>()?) });
        }
        let refuse = || {
            let got = text_of(object)?;
            Ok(ArgumentTypeError::new_err(format!(
                "border_value: expected a number or one for each channel, got {got}"
            )))
        };
        let refusal = || refuse().unwrap_or_else(|error: PyErr| error);
        // NumPy tells numbers from everything else; integers beyond 64 bits are objects to it
        let array = arrays::any("border_value", object).or_refuse(object.py(), refusal)?;
        if array.ndim() > 1 || array.len() > MOST_CHANNELS {
            return Err(refusal());
        }
        let items = array.call_method0("ravel")?.call_method0("tolist")?.cast_into::<PyList>()?;
        if !items.iter().all(|item| is_number(&item)) {
            return Err(refusal());
        }
        Ok(Self { numbers: Some(items.iter().map(Number::new).collect::<PyResult<_>>()?) })
    }

    /// In an image's own dtype: one sample, or one for each channel.
    pub(super) fn samples<T: Sample>(&self, dtype: &Bound<'_, PyArrayDescr>) -> PyResult<Vec<T>> {
        match &self.numbers {
            None => Ok(vec![T::default()]),
            Some(numbers) => numbers.iter().map(|number| sample(number, dtype)).collect(),
        }
    }
}

/// No image has more channels; a longer border value is not read.
const MOST_CHANNELS: usize = 1 << 20;

impl<'py> Number<'py> {
    fn new(object: Bound<'py, PyAny>) -> PyResult<Self> {
        let py = object.py();
        let (whole, value) = match object.cast::<PyFloat>() {
            Ok(number) => {
                let value = number.value();
                ((value.fract() == 0.0 && value.abs() < 2e19).then_some(value as i128), Some(value))
            }
            Err(_) => match whole_number(&object)? {
                Whole::Number(number) => (Some(number), Some(number as f64)),
                // beyond float64: as good as infinite, but not the infinity that a float dtype holds
                _ => (None, object.extract::<f64>().or_none(py)?),
            },
        };
        Ok(Self { object, whole, value })
    }
}

fn is_number(object: &Bound<'_, PyAny>) -> bool {
    object.is_instance_of::<PyInt>() || object.is_instance_of::<PyFloat>()
}

/// A Python number as a sample of a dtype of `T`'s size, if it can hold the number.
fn sample<T: Sample>(number: &Number<'_>, dtype: &Bound<'_, PyArrayDescr>) -> PyResult<T> {
    let refuse = |expected: String| {
        let got = text_of(&number.object)?;
        Err(ArgumentError::new_err(format!("border_value: expected {expected} for {dtype}, got {got}")))
    };
    let of_bytes = |bytes: &[u8]| {
        let mut sample = [T::default()];
        as_bytes_mut(&mut sample).copy_from_slice(bytes);
        sample[0]
    };
    let bits = 8 * dtype.itemsize();
    if dtype.kind() == b'f' {
        let largest = match bits {
            16 => 65504.0,
            32 => f64::from(f32::MAX),
            _ => f64::MAX,
        };
        return match (number.value, bits) {
            (Some(value), _) if value.is_finite() && value.abs() > largest => {
                refuse(format!("a number within +-{largest:e}"))
            }
            (Some(value), 32) => Ok(of_bytes(&(value as f32).to_ne_bytes())),
            (Some(value), 64) => Ok(of_bytes(&value.to_ne_bytes())),
            (Some(value), _) => {
                let half = dtype.py().import("numpy")?.call_method1("float16", (value,))?;
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
    match number.whole {
        Some(whole) if (lowest..=highest).contains(&whole) => Ok(match bits {
            8 => of_bytes(&(whole as u8).to_ne_bytes()),
            16 => of_bytes(&(whole as u16).to_ne_bytes()),
            32 => of_bytes(&(whole as u32).to_ne_bytes()),
            _ => of_bytes(&(whole as u64).to_ne_bytes()),
        }),
        _ => refuse(format!("a whole number from {lowest} to {highest}")),
    }
}
