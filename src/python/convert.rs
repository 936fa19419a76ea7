//! Numbers, points and matrices from Python and back.

use std::borrow::Cow;

use nalgebra::{Matrix3, Matrix4, SMatrix};
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{
    PyBool, PyByteArray, PyBytes, PyDict, PyFloat, PyFrozenSet, PyInt, PySet, PyString, PyTuple, PyType,
};

use super::arrays;
use super::error::OrRefuse;
use super::error::classes::{ArgumentError, ArgumentTypeError};
pub(super) use super::texts::{text_of, tuple_text, type_name};

/// A word; what is no Unicode, such as a lone surrogate, is in it as U+FFFD. `expected` begins the message.
pub(super) fn word<'a>(expected: &str, object: &'a Bound<'_, PyAny>) -> PyResult<Cow<'a, str>> {
    match object.cast::<PyString>() {
        Ok(text) => Ok(text.to_string_lossy()),
        Err(_) => Err(ArgumentTypeError::new_err(format!("{expected}, got {}", type_name(object)))),
    }
}

/// Real numbers of an array-like as C-contiguous float64, borrowed: no Python code of an argument may run meanwhile.
pub(super) struct Floats<'py> {
    array: PyReadonlyArrayDyn<'py, f64>,
}

impl<'py> Floats<'py> {
    /// Converts with NumPy; complex numbers, strings, objects and ragged lists are refused.
    pub(super) fn new(name: &str, expected: &str, object: &Bound<'py, PyAny>) -> PyResult<Self> {
        Self::of(name, &arrays::numbers(name, expected, object)?)
    }

    /// Of an array of real numbers.
    pub(super) fn of(name: &str, array: &Bound<'py, PyUntypedArray>) -> PyResult<Self> {
        Ok(Self { array: arrays::borrow(name, &arrays::require::<f64>(name, array)?)? })
    }

    pub(super) fn shape(&self) -> &[usize] {
        self.array.shape()
    }

    pub(super) fn array(&self) -> &Bound<'py, PyUntypedArray> {
        self.array.as_untyped()
    }

    pub(super) fn values(&self) -> &[f64] {
        self.array.as_slice().expect("`require` makes it aligned and C-contiguous")
    }

    /// The rows of an (N, k) array.
    pub(super) fn rows<const K: usize>(&self, name: &str) -> PyResult<&[[f64; K]]> {
        match *self.shape() {
            [_, columns] if columns == K => Ok(self.values().as_chunks::<K>().0),
            _ => Err(ArgumentError::new_err(format!(
                "{name}: expected shape (N, {K}), got {}{}",
                tuple_text(self.shape()),
                rows_hint(name, self.shape(), K)
            ))),
        }
    }
}

/// How an array of another shape becomes (N, columns), for messages.
pub(super) fn rows_hint(name: &str, shape: &[usize], columns: usize) -> String {
    let first = format!("; use {name}[:, :{columns}] if the first {columns} columns are meant");
    match *shape {
        [length] if length == columns => format!("; a single one is {name}[None]"),
        [_, 2] if columns == 3 => {
            format!("; points on the road are numpy.column_stack([{name}, numpy.zeros(len({name}))])")
        }
        [_, others] if others == columns + 1 => first,
        [rows, _] if rows == columns => format!("; use {name}.T if its rows are coordinates"),
        [_, others] if others > columns => first,
        [_, .., last] if shape.len() > 2 && last == columns => format!("; use {name}.reshape(-1, {columns})"),
        _ => String::new(),
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
    let row_major = matrix.transpose().as_slice().to_vec(); // nine or sixteen
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
    if let Ok(number) = object.cast_exact::<PyFloat>() {
        return Ok(number.value());
    }
    if object.is_instance_of::<PyString>() {
        return Err(refuse());
    }
    if let Ok(array) = object.cast::<PyUntypedArray>() {
        arrays::own_class(name, array.clone())?; // what is masked would be NaN
    }
    object.extract::<f64>().or_refuse(object.py(), refuse)
}

/// `K` real numbers.
pub(super) fn floats<const K: usize>(name: &str, meaning: &str, object: &Bound<'_, PyAny>) -> PyResult<[f64; K]> {
    let refuse =
        |got: String| ArgumentTypeError::new_err(format!("{name}: expected {meaning}, {K} numbers, got {got}"));
    let items = items(object, refuse)?;
    let numbers = items.iter().map(|item| float(name, item)).collect::<PyResult<Vec<_>>>()?;
    numbers.try_into().map_err(|_| {
        let count = count_text(items.len());
        ArgumentError::new_err(format!("{name}: expected {meaning}, {K} numbers, got {count} of them"))
    })
}

/// One real number for both, or two.
pub(super) fn float_or_two(name: &str, meaning: &str, object: &Bound<'_, PyAny>) -> PyResult<[f64; 2]> {
    match float(name, object) {
        Err(error) if error.is_instance_of::<ArgumentTypeError>(object.py()) => floats(name, meaning, object),
        number => number.map(|number| [number; 2]),
    }
}

/// So many items are looked at of an argument that wants a few: an iterator may have no end.
pub(super) const MOST_ITEMS: usize = 100;

/// The items of a sequence or an iterator, not more than [`MOST_ITEMS`]; texts and what has no order are refused.
pub(super) fn items<'py>(
    object: &Bound<'py, PyAny>,
    refuse: impl Fn(String) -> PyErr,
) -> PyResult<Vec<Bound<'py, PyAny>>> {
    items_up_to(MOST_ITEMS, object, refuse)
}

