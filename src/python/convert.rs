//! Numbers, points and matrices from Python and back.

use nalgebra::{Matrix3, Matrix4, SMatrix};
use numpy::{
    PyArray1, PyArray2, PyArrayDescrMethods, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use pyo3::types::{PyByteArray, PyBytes, PyDict, PyString, PyTuple, PyType};

use super::error::classes::{ArgumentError, ArgumentTypeError};

/// The name of an object's type, for messages.
pub(super) fn type_name(object: &Bound<'_, PyAny>) -> String {
    object.get_type().name().map_or_else(|_| "an object".to_owned(), |name| name.to_string())
}

/// An array-like of real numbers as a C-contiguous float64 array.
pub(super) struct Floats<'py> {
    array: PyReadonlyArrayDyn<'py, f64>,
}

impl<'py> Floats<'py> {
    /// Converts with NumPy; complex numbers, strings, objects and ragged lists are refused.
    pub(super) fn new(name: &str, expected: &str, object: &Bound<'py, PyAny>) -> PyResult<Self> {
        let numpy = object.py().import("numpy")?;
        let refuse =
            |got: String| ArgumentTypeError::new_err(format!("{name}: expected {expected} of real numbers, got {got}"));
        let array =
            numpy.call_method1("asarray", (object,)).map_err(|_| refuse(format!("a ragged {}", type_name(object))))?;
        let array = array.cast_into::<PyUntypedArray>().map_err(|_| refuse(type_name(object)))?;
        if !matches!(array.dtype().kind(), b'b' | b'i' | b'u' | b'f') {
            return Err(refuse(format!("{} of dtype {}", type_name(object), array.dtype())));
        }
        let options = PyDict::new(object.py());
        options.set_item("dtype", "float64")?;
        options.set_item("order", "C")?;
        let array = numpy.call_method("asarray", (array,), Some(&options))?;
        let array = array.cast_into::<numpy::PyArrayDyn<f64>>().map_err(|_| refuse(type_name(object)))?;
        let array = array.try_readonly().map_err(|error| ArgumentError::new_err(format!("{name}: {error}")))?;
        Ok(Self { array })
    }

    pub(super) fn shape(&self) -> &[usize] {
        self.array.shape()
    }

    /// The converted array.
    pub(super) fn into_array(self) -> Bound<'py, PyUntypedArray> {
        self.array.as_untyped().clone()
    }

    pub(super) fn values(&self) -> &[f64] {
        self.array.as_slice().expect("asked of NumPy in C order")
    }

    /// The rows of an (N, k) array.
    pub(super) fn rows<const K: usize>(&self, name: &str) -> PyResult<&[[f64; K]]> {
        match *self.shape() {
            [_, columns] if columns == K => Ok(self.values().as_chunks::<K>().0),
            _ => Err(ArgumentError::new_err(format!(
                "{name}: expected shape (N, {K}), got {}; a single one is {name}[None]",
                tuple_text(self.shape())
            ))),
        }
    }
}

/// A shape as Python writes it.
pub(super) fn tuple_text(shape: &[usize]) -> String {
    match shape {
        [one] => format!("({one},)"),
        _ => format!("({})", shape.iter().map(usize::to_string).collect::<Vec<_>>().join(", ")),
    }
}

fn matrix<const R: usize, const C: usize>(name: &str, object: &Bound<'_, PyAny>) -> PyResult<SMatrix<f64, R, C>> {
    let floats = Floats::new(name, &format!("a {R}x{C} matrix"), object)?;
    if floats.shape() != [R, C] {
        let got = tuple_text(floats.shape());
        return Err(ArgumentError::new_err(format!("{name}: expected a {R}x{C} matrix, got shape {got}")));
    }
    Ok(SMatrix::from_row_slice(floats.values()))
}

/// A 3x3 matrix of float64.
pub(super) fn matrix3(name: &str, object: &Bound<'_, PyAny>) -> PyResult<Matrix3<f64>> {
    matrix(name, object)
}

/// A 4x4 matrix of float64.
pub(super) fn matrix4(name: &str, object: &Bound<'_, PyAny>) -> PyResult<Matrix4<f64>> {
    matrix(name, object)
}

/// A matrix as a new NumPy array.
pub(super) fn matrix_to_numpy<'py, const R: usize, const C: usize>(
    py: Python<'py>,
    matrix: &SMatrix<f64, R, C>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let row_major = matrix.transpose().as_slice().to_vec();
    PyArray1::from_vec(py, row_major).reshape([R, C])
}

