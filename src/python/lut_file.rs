//! `Lut.save`, `Lut.load` and `Lut.export`, which Python writes.

use std::io::{self, BufRead, Read};

use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use pyo3::types::PyType;

use super::camera::PyCamera;
use super::detached;
use super::grid::PyBevGrid;
use super::lut::{PyLut, bytes_of};
use crate::Lut;

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

    /// Takes the table that the next `length` bytes of a binary file are; every bound is proved.
    #[classmethod]
    #[pyo3(name = "_read_from", signature = (file, length, camera = None, grid = None, ground = None))]
    fn read_from(
        _cls: &Bound<'_, PyType>,
        file: &Bound<'_, PyAny>,
        length: u64,
        camera: Option<PyRef<'_, PyCamera>>,
        grid: Option<PyRef<'_, PyBevGrid>>,
        ground: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let mut reader = PyReader { file: file.clone().unbind(), left: length, piece: None, used: 0, raised: None };
        let lut = detached::run(file.py(), || Lut::read_from(&mut reader, length));
        match reader.raised {
            Some(error) => Err(error),
            None => Self::of_scene(lut?, camera, grid, ground),
        }
    }

    #[doc = help!("Lut.export")]
    #[pyo3(signature = (path, *, format = None))]
    fn export(slf: &Bound<'_, Self>, path: &Bound<'_, PyAny>, format: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
        slf.py().import(MODULE)?.call_method1("export", (slf, path, format)).map(drop)
    }
}

/// Bytes that a piece has: small enough for a core's own cache, large enough that taking the GIL for it does not count.
const PIECE: u64 = 1 << 17;

/// A part of a binary file of Python's.
struct PyReader {
    file: Py<PyAny>,
    /// Bytes that are not asked for yet.
    left: u64,
    piece: Option<PyBackedBytes>,
    used: usize,
    /// What `file.read` raised.
    raised: Option<PyErr>,
}

impl PyReader {
    fn next_piece(&mut self) -> PyResult<PyBackedBytes> {
        Python::attach(|py| {
            let piece: PyBackedBytes = self.file.bind(py).call_method1("read", (self.left.min(PIECE),))?.extract()?;
            self.left = self.left.saturating_sub(piece.len() as u64);
            Ok(piece)
        })
    }
}

impl BufRead for PyReader {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        if self.piece.as_ref().is_none_or(|piece| piece.len() <= self.used) && self.left > 0 {
            match self.next_piece() {
                Ok(piece) => (self.piece, self.used) = (Some(piece), 0),
                Err(error) => {
                    self.raised = Some(error);
                    return Err(io::Error::other("an exception"));
                }
            }
        }
        Ok(self.piece.as_ref().map_or(&[], |piece| &piece[self.used..]))
    }

    fn consume(&mut self, count: usize) {
        self.used += count;
    }
}

impl Read for PyReader {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.fill_buf()?.read(buffer)?;
        self.consume(count);
        Ok(count)
    }
}

/// XXH3-64 of bytes, for files.
#[pyfunction(name = "_checksum")]
pub(super) fn checksum(data: &Bound<'_, PyAny>) -> PyResult<u64> {
    let bytes = bytes_of("data", data)?;
    detached::run(data.py(), || Ok(crate::checksum(bytes)))
}
