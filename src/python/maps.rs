//! Maps as `cv2.remap` takes them.

use numpy::{PyArrayDescrMethods, PyReadonlyArrayDyn, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::prelude::*;

use super::arrays;
use super::convert::tuple_text;
use super::error::classes::{ArgumentTypeError, DtypeError, LutError};

/// A map as an array: all that runs Python code.
pub(super) fn map_array<'py>(name: &str, object: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyUntypedArray>> {
    let Ok(array) = object.cast::<PyUntypedArray>() else {
        let got = arrays::described(object)?;
        let message = format!("{name}: expected a NumPy array of float32 or float64, got {got}");
        return Err(ArgumentTypeError::new_err(message));
    };
    arrays::own_class(name, array.clone())
}

/// Two maps of one shape and dtype, borrowed: C-contiguous, copied only where they are not.
pub(super) enum MapPair<'py> {
    F32(PyReadonlyArrayDyn<'py, f32>, PyReadonlyArrayDyn<'py, f32>),
    F64(PyReadonlyArrayDyn<'py, f64>, PyReadonlyArrayDyn<'py, f64>),
}

impl<'py> MapPair<'py> {
    pub(super) fn new(map_x: &Bound<'py, PyUntypedArray>, map_y: &Bound<'py, PyUntypedArray>) -> PyResult<Self> {
        check("map_x", map_x)?;
        check("map_y", map_y)?;
        if map_x.shape() != map_y.shape() {
            return Err(LutError::new_err(format!(
                "map_y: expected the shape of map_x, {}, got {}",
                tuple_text(map_x.shape()),
                tuple_text(map_y.shape())
            )));
        }
        if map_x.dtype().itemsize() != map_y.dtype().itemsize() {
            let message = format!("map_y: expected the dtype of map_x, {}, got {}", map_x.dtype(), map_y.dtype());
            return Err(DtypeError::new_err(message));
        }
        match map_x.dtype().itemsize() {
            4 => Ok(Self::F32(borrow("map_x", map_x)?, borrow("map_y", map_y)?)),
            _ => Ok(Self::F64(borrow("map_x", map_x)?, borrow("map_y", map_y)?)),
        }
    }

    /// (rows, columns).
    pub(super) fn shape(&self) -> (usize, usize) {
        let shape = match self {
            Self::F32(map_x, _) => map_x.shape(),
            Self::F64(map_x, _) => map_x.shape(),
        };
        (shape[0], shape[1])
    }
}

fn borrow<'py, T: numpy::Element>(
    name: &str,
    array: &Bound<'py, PyUntypedArray>,
) -> PyResult<PyReadonlyArrayDyn<'py, T>> {
    arrays::borrow(name, &arrays::require::<T>(name, array)?)
}

fn check(name: &str, array: &Bound<'_, PyUntypedArray>) -> PyResult<()> {
    let dtype = array.dtype();
    if dtype.kind() != b'f' || !matches!(dtype.itemsize(), 4 | 8) {
        let mend = match dtype.kind() {
            b'f' => format!("use {name}.astype(numpy.float32)"),
            _ => "fixed-point maps come back with cv2.convertMaps(map1, map2, cv2.CV_32FC1)".to_owned(),
        };
        return Err(DtypeError::new_err(format!("{name}: expected float32 or float64, got {dtype}; {mend}")));
    }
    if array.ndim() != 2 || array.is_empty() {
        let got = tuple_text(array.shape());
        return Err(LutError::new_err(format!(
            "{name}: expected shape (rows, columns) with at least one cell, got {got}"
        )));
    }
    Ok(())
}
