//! Maps as `cv2.remap` takes them.

use numpy::{
    PyArrayDescrMethods, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::prelude::*;

use super::convert::{tuple_text, type_name};
use super::error::classes::{ArgumentTypeError, DtypeError, LutError};

/// Two maps of one shape and dtype.
pub(super) fn map_pair<'py>(
    map_x: &Bound<'py, PyAny>,
    map_y: &Bound<'py, PyAny>,
) -> PyResult<(Bound<'py, PyUntypedArray>, Bound<'py, PyUntypedArray>)> {
    let (map_x, map_y) = (map_array("map_x", map_x)?, map_array("map_y", map_y)?);
    if map_x.shape() != map_y.shape() {
        return Err(LutError::new_err(format!(
            "map_y: expected the shape of map_x, {}, got {}",
            tuple_text(map_x.shape()),
            tuple_text(map_y.shape())
        )));
    }
    if !map_x.dtype().is_equiv_to(&map_y.dtype()) {
        let message = format!("map_y: expected the dtype of map_x, {}, got {}", map_x.dtype(), map_y.dtype());
        return Err(DtypeError::new_err(message));
    }
    Ok((map_x, map_y))
}

/// A map as an array of float32 or float64.
fn map_array<'py>(name: &str, object: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyUntypedArray>> {
    let Ok(array) = object.cast::<PyUntypedArray>() else {
        let message = format!("{name}: expected a NumPy array of float32 or float64, got {}", type_name(object));
        return Err(ArgumentTypeError::new_err(message));
    };
    let dtype = array.dtype();
    if dtype.kind() != b'f' || !matches!(dtype.itemsize(), 4 | 8) || dtype.is_native_byteorder() == Some(false) {
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
    Ok(array.clone())
}

/// An array in C order, copied only where it is not.
pub(super) fn contiguous<'py, T: numpy::Element>(
    array: &Bound<'py, PyUntypedArray>,
) -> PyResult<PyReadonlyArrayDyn<'py, T>> {
    let array = array.py().import("numpy")?.call_method1("ascontiguousarray", (array,))?;
    let array = array.cast_into::<PyArrayDyn<T>>()?;
    array.try_readonly().map_err(|error| LutError::new_err(format!("maps: {error}")))
}
