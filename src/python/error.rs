//! Which exception each error is.

use pyo3::exceptions::{PyException, PyKeyboardInterrupt, PyMemoryError};
use pyo3::types::{PyAnyMethods, PyStringMethods, PyTypeMethods};
use pyo3::{PyErr, PyResult, Python};

use super::mend::message;
use crate::Error;

/// The classes of `ipm_rs.errors`: written in Python, so that each has two bases, pickles, and can be read.
pub(super) mod classes {
    use pyo3::import_exception;

    import_exception!(ipm_rs.errors, ArgumentError);
    import_exception!(ipm_rs.errors, ArgumentTypeError);
    import_exception!(ipm_rs.errors, CalibrationError);
    import_exception!(ipm_rs.errors, CalibrationWarning);
    import_exception!(ipm_rs.errors, DtypeError);
    import_exception!(ipm_rs.errors, GridError);
    import_exception!(ipm_rs.errors, ImageError);
    import_exception!(ipm_rs.errors, IpmError);
    import_exception!(ipm_rs.errors, LutError);
    import_exception!(ipm_rs.errors, OutOfMemoryError);
}

/// What an argument's own Python code raised, told in our words, or left aside; see [`about_argument`] for what is not.
pub(super) trait OrRefuse<T> {
    /// Raises `refusal` from what was raised; an error of ours stays as it is, too.
    fn or_refuse(self, py: Python<'_>, refusal: impl FnOnce() -> PyErr) -> PyResult<T>;

    /// `None` for what was raised.
    fn or_none(self, py: Python<'_>) -> PyResult<Option<T>>;
}

impl<T> OrRefuse<T> for PyResult<T> {
    fn or_refuse(self, py: Python<'_>, refusal: impl FnOnce() -> PyErr) -> PyResult<T> {
        self.map_err(|error| match about_argument(py, error) {
            Ok(error) if error.is_instance_of::<classes::IpmError>(py) => error,
            Ok(error) => {
                let refusal = refusal();
                refusal.set_cause(py, Some(error));
                refusal
            }
            Err(error) => error,
        })
    }

    fn or_none(self, py: Python<'_>) -> PyResult<Option<T>> {
        match self {
            Ok(value) => Ok(Some(value)),
            Err(error) => about_argument(py, error).map(|_| None),
        }
    }
}

/// An exception that says something about the argument whose Python code raised it.
///
/// # Errors
/// Interrupts, exits and a lack of memory, which do not.
pub(super) fn about_argument(py: Python<'_>, error: PyErr) -> PyResult<PyErr> {
    if !error.is_instance_of::<PyException>(py) || error.is_instance_of::<PyMemoryError>(py) {
        return Err(error);
    }
    Ok(error)
}

/// An exception's class and words, for messages.
pub(super) fn error_text(py: Python<'_>, error: &PyErr) -> PyResult<String> {
    const LONGEST: usize = 300;
    let class = error.get_type(py).name()?.to_string_lossy().into_owned();
    let words = error.value(py).str().or_none(py)?.map(|words| words.to_string_lossy().into_owned());
    Ok(match words.filter(|words| (1..=LONGEST).contains(&words.len())) {
        Some(words) => format!("{class}: {words}"),
        None => class,
    })
}

impl From<Error> for PyErr {
    fn from(error: Error) -> Self {
        let message = message(&error);
        match error {
            Error::NotFinite { .. }
            | Error::Intrinsics { .. }
            | Error::FocalLength { .. }
            | Error::LensCoefficients { .. }
            | Error::LensParameter { .. }
            | Error::LensFolds { .. }
            | Error::Singular { .. }
            | Error::NotRigid { .. }
            | Error::LastRow { .. } => classes::CalibrationError::new_err(message),
            Error::GridRange { .. }
            | Error::CellSize { .. }
            | Error::PartialCell { .. }
            | Error::TooManyCells { what: "BevGrid", .. } => classes::GridError::new_err(message),
            Error::TooManyCells { what: "rasterize", .. } => classes::ArgumentError::new_err(message),
            Error::TooManyCells { .. }
            | Error::MapLength { .. }
            | Error::Homography { .. }
            | Error::DamagedTable { .. } => classes::LutError::new_err(message),
            Error::EmptyImage { .. }
            | Error::ImageBuffer { .. }
            | Error::SizeMismatch { .. }
            | Error::Rig { .. }
            | Error::ImageCount { .. }
            | Error::MixedChannels { .. }
            | Error::DepthChannels { .. }
            | Error::NegativeDepth { .. }
            | Error::DepthSize { .. }
            | Error::MaskSize { .. }
            | Error::OutputShape { .. } => classes::ImageError::new_err(message),
            Error::Angle { .. }
            | Error::Ground { .. }
            | Error::Plane { .. }
            | Error::HeightMap { .. }
            | Error::NoData { .. }
            | Error::Points { .. }
            | Error::Binning { .. }
            | Error::Tracing { .. }
            | Error::Winding { .. }
            | Error::Horizon { .. }
            | Error::ImageSize { .. }
            | Error::Crop { .. }
            | Error::BorderChannels { .. }
            | Error::DepthLimit { .. }
            | Error::PointsLength { .. }
            | Error::TooManyPoints { .. }
            | Error::PointTable { .. }
            | Error::PointColumns { .. }
            | Error::PointValues { .. }
            | Error::Slices { .. }
            | Error::Shape { .. }
            | Error::DensityFull { .. }
            | Error::Threads { .. }
            | Error::TooManyThreads { .. }
            | Error::Interpolation { .. }
            | Error::TooManyIds { .. }
            | Error::AreaSize { .. }
            | Error::Isa { .. } => classes::ArgumentError::new_err(message),
            // who asks for it raises the exception that came of asking instead, see `signals`
            Error::Interrupted => PyKeyboardInterrupt::new_err(message),
            Error::OutOfMemory { .. } => classes::OutOfMemoryError::new_err(message),
        }
    }
}
