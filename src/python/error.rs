//! Which exception each error is.

use pyo3::PyErr;

use crate::Error;

/// The classes of `ipm_rs.errors`: written in Python, so that each has two bases, pickles, and can be read.
pub(super) mod classes {
    use pyo3::import_exception;

    import_exception!(ipm_rs.errors, ArgumentError);
    import_exception!(ipm_rs.errors, ArgumentTypeError);
    import_exception!(ipm_rs.errors, CalibrationError);
    import_exception!(ipm_rs.errors, DtypeError);
    import_exception!(ipm_rs.errors, GridError);
    import_exception!(ipm_rs.errors, ImageError);
    import_exception!(ipm_rs.errors, LutError);
    import_exception!(ipm_rs.errors, OutOfMemoryError);
}

impl From<Error> for PyErr {
    fn from(error: Error) -> Self {
        let message = error.to_string();
        match error {
            Error::NotFinite { .. }
            | Error::Intrinsics { .. }
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
            | Error::ImageCount { .. }
            | Error::MixedChannels { .. }
            | Error::DepthChannels { .. }
            | Error::NegativeDepth { .. }
            | Error::DepthSize { .. }
            | Error::OutputShape { .. } => classes::ImageError::new_err(message),
            Error::Ground { .. }
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
            | Error::PointsBuffer { .. }
            | Error::PointsLength { .. }
            | Error::TooManyPoints { .. }
            | Error::PointTable { .. }
            | Error::PointColumns { .. }
            | Error::PointValues { .. }
            | Error::Slices { .. }
            | Error::Shape { .. }
            | Error::DensityFull { .. }
            | Error::Threads { .. }
            | Error::Interpolation { .. }
            | Error::TooManyIds { .. }
            | Error::AreaSize { .. }
            | Error::Isa { .. } => classes::ArgumentError::new_err(message),
            Error::OutOfMemory { .. } => classes::OutOfMemoryError::new_err(message),
        }
    }
}