/// (N, K) rows as a new NumPy array.
pub(super) fn rows_to_numpy<const K: usize>(py: Python<'_>, rows: Vec<[f64; K]>) -> PyResult<Bound<'_, PyArray2<f64>>> {
    let count = rows.len();
    PyArray1::from_vec(py, rows.into_flattened()).reshape([count, K])
}

/// Iterable, but no list of numbers.
fn is_text(object: &Bound<'_, PyAny>) -> bool {
    object.is_instance_of::<PyString>() || object.is_instance_of::<PyBytes>() || object.is_instance_of::<PyByteArray>()
}

/// A real number.
pub(super) fn float(name: &str, object: &Bound<'_, PyAny>) -> PyResult<f64> {
    let refuse = || ArgumentTypeError::new_err(format!("{name}: expected a number, got {}", type_name(object)));
    if object.is_instance_of::<PyString>() {
        return Err(refuse());
    }
    object.extract::<f64>().map_err(|_| refuse())
}

/// `K` real numbers.
pub(super) fn floats<const K: usize>(name: &str, meaning: &str, object: &Bound<'_, PyAny>) -> PyResult<[f64; K]> {
    let refuse =
        |got: String| ArgumentTypeError::new_err(format!("{name}: expected {meaning}, {K} numbers, got {got}"));
    if is_text(object) {
        return Err(refuse(type_name(object)));
    }
    let items = object.try_iter().map_err(|_| refuse(type_name(object)))?.collect::<PyResult<Vec<_>>>()?;
    let numbers = items.iter().map(|item| float(name, item)).collect::<PyResult<Vec<_>>>()?;
    let count = numbers.len();
    numbers
        .try_into()
        .map_err(|_| ArgumentError::new_err(format!("{name}: expected {meaning}, {K} numbers, got {count} of them")))
}

/// A whole number of at least 0 that fits 32 bits; floats and bools are refused.
pub(super) fn whole(name: &str, object: &Bound<'_, PyAny>) -> PyResult<u32> {
    let is_bool = object.is_instance_of::<pyo3::types::PyBool>();
    match object.extract::<i64>() {
        Ok(number) if !is_bool => u32::try_from(number).map_err(|_| {
            ArgumentError::new_err(format!(
                "{name}: expected a whole number of pixels, from 0 to 2^32 - 1, got {number}; correct it"
            ))
        }),
        _ => {
            let got = if object.extract::<f64>().is_ok() { object.to_string() } else { type_name(object) };
            Err(ArgumentTypeError::new_err(format!("{name}: expected a whole number, got {got}; give an int")))
        }
    }
}

/// True or False, NumPy's too.
pub(super) fn flag(name: &str, object: &Bound<'_, PyAny>) -> PyResult<bool> {
    object
        .extract::<bool>()
        .map_err(|_| ArgumentTypeError::new_err(format!("{name}: expected True or False, got {}", type_name(object))))
}

/// (width, height).
pub(super) fn size(name: &str, object: &Bound<'_, PyAny>) -> PyResult<(u32, u32)> {
    let refuse = |got: String| {
        ArgumentTypeError::new_err(format!(
            "{name}: expected (width, height), two whole numbers, got {got}; give them as in (1920, 1080)"
        ))
    };
    if is_text(object) {
        return Err(refuse(type_name(object)));
    }
    let items = object.try_iter().map_err(|_| refuse(type_name(object)))?.collect::<PyResult<Vec<_>>>()?;
    match items.as_slice() {
        [width, height] => Ok((whole(name, width)?, whole(name, height)?)),
        _ => Err(ArgumentError::new_err(format!(
            "{name}: expected (width, height), two whole numbers, got {} of them; give them as in (1920, 1080)",
            items.len()
        ))),
    }
}

/// What `__reduce__` returns: a callable and its arguments.
pub(super) type Reduced<'py> = (Bound<'py, PyAny>, (Bound<'py, PyType>, Bound<'py, PyTuple>, Bound<'py, PyDict>));

/// A pickle that calls the class again: `copyreg.__newobj_ex__`, which every pickle protocol understands.
pub(super) fn rebuilt_by_new<'py>(
    class: Bound<'py, PyType>,
    arguments: Bound<'py, PyTuple>,
    keywords: Bound<'py, PyDict>,
) -> PyResult<Reduced<'py>> {
    Ok((class.py().import("copyreg")?.getattr("__newobj_ex__")?, (class, arguments, keywords)))
}
