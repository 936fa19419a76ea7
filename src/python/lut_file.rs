//! `Lut.save`, `Lut.load` and `Lut.export`, which Python writes.

use pyo3::prelude::*;
use pyo3::types::PyType;

use super::detached;
use super::lut::{PyLut, range_of};

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
