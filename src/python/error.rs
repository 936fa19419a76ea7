//! Which exception each error is.

use pyo3::exceptions::{PyException, PyKeyboardInterrupt, PyMemoryError};
use pyo3::types::{PyAnyMethods, PyStringMethods, PyTypeMethods};
use pyo3::{PyErr, PyResult, Python};

use super::mend::message;
use crate::error::{self, CameraError, CloudError, Error, PoseError, ViewError, WarpError};

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

/// The exception of a transform that is not rigid, which an argument is.
pub(super) fn of_argument(name: &str, error: PoseError) -> PyErr {
    let error = Error::from(error);
    classes::CalibrationError::new_err(format!("{name}: {}", message(&error).trim_start_matches("pose: ")))
}

impl From<Error> for PyErr {
    fn from(error: Error) -> Self {
        let raise = class_of(&error);
        raise(message(&error))
    }
}

/// What makes the exception of an error from its message.
fn class_of(error: &Error) -> fn(String) -> PyErr {
    use classes::{ArgumentError, CalibrationError, GridError, ImageError, LutError, OutOfMemoryError};
    match error {
        Error::NotFinite { .. } | Error::Pose(_) | Error::Lens(_) => CalibrationError::new_err,
        Error::Camera(CameraError::Intrinsics { .. } | CameraError::FocalLength { .. }) => CalibrationError::new_err,
        Error::Cloud(CloudError::Singular { .. }) => CalibrationError::new_err,
        Error::Grid(_) => GridError::new_err,
        Error::Table(_) | Error::Lut(error::LutError::MapLength { .. } | error::LutError::Homography { .. }) => {
            LutError::new_err
        }
        Error::View(error) => match error {
            ViewError::ImageSize { .. } | ViewError::BorderChannels { .. } | ViewError::PointTable { .. } => {
                ArgumentError::new_err
            }
            ViewError::EmptyImage { .. }
            | ViewError::ImageBuffer { .. }
            | ViewError::SizeMismatch { .. }
            | ViewError::MaskSize { .. }
            | ViewError::OutputShape { .. } => ImageError::new_err,
        },
        Error::Rig(_)
        | Error::Mosaic(_)
        | Error::Warp(WarpError::ImageCount { .. } | WarpError::MixedChannels { .. }) => ImageError::new_err,
        Error::Cloud(
            CloudError::DepthChannels { .. }
            | CloudError::NegativeDepth { .. }
            | CloudError::DepthSize { .. }
            | CloudError::MaskSize { .. },
        ) => ImageError::new_err,
        Error::Angle { .. }
        | Error::Points(_)
        | Error::Camera(_)
        | Error::Ground(_)
        | Error::Lut(error::LutError::AreaSize { .. })
        | Error::Warp(_)
        | Error::Cloud(_)
        | Error::Raster(_)
        | Error::Threads(_)
        | Error::Isa(_) => ArgumentError::new_err,
        // who asks for it raises the exception that came of asking instead, see `signals`
        Error::Interrupted => PyKeyboardInterrupt::new_err,
        Error::OutOfMemory { .. } => OutOfMemoryError::new_err,
    }
}

/// Errors of one concern are raised as they are.
macro_rules! raise {
    ($($concern:ident),*) => {$(
        impl From<error::$concern> for PyErr {
            fn from(error: error::$concern) -> Self {
                Error::from(error).into()
            }
        }
    )*};
}
raise!(CloudError, GridError, IsaError, PoseError, RasterError, TableError, ViewError, WarpError);
