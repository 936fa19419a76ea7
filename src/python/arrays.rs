//! Array-likes as NumPy arrays: the one place where they come in, and where they are copied into what is needed.
//!
//! Whatever an argument brings along (`__array__`, `__float__`, `__dlpack__`, an iterator) is Python code that may do
//! anything, such as resize the array of another argument. So every call has this order:
//!
//! 1. options are converted, and every array-like becomes an array of NumPy's own class: Python code of arguments runs;
//! 2. shapes, strides and dtypes are checked, arrays are borrowed, their memory is read: none of it runs any more.

use numpy::{
    Element, PyArrayDescr, PyArrayDescrMethods, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArray,
    PyUntypedArrayMethods, dtype,
};
use pyo3::exceptions::PyMemoryError;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyDict, PyFloat, PyInt, PyList, PyTuple, PyType};

use super::error::OrRefuse;
use super::error::classes::{ArgumentError, ArgumentTypeError, OutOfMemoryError};
use super::texts::type_name;
use crate::view::{Sample, Strided, reach};

/// An array-like of real numbers as an array, in whatever dtype, order and alignment it comes.
///
/// # Errors
/// `ArgumentTypeError` for complex numbers, strings, objects and ragged lists, `ArgumentError` for masked values.
pub(super) fn numbers<'py>(
    name: &str,
    expected: &str,
    object: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyUntypedArray>> {
    let py = object.py();
    let refuse =
        |got: String| ArgumentTypeError::new_err(format!("{name}: expected {expected} of real numbers, got {got}"));
    let array = any(name, object).or_refuse(py, || match is_list(object) {
        true => refuse(format!("a ragged {}", type_name(object))),
        false => described(object).map_or_else(|error| error, refuse),
    })?;
    match array.dtype().kind() {
        b'b' | b'i' | b'u' | b'f' => Ok(array),
        b'O' if array.ndim() == 0 => Err(refuse(described(object)?)),
        _ => Err(refuse(format!("{} of dtype {}", type_name(object), array.dtype()))),
    }
}

/// Whatever NumPy makes an array of, as an array.
///
/// # Errors
/// What NumPy or the object raises; `ArgumentError` for masked values.
pub(super) fn any<'py>(name: &str, object: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyUntypedArray>> {
    if let Ok(array) = object.cast::<PyUntypedArray>() {
        return own_class(name, array.clone());
    }
    refuse_masked_items(name, object, 0)?;
    // `asanyarray` keeps a masked array that `__array__` returns, whose mask `asarray` drops
    let array = object.py().import("numpy")?.call_method1("asanyarray", (object,))?;
    own_class(name, array.cast_into()?)
}

/// The array as one of NumPy's own class, over the same memory: methods of a subclass are Python code.
///
/// # Errors
/// `ArgumentError` for a masked array with masked values.
pub(super) fn own_class<'py>(name: &str, array: Bound<'py, PyUntypedArray>) -> PyResult<Bound<'py, PyUntypedArray>> {
    let py = array.py();
    if array.get_type().is(py.get_type::<PyUntypedArray>()) {
        return Ok(array);
    }
    refuse_masked(name, &array)?;
    Ok(py.import("numpy")?.call_method1("asarray", (array,))?.cast_into()?)
}

/// The array itself where it is C-contiguous, aligned and of that dtype in this machine's byte order; else such a copy.
pub(super) fn require<'py, T: Element>(
    name: &str,
    array: &Bound<'py, PyUntypedArray>,
) -> PyResult<Bound<'py, PyArrayDyn<T>>> {
    match array.cast::<PyArrayDyn<T>>() {
        Ok(array) if array.is_c_contiguous() && array.is_aligned() && !is_one_element(array.as_untyped()) => {
            Ok(array.clone())
        }
        _ => Ok(copied(name, array, &dtype::<T>(array.py()))?.cast_into()?),
    }
}

/// The array itself where it is aligned and in this machine's byte order; else a C-contiguous copy of its dtype that is.
pub(super) fn native<'py>(name: &str, array: Bound<'py, PyUntypedArray>) -> PyResult<Bound<'py, PyUntypedArray>> {
    let dtype = array.dtype();
    if array.is_aligned() && dtype.is_native_byteorder() != Some(false) {
        return Ok(array);
    }
    let dtype = dtype.call_method1("newbyteorder", ("=",))?.cast_into()?;
    copied(name, &array, &dtype)
}

/// A C-contiguous copy.
///
/// # Errors
/// `OutOfMemoryError` where there is no memory for it, with NumPy's own words.
pub(super) fn copied<'py>(
    name: &str,
    array: &Bound<'py, PyUntypedArray>,
    dtype: &Bound<'py, PyArrayDescr>,
) -> PyResult<Bound<'py, PyUntypedArray>> {
    let py = array.py();
    let options = PyDict::new(py);
    options.set_item("dtype", dtype)?;
    options.set_item("order", "C")?;
    let copy = py.import("numpy")?.call_method("array", (array,), Some(&options));
    let copy = copy.map_err(|error| match error.is_instance_of::<PyMemoryError>(py) {
        true => OutOfMemoryError::new_err(format!("{name}: {}", error.value(py))),
        false => error,
    });
    let refuse = || ArgumentTypeError::new_err(format!("{name}: expected numbers that {dtype} holds, got others"));
    Ok(copy.or_refuse(py, refuse)?.cast_into()?)
}