/// Likewise, not more than so many.
pub(super) fn items_up_to<'py>(
    most: usize,
    object: &Bound<'py, PyAny>,
    refuse: impl Fn(String) -> PyErr,
) -> PyResult<Vec<Bound<'py, PyAny>>> {
    let unordered =
        object.is_instance_of::<PySet>() || object.is_instance_of::<PyFrozenSet>() || object.is_instance_of::<PyDict>();
    if is_text(object) || unordered {
        return Err(refuse(type_name(object)));
    }
    let py = object.py();
    let items = object.try_iter().and_then(|items| items.take(most).collect());
    items.or_refuse(py, || refuse(type_name(object)))
}

/// How many [`items`] there were, for messages.
pub(super) fn count_text(count: usize) -> String {
    if count < MOST_ITEMS { count.to_string() } else { format!("at least {count}") }
}

/// A whole number, by `__index__`.
pub(super) enum Whole {
    Number(i128),
    /// One that 128 bits do not hold.
    Beyond,
    /// None at all.
    Other,
}

/// Reads a whole number; floats are none, and whether bools are is up to the caller.
pub(super) fn whole_number(object: &Bound<'_, PyAny>) -> PyResult<Whole> {
    let py = object.py();
    let index = match object.cast_exact::<PyInt>() {
        Ok(number) => Some(number.as_any().clone()),
        Err(_) => py.import("operator")?.call_method1("index", (object,)).or_none(py)?,
    };
    let Some(index) = index else { return Ok(Whole::Other) };
    Ok(index.extract::<i128>().or_none(py)?.map_or(Whole::Beyond, Whole::Number))
}

/// A whole number of at least 0 that fits 32 bits; floats and bools are refused.
pub(super) fn whole(name: &str, object: &Bound<'_, PyAny>) -> PyResult<u32> {
    let outside = |got: String| {
        ArgumentError::new_err(format!(
            "{name}: expected a whole number of pixels, from 0 to 2^32 - 1, got {got}; correct it"
        ))
    };
    let is_bool = object.is_instance_of::<PyBool>();
    match whole_number(object)? {
        Whole::Number(number) if !is_bool => u32::try_from(number).map_err(|_| outside(number.to_string())),
        Whole::Beyond => Err(outside("one beyond 128 bits".to_owned())),
        _ => {
            let got = if object.is_instance_of::<PyFloat>() { text_of(object)? } else { type_name(object) };
            Err(ArgumentTypeError::new_err(format!("{name}: expected a whole number, got {got}; give an int")))
        }
    }
}

/// True or False, NumPy's too.
pub(super) fn flag(name: &str, object: &Bound<'_, PyAny>) -> PyResult<bool> {
    let refuse = || ArgumentTypeError::new_err(format!("{name}: expected True or False, got {}", type_name(object)));
    object.extract::<bool>().or_refuse(object.py(), refuse)
}

/// (width, height).
pub(super) fn size(name: &str, object: &Bound<'_, PyAny>) -> PyResult<(u32, u32)> {
    let refuse = |got: String| {
        ArgumentTypeError::new_err(format!(
            "{name}: expected (width, height), two whole numbers, got {got}; give them as in (1920, 1080)"
        ))
    };
    let items = items(object, refuse)?;
    match items.as_slice() {
        [width, height] => Ok((whole(name, width)?, whole(name, height)?)),
        _ => Err(ArgumentError::new_err(format!(
            "{name}: expected (width, height), two whole numbers, got {} of them; give them as in (1920, 1080)",
            count_text(items.len())
        ))),
    }
}

/// A call of something whose arguments are named: what it is, and how it is written.
pub(super) struct Call {
    function: &'static str,
    example: &'static str,
}

impl Call {
    /// Refuses arguments by position, which Python would count without naming them.
    pub(super) fn new(
        function: &'static str,
        example: &'static str,
        positional: &Bound<'_, PyTuple>,
    ) -> PyResult<Self> {
        if positional.is_empty() {
            return Ok(Self { function, example });
        }
        let count = positional.len();
        Err(ArgumentTypeError::new_err(format!(
            "{function}: expected its arguments by name, got {count} by position that must be named; write {example}"
        )))
    }

    /// An argument that must be given.
    pub(super) fn needs<'a, 'py>(
        &self,
        name: &str,
        object: Option<&'a Bound<'py, PyAny>>,
    ) -> PyResult<&'a Bound<'py, PyAny>> {
        object.ok_or_else(|| {
            let Self { function, example } = self;
            ArgumentTypeError::new_err(format!(
                "{name}: expected an argument {name}= of {function}, got None; write {example}"
            ))
        })
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
