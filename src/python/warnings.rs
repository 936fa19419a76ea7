//! Findings of the core as Python warnings.

use std::ffi::CString;

use pyo3::prelude::*;
use pyo3::types::PyAnyMethods;

use super::error::classes::CalibrationWarning;
use crate::{Camera, Finding};

/// Gives a `CalibrationWarning` for each finding, at the line of the caller's that is not in this package. An error where
/// the caller's filters make it one.
pub(super) fn warn(py: Python<'_>, findings: &[Finding]) -> PyResult<()> {
    if findings.is_empty() {
        return Ok(());
    }
    let (category, level) = (py.get_type::<CalibrationWarning>(), stack_level(py)?);
    for finding in findings {
        let text = CString::new(finding.to_string())?;
        PyErr::warn(py, &category, &text, level)?;
    }
    Ok(())
}

/// A camera that somebody made, refused where it can be none, with a warning of what is odd about it.
pub(super) fn checked(py: Python<'_>, camera: Camera) -> PyResult<Camera> {
    warn(py, &camera.plausibility()?)?;
    Ok(camera)
}

/// How many Python frames up the first one of a caller is: 1 for a caller of the extension. Frames of this package are not,
/// nor those through which it calls itself (a reader under `numpy.errstate`). Where all are, as on the command line, the
/// outermost.
fn stack_level(py: Python<'_>) -> PyResult<i32> {
    const BETWEEN: [&str; 3] = ["ipm_rs", "numpy", "contextlib"];
    let mut level = 1;
    // raises where no Python code runs at all
    let Ok(mut frame) = py.import("sys")?.call_method0("_getframe") else { return Ok(level) };
    loop {
        let module = frame.getattr("f_globals")?.call_method1("get", ("__name__",))?;
        let package = module.extract::<String>().unwrap_or_default();
        let inside = BETWEEN.contains(&package.split('.').next().unwrap_or_default());
        let back = frame.getattr("f_back")?;
        if !inside || back.is_none() {
            return Ok(level);
        }
        (frame, level) = (back, level + 1);
    }
}
