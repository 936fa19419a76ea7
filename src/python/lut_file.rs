//! `Lut.save`, `Lut.load` and `Lut.export`, which Python writes, and what Python needs of the core for it.

use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyType};

use super::convert::type_name;
use super::detached;
use super::error::classes::{ArgumentError, ArgumentTypeError};
use super::lut::PyLut;

const MODULE: &str = "ipm_rs.files.luts";

#[pymethods]
impl PyLut {
    #[doc = help!("Lut.save")]
    fn save(slf: &Bound<'_, Self>, path: &Bound<'_, PyAny>) -> PyResult<()> {
        slf.py().import(MODULE)?.call_method1("save", (slf, path)).map(drop)
    }

    #[doc = help!("Lut.load")]
    #[classmethod]
    #[pyo3(signature = (path, *, expect = None, source_size = None))]
    fn load<'py>(
        cls: &Bound<'py, PyType>,
        path: &Bound<'py, PyAny>,
        expect: Option<&Bound<'py, PyAny>>,
        source_size: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        cls.py().import(MODULE)?.call_method1("load", (path, expect, source_size))
    }

    #[doc = help!("Lut.export")]
    #[pyo3(signature = (path, *, format = None))]
    fn export(slf: &Bound<'_, Self>, path: &Bound<'_, PyAny>, format: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
        slf.py().import(MODULE)?.call_method1("export", (slf, path, format)).map(drop)
    }
}

/// XXH3-64 of a range of bytes, for files.
#[pyfunction(name = "_checksum")]
#[pyo3(signature = (data, start = None, stop = None))]
pub(super) fn checksum(data: &Bound<'_, PyAny>, start: Option<usize>, stop: Option<usize>) -> PyResult<u64> {
    let bytes = range_of("data", data, start, stop)?;
    detached::run(data.py(), || Ok(crate::checksum(bytes)))
}

/// Part of a bytes object, without the copy that a slice is in Python.
///
/// # Errors
/// `ArgumentTypeError`: it is no bytes object. `ArgumentError`: it has no such range.
pub(super) fn range_of<'a>(
    name: &str,
    data: &'a Bound<'_, PyAny>,
    start: Option<usize>,
    stop: Option<usize>,
) -> PyResult<&'a [u8]> {
    let Ok(bytes) = data.cast::<PyBytes>() else {
        let message = format!("{name}: expected the bytes of a table, got {}", type_name(data));
        return Err(ArgumentTypeError::new_err(message));
    };
    let bytes = bytes.as_bytes();
    let (start, stop) = (start.unwrap_or(0), stop.unwrap_or(bytes.len()));
    bytes.get(start..stop).ok_or_else(|| {
        let length = bytes.len();
        ArgumentError::new_err(format!("{name}: expected a range of its {length} bytes, got {start} to {stop}"))
    })
}