/// The numbers of an array as rows and columns, with strides in bytes.
///
/// # Safety
/// Number (i, j), at those strides from the array's first, is an element of the array for every i and j of the shape, of
/// which there is one; the strides are whole numbers of elements, and the array is aligned. Nobody writes to it while the
/// table is used.
pub(super) unsafe fn table<'a, T: Sample>(
    array: &'a Bound<'_, PyUntypedArray>,
    shape: (usize, usize),
    strides: (isize, isize),
) -> crate::Result<Strided<'a, T>> {
    let sample = size_of::<T>();
    assert_eq!(sample, array.dtype().itemsize(), "chosen by the dtype");
    let strides = (strides.0 / sample as isize, strides.1 / sample as isize);
    let (before, behind) = reach(shape, strides).expect("an array that exists can be addressed");
    // SAFETY: `PyArrayDyn<T>` is a transparent NumPy array whatever T is, and no element is read as T.
    let bytes: &Bound<'_, PyArrayDyn<u8>> = unsafe { array.cast_unchecked() };
    let first = bytes.data().cast::<T>().cast_const();
    // SAFETY: from the lowest to the highest number of the array, by the caller's word: its own memory or that of the
    // array that it is a view of. A `Sample` takes any bits.
    let data = unsafe { std::slice::from_raw_parts(first.wrapping_sub(before), before + behind + 1) };
    Strided::with_strides(data, shape, before, strides)
}

/// Borrows an array for reading, until the result is dropped; no Python code of an argument may run meanwhile.
pub(super) fn borrow<'py, T: Element>(
    name: &str,
    array: &Bound<'py, PyArrayDyn<T>>,
) -> PyResult<PyReadonlyArrayDyn<'py, T>> {
    array.try_readonly().map_err(|_| {
        ArgumentError::new_err(format!("{name}: another call is writing to this memory; use one array a thread"))
    })
}

/// What rust-numpy is asked to borrow in place of an array: it divides by the greatest common divisor of the strides,
/// which is 0 where all of them are. Such an array is one element, however often it counts, and is borrowed as that.
pub(super) fn to_borrow<'py>(array: &Bound<'py, PyUntypedArray>) -> PyResult<Bound<'py, PyUntypedArray>> {
    if !is_one_element(array) {
        return Ok(array.clone());
    }
    let py = array.py();
    let first = PyTuple::new(py, vec![0; array.ndim()])?.add(PyTuple::new(py, [py.Ellipsis()])?)?;
    Ok(array.get_item(first)?.call_method1("reshape", (1,))?.cast_into()?)
}

/// Whether all the elements are one: no axis steps.
fn is_one_element(array: &Bound<'_, PyUntypedArray>) -> bool {
    array.ndim() > 0 && !array.is_empty() && array.strides().iter().all(|&stride| stride == 0)
}

/// What an argument is that is no array, and how to mend it where that is known, for messages.
pub(super) fn described(object: &Bound<'_, PyAny>) -> PyResult<String> {
    let got = type_name(object);
    if object.is_none() {
        return Ok("NoneType; did reading the file fail? cv2.imread returns None then".to_owned());
    }
    // clouds of pointfile and of Open3D
    match object.getattr_opt("points").or_none(object.py())?.flatten() {
        Some(_) => Ok(format!("{got}; give its array, .points")),
        None => Ok(got),
    }
}

fn is_list(object: &Bound<'_, PyAny>) -> bool {
    object.is_instance_of::<PyList>() || object.is_instance_of::<PyTuple>()
}

/// Refuses a masked array unless nothing is masked: NumPy would drop the mask without a word.
fn refuse_masked(name: &str, array: &Bound<'_, PyUntypedArray>) -> PyResult<()> {
    static MASKED_ARRAY: PyOnceLock<Py<PyType>> = PyOnceLock::new();
    let py = array.py();
    if !array.get_type().is_subclass(MASKED_ARRAY.import(py, "numpy.ma", "MaskedArray")?)? {
        return Ok(());
    }
    let refuse = || {
        ArgumentError::new_err(format!(
            "{name}: expected values none of which is masked, got a MaskedArray with masked ones; say what stands in their place with {name}.filled(value), or leave them out"
        ))
    };
    let masked = py.import("numpy.ma")?.call_method1("is_masked", (array,));
    match masked.and_then(|masked| masked.is_truthy()).or_refuse(py, refuse)? {
        true => Err(refuse()),
        false => Ok(()),
    }
}

/// Refuses masked values within lists: NumPy makes numbers of them.
fn refuse_masked_items(name: &str, object: &Bound<'_, PyAny>, depth: usize) -> PyResult<()> {
    const DEEPEST: usize = 4; // no argument has more axes, and a list may hold itself
    let check = |item: Bound<'_, PyAny>| {
        if item.is_exact_instance_of::<PyFloat>() || item.is_exact_instance_of::<PyInt>() {
            return Ok(());
        }
        match item.cast::<PyUntypedArray>() {
            Ok(array) if !array.get_type().is(item.py().get_type::<PyUntypedArray>()) => refuse_masked(name, array),
            Ok(_) => Ok(()),
            Err(_) if depth < DEEPEST => refuse_masked_items(name, &item, depth + 1),
            Err(_) => Ok(()),
        }
    };
    if let Ok(list) = object.cast::<PyList>() {
        list.iter().try_for_each(check)
    } else if let Ok(tuple) = object.cast::<PyTuple>() {
        tuple.iter().try_for_each(check)
    } else {
        Ok(())
    }
}
