//! `PixelRays`.

use std::hash::{Hash, Hasher};

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

use crate::cloud::PixelRays;
use crate::python::camera::PyCamera;
use crate::python::convert::{Reduced, rebuilt_by_new, type_name};
use crate::python::detached;
use crate::python::error::classes::ArgumentTypeError;
use crate::python::options::thread_count;

#[doc = help!("PixelRays")]
#[pyclass(frozen, eq, hash, module = "ipm_rs", name = "PixelRays")]
pub(in crate::python) struct PyPixelRays {
    pub(super) rays: PixelRays,
}

/// The camera says it all.
impl PartialEq for PyPixelRays {
    fn eq(&self, other: &Self) -> bool {
        self.rays.camera() == other.rays.camera()
    }
}

impl Hash for PyPixelRays {
    fn hash<H: Hasher>(&self, state: &mut H) {
        PyCamera::from(*self.rays.camera()).hash(state);
    }
}

#[pymethods]
impl PyPixelRays {
    #[new]
    #[pyo3(signature = (camera, *, threads = None))]
    fn new(py: Python<'_>, camera: &Bound<'_, PyAny>, threads: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        let Ok(camera) = camera.cast::<PyCamera>() else {
            let message = format!("camera: expected an ipm_rs.Camera, got {}", type_name(camera));
            return Err(ArgumentTypeError::new_err(message));
        };
        let threads = threads.map(|threads| thread_count("threads", threads)).transpose()?;
        let camera = camera.get().camera;
        Ok(Self { rays: detached::run(py, || PixelRays::new(&camera, threads))? })
    }

    #[doc = help!("PixelRays.camera")]
    #[getter]
    fn camera(&self) -> PyCamera {
        (*self.rays.camera()).into()
    }

    #[doc = help!("PixelRays.nbytes")]
    #[getter]
    fn nbytes(&self) -> usize {
        self.rays.nbytes()
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        rebuilt_by_new(py.get_type::<Self>(), PyTuple::new(py, [self.camera()])?, PyDict::new(py))
    }

    fn __repr__(&self) -> String {
        format!("PixelRays({})", self.rays.camera())
    }
}
