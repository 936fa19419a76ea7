//! Points as arrays: rows of coordinates, their memory borrowed without a copy.

use numpy::{
    PyArrayDescrMethods, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::prelude::*;

use super::arrays;
use super::convert::{rows_hint, tuple_text};
use super::error::classes::ArgumentError;
use crate::view::{PointSample, Strided};

/// An (N, k) array of float32 or float64 whose rows lie anywhere and whose columns are adjacent.
pub(super) struct PointsArray<'py> {
    array: Bound<'py, PyUntypedArray>,
}

impl<'py> PointsArray<'py> {
    /// Takes float32 and float64 as they are, with any row stride; converts everything else that is real numbers to
    /// float64. `columns` are how many there may be, `expected` is how that is written.
    pub(super) fn new(
        name: &str,
        array: Bound<'py, PyUntypedArray>,
        columns: std::ops::RangeInclusive<usize>,
        expected: &str,
    ) -> PyResult<Self> {
        let (dtype, shape) = (array.dtype(), array.shape());
        if shape.len() != 2 || !columns.contains(&shape[1]) {
            return Err(ArgumentError::new_err(format!(
                "{name}: expected shape {expected}, got {}{}",
                tuple_text(shape),
                rows_hint(name, shape, 3)
            )));
        }
        let size = dtype.itemsize() as isize;
        let as_it_is = dtype.kind() == b'f'
            && matches!(size, 4 | 8)
            && dtype.is_native_byteorder() != Some(false)
            && array.is_aligned()
            && (shape[1] == 1 || array.strides()[1] == size)
            && array.strides()[0] % size == 0;
        if as_it_is {
            return Ok(Self { array });
        }
        let array = match (dtype.kind(), size) {
            (b'f', 4) => arrays::require::<f32>(name, &array)?.as_untyped().clone(),
            _ => arrays::require::<f64>(name, &array)?.as_untyped().clone(),
        };
        Ok(Self { array })
    }

    pub(super) fn py(&self) -> Python<'py> {
        self.array.py()
    }

    /// How many points.
    pub(super) fn len(&self) -> usize {
        self.array.shape()[0]
    }

    /// Numbers of each.
    pub(super) fn columns(&self) -> usize {
        self.array.shape()[1]
    }

    /// The array itself.
    pub(super) fn array(&self) -> &Bound<'py, PyUntypedArray> {
        &self.array
    }

    /// Whether they are float32, not float64.
    pub(super) fn is_f32(&self) -> bool {
        self.array.dtype().itemsize() == 4
    }

    /// Borrows the array for reading.
    pub(super) fn read(&self) -> PyResult<ReadingPoints<'_, 'py>> {
        // SAFETY: `PyArrayDyn<T>` is a transparent NumPy array whatever T is, and no element is read as T.
        let bytes: &Bound<'py, PyArrayDyn<u8>> = unsafe { self.array.cast_unchecked() };
        Ok(ReadingPoints { points: self, _borrow: arrays::borrow("points", bytes)? })
    }
}

/// Points whose array is borrowed for reading.
pub(super) struct ReadingPoints<'a, 'py> {
    points: &'a PointsArray<'py>,
    _borrow: PyReadonlyArrayDyn<'py, u8>,
}

impl ReadingPoints<'_, '_> {
    /// The points, `T` being of the array's dtype.
    pub(super) fn view<T: PointSample>(&self) -> crate::Result<Strided<'_, T>> {
        let array = &self.points.array;
        let (count, columns) = (array.shape()[0], array.shape()[1]);
        if count == 0 {
            return Strided::with_strides(&[], (0, columns), 0, (0, 0));
        }
        // an axis of length 1 is never stepped along, so NumPy lets its stride be anything
        let step = |axis: usize| if array.shape()[axis] == 1 { 0 } else { array.strides()[axis] };
        // SAFETY: the array's own strides, and the borrow keeps writers that use rust-numpy away.
        unsafe { arrays::table(array, (count, columns), (step(0), step(1))) }
    }
}
