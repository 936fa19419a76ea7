//! Maps as `cv2.remap` takes them.

use numpy::{PyArrayDescrMethods, PyReadonlyArrayDyn, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::prelude::*;

use super::arrays;
use super::convert::tuple_text;
use super::error::classes::{ArgumentTypeError, DtypeError, LutError};
use crate::view::buffer;

/// A map as an array: all that runs Python code.
fn map_array<'py>(name: &str, object: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyUntypedArray>> {
    let Ok(array) = object.cast::<PyUntypedArray>() else {
        let got = arrays::described(object)?;
        let message = format!("{name}: expected a NumPy array of float32 or float64, got {got}");
        return Err(ArgumentTypeError::new_err(message));
    };
    arrays::own_class(name, array.clone())
}

/// Both maps as arrays. The second of fixed-point maps may be missing, as `cv2.convertMaps` leaves it out for nearest.
pub(super) fn map_arrays<'py>(map_x: &Bound<'py, PyAny>, map_y: &Bound<'py, PyAny>) -> PyResult<MapArrays<'py>> {
    let map_x = map_array("map_x", map_x)?;
    let map_y = match is_fixed(&map_x) && map_y.is_none() {
        true => None,
        false => Some(map_array("map_y", map_y)?),
    };
    Ok((map_x, map_y))
}

/// A map of columns, or of both in fixed point, and one of rows, or of fractions.
pub(super) type MapArrays<'py> = (Bound<'py, PyUntypedArray>, Option<Bound<'py, PyUntypedArray>>);

/// Whether a map is the first of two in fixed point: whole pixels, CV_16SC2.
fn is_fixed(map: &Bound<'_, PyUntypedArray>) -> bool {
    (map.dtype().kind(), map.dtype().itemsize(), map.ndim()) == (b'i', 2, 3) && map.shape()[2] == 2
}

/// Two maps of one shape and dtype, borrowed: C-contiguous, copied only where they are not. Those in fixed point become
/// float32, which holds them exactly.
pub(super) enum MapPair<'py> {
    Fixed { maps: [Vec<f32>; 2], shape: (usize, usize) },
    F32(PyReadonlyArrayDyn<'py, f32>, PyReadonlyArrayDyn<'py, f32>),
    F64(PyReadonlyArrayDyn<'py, f64>, PyReadonlyArrayDyn<'py, f64>),
}

impl<'py> MapPair<'py> {
    pub(super) fn new((map_x, map_y): &MapArrays<'py>) -> PyResult<Self> {
        if is_fixed(map_x) {
            return Self::fixed(map_x, map_y.as_ref().filter(|map| !map.is_empty()));
        }
        let Some(map_y) = map_y else { return Err(LutError::new_err("map_y: expected a map of rows, got None")) };
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

    /// Whole pixels (rows, columns, 2) of int16, and for each 32 times the fraction along x, below 32, and 1024 times that
    /// along y: `cv2.convertMaps`' CV_16SC2 and CV_16UC1.
    fn fixed(whole: &Bound<'py, PyUntypedArray>, fractions: Option<&Bound<'py, PyUntypedArray>>) -> PyResult<Self> {
        let shape = (whole.shape()[0], whole.shape()[1]);
        if shape.0 == 0 || shape.1 == 0 {
            return Err(LutError::new_err(format!(
                "map_x: expected at least one cell, got shape {}",
                tuple_text(whole.shape())
            )));
        }
        if let Some(map) = fractions {
            let dtype = map.dtype();
            if !matches!((dtype.kind(), dtype.itemsize()), (b'u' | b'i', 2)) {
                return Err(DtypeError::new_err(format!(
                    "map_y: expected uint16 fractions beside a map_x of int16 pairs, got {dtype}; pass both of what \
                     cv2.convertMaps gives, or None for whole pixels"
                )));
            }
            if map.shape() != [shape.0, shape.1] {
                return Err(LutError::new_err(format!(
                    "map_y: expected the shape of map_x without its pairs, ({}, {}), got {}",
                    shape.0,
                    shape.1,
                    tuple_text(map.shape())
                )));
            }
        }
        let pairs = borrow::<i16>("map_x", whole)?;
        let pairs = pairs.as_slice()?;
        let parts = fractions.map(Self::fractions).transpose()?;
        let of = |axis: usize| -> crate::Result<Vec<f32>> {
            let part =
                |cell: usize| parts.as_ref().map_or(0.0, |parts| f32::from(parts[cell] >> (5 * axis) & 31) / 32.0);
            let places = pairs.iter().skip(axis).step_by(2).enumerate();
            buffer::collected("maps", places.map(|(cell, &whole)| f32::from(whole) + part(cell)))
        };
        Ok(Self::Fixed { maps: [of(0)?, of(1)?], shape })
    }

    /// The fractions of both axes in one number.
    fn fractions(map: &Bound<'py, PyUntypedArray>) -> PyResult<Vec<u16>> {
        let copied = |numbers: &[u16]| Ok(buffer::copied("maps", numbers)?);
        match map.dtype().kind() {
            b'u' => copied(borrow::<u16>("map_y", map)?.as_slice()?),
            _ => copied(bytemuck::must_cast_slice(borrow::<i16>("map_y", map)?.as_slice()?)),
        }
    }

    /// (rows, columns).
    pub(super) fn shape(&self) -> (usize, usize) {
        let shape = match self {
            Self::Fixed { shape, .. } => return *shape,
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
            _ => "maps in fixed point are int16 pairs (rows, columns, 2) and uint16, as cv2.convertMaps gives them"
                .to_owned(),
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
