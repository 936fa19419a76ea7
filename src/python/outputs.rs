//! `out=` of calls that give rows of numbers: all of it is checked before anything is written.

use std::ops::Range;

use numpy::{
    Element, PyArrayDescrMethods, PyArrayDyn, PyArrayMethods, PyReadwriteArrayDyn, PyUntypedArray,
    PyUntypedArrayMethods, dtype,
};
use pyo3::prelude::*;

use super::convert::tuple_text;
use super::error::classes::{ArgumentError, DtypeError};
use super::image::empty_array;
use super::shared;

/// An argument that is read, and its name.
pub(super) type Input<'a, 'py> = (&'a str, &'a Bound<'py, PyUntypedArray>);

/// An array that is given to write to.
pub(super) struct Given<'py> {
    /// What it is called in messages.
    name: String,
    object: Bound<'py, PyAny>,
    array: Bound<'py, PyUntypedArray>,
}

impl<'py> Given<'py> {
    /// Takes an argument as an array, not yet checked; its Python code runs here.
    pub(super) fn new(name: &str, object: &Bound<'py, PyAny>) -> PyResult<Self> {
        Ok(Self { name: name.to_owned(), object: object.clone(), array: shared::array(name, object, true)? })
    }

    /// [`Given::new`] of an argument that may be missing or `None`.
    pub(super) fn optional(name: &str, object: Option<&Bound<'py, PyAny>>) -> PyResult<Option<Self>> {
        object.filter(|object| !object.is_none()).map(|object| Self::new(name, object)).transpose()
    }

    /// Whether it shares memory with another.
    pub(super) fn check_apart(&self, other: &Self) -> PyResult<()> {
        self.check_input((&other.name, &other.array))
    }

    fn check_input(&self, (input, array): Input<'_, 'py>) -> PyResult<()> {
        let (read, written) = (span(array), span(&self.array));
        if read.start < written.end && written.start < read.end {
            let name = &self.name;
            return Err(ArgumentError::new_err(format!(
                "{name}: expected memory of its own, got memory that {input} spans too; pass out=None or another array"
            )));
        }
        Ok(())
    }

    /// Checks that it can take numbers of that shape, and that it shares no memory with what is read.
    fn check<T: Element>(&self, shape: &[usize], inputs: &[Input<'_, 'py>]) -> PyResult<()> {
        let (name, array, expected) = (&self.name, &self.array, dtype::<T>(self.object.py()));
        if array.shape() != shape {
            let (expected, got) = (tuple_text(shape), tuple_text(array.shape()));
            return Err(ArgumentError::new_err(format!("{name}: expected shape {expected}, got {got}")));
        }
        if !array.dtype().is_equiv_to(&expected) {
            let got = array.dtype();
            return Err(DtypeError::new_err(format!("{name}: expected dtype {expected}, got {got}")));
        }
        if !array.is_c_contiguous() || !array.is_aligned() {
            return Err(ArgumentError::new_err(format!(
                "{name}: expected a C-contiguous, aligned array, got strides {:?}; use numpy.empty({}, {expected:?})",
                array.strides(),
                tuple_text(shape)
            )));
        }
        inputs.iter().try_for_each(|&input| self.check_input(input))
    }
}

/// Numbers that a call writes: an array that was given for them, or a new one.
pub(super) struct Numbers<'py, T> {
    array: Bound<'py, PyArrayDyn<T>>,
    given: Option<Bound<'py, PyAny>>,
}

impl<'py, T: Element> Numbers<'py, T> {
    /// The array that was given, checked, or a new one, not initialised.
    pub(super) fn new(
        py: Python<'py>,
        given: Option<Given<'py>>,
        shape: &[usize],
        inputs: &[Input<'_, 'py>],
    ) -> PyResult<Self> {
        let Some(given) = given else {
            return Ok(Self { array: empty_array(shape, dtype::<T>(py))?.cast_into()?, given: None });
        };
        given.check::<T>(shape, inputs)?;
        Ok(Self { array: given.array.cast_into()?, given: Some(given.object) })
    }

    /// Borrows it for writing.
    pub(super) fn write(&self, name: &str) -> PyResult<PyReadwriteArrayDyn<'py, T>> {
        self.array.try_readwrite().map_err(|error| match error {
            numpy::BorrowError::NotWriteable => ArgumentError::new_err(format!(
                "{name}: expected a writable array, got a read-only one; pass out=None or a copy"
            )),
            _ => ArgumentError::new_err(format!(
                "{name}: another call is writing to or reading from this memory; use one array a thread"
            )),
        })
    }

    /// Sets all bytes to 0, which are a value of every type: what NumPy does not initialise may be none of a bool.
    pub(super) fn clear(&self, write: &mut PyReadwriteArrayDyn<'py, T>) {
        assert_eq!(write.data(), self.array.data(), "borrowed from this");
        // SAFETY: the array is C-contiguous, borrowed for writing, and so many elements long; zero bytes are a number,
        // and false.
        unsafe { write.data().write_bytes(0, write.len()) }
    }

    /// What the call returns: the object that was given, or the new array.
    pub(super) fn into_object(self) -> Bound<'py, PyAny> {
        self.given.unwrap_or_else(|| self.array.into_any())
    }
}

/// The addresses between which an array's elements lie.
fn span(array: &Bound<'_, PyUntypedArray>) -> Range<usize> {
    if array.is_empty() {
        return 0..0;
    }
    // SAFETY: `PyArrayDyn<T>` is a transparent NumPy array whatever T is, and no element is read as T.
    let bytes: &Bound<'_, PyArrayDyn<u8>> = unsafe { array.cast_unchecked() };
    let first = bytes.data().addr();
    let (mut start, mut end) = (first, first + array.dtype().itemsize());
    for (&count, &stride) in array.shape().iter().zip(array.strides()) {
        let far = stride * (count as isize - 1);
        start = start.wrapping_add_signed(far.min(0));
        end = end.wrapping_add_signed(far.max(0));
    }
    start..end
}
