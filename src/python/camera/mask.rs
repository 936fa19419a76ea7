//! The mask that travels with a camera.

use std::sync::Arc;

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;

use super::PyCamera;
use crate::Error;
use crate::python::detached;
use crate::python::error::classes::ArgumentError;
use crate::python::mask::{mask_of, outside, polygons};
use crate::view::buffer;

#[pymethods]
impl PyCamera {
    #[doc = help!("Camera.masked")]
    #[pyo3(signature = (mask = None, *, hide = None))]
    fn masked(
        &self,
        py: Python<'_>,
        mask: Option<&Bound<'_, PyAny>>,
        hide: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        if mask.is_none() && hide.is_none() {
            return Err(ArgumentError::new_err(
                "mask: expected an array that is True where the image shows the road, or hide= with polygons that do \
                 not, got neither",
            ));
        }
        let given = mask.map(|mask| mask_of("mask", mask, &self.camera)).transpose()?;
        let hidden = hide.map(polygons).transpose()?;
        let mask = detached::run(py, || {
            let drawn = hidden.map(|hidden| outside(&hidden, &self.camera)).transpose()?;
            let all = given.into_iter().chain(drawn).reduce(|mask, other| mask.and(&other)).expect("one was given");
            Ok::<_, Error>(match &self.mask {
                Some(before) => all.and(before),
                None => all,
            })
        })?;
        Ok(Self { camera: self.camera, mask: Some(Arc::new(mask)) })
    }

    #[doc = help!("Camera.mask")]
    #[getter]
    pub(in crate::python) fn mask<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<bool>>>> {
        let Some(mask) = &self.mask else { return Ok(None) };
        let (width, height) = mask.size();
        let shown = PyArray1::from_vec(py, buffer::copied("mask", mask.shown())?);
        shown.reshape([height as usize, width as usize]).map(Some)
    }
}
