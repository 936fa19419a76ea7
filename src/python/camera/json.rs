//! `Camera.to_json` and `Camera.save`, which Python writes. Its readers come from Python altogether:
//! `ipm_rs.calibration` attaches `Camera.load` and `Camera.from_<format>` to the class.

use pyo3::prelude::*;

use super::PyCamera;

#[pymethods]
impl PyCamera {
    #[doc = help!("Camera.to_json")]
    fn to_json<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        slf.py().import("ipm_rs.calibration.json")?.call_method1("to_json", (slf,))
    }

    #[doc = help!("Camera.save")]
    fn save(slf: &Bound<'_, Self>, path: &Bound<'_, PyAny>) -> PyResult<()> {
        slf.py().import("ipm_rs.calibration.json")?.call_method1("save", (slf, path)).map(drop)
    }
}
