//! The error of every call: what is wrong, by concern.
//!
//! Each concern's enum lives beside what raises it, in an `error.rs` of its own that uses nothing but `digits.rs`. A
//! message says what was expected and what came; how to mend it in the words of a language is its binding's to say, see
//! `python/mend.rs`.
//!
//! ```
//! use ipm_rs::error::{Error, GridError};
//! use ipm_rs::{BevGrid, SampleAt};
//!
//! let error = BevGrid::new((7.0, 50.0), (-10.0, 10.0), (0.3, 0.1), SampleAt::Center).unwrap_err();
//! assert!(error.to_string().contains("whole")); // 43 m are no whole number of cells of 0.3 m
//! assert!(matches!(Error::from(error), Error::Grid(GridError::PartialCell { .. })));
//! ```

pub use crate::camera::error::CameraError;
pub use crate::camera::lens::error::LensError;
pub use crate::cloud::error::CloudError;
pub use crate::geometry::error::{PointsError, PoseError};
pub use crate::grid::GridError;
pub use crate::ground::error::GroundError;
pub use crate::isa::IsaError;
pub use crate::lut::error::LutError;
pub use crate::mosaic::error::MosaicError;
pub use crate::parallel::error::ThreadsError;
pub use crate::raster::error::RasterError;
pub use crate::rig::error::RigError;
pub use crate::table::error::TableError;
pub use crate::view::error::ViewError;
pub use crate::warp::error::WarpError;

/// Everything that a caller can get wrong, and what may fail without anybody's fault.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A number that must be finite is NaN or infinite.
    #[error("{what}: expected finite numbers, got {got}")]
    NotFinite {
        /// The parameter's name.
        what: &'static str,
        /// The offending number.
        got: f64,
    },
    /// An angle of more than a turn.
    #[error("{what}: expected radians, at most a turn (2 pi, 6.28) either way, got {got}")]
    Angle {
        /// The parameter's name.
        what: &'static str,
        /// The angle that came.
        got: f64,
    },
    /// A transform that is not rigid.
    #[error("pose: {0}")]
    Pose(#[from] PoseError),
    /// Points or lines that do not determine what was asked for.
    #[error(transparent)]
    Points(#[from] PointsError),
    /// A camera, or a question to one, that makes no sense.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// A lens that no lens can be.
    #[error(transparent)]
    Lens(#[from] LensError),
    /// A road that no road can be.
    #[error(transparent)]
    Ground(#[from] GroundError),
    /// A grid without whole cells.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// An image, an output or a table of numbers that is none, or that does not fit its partner.
    #[error(transparent)]
    View(#[from] ViewError),
    /// A table that cannot be.
    #[error(transparent)]
    Table(#[from] TableError),
    /// Something of which no table can be made.
    #[error(transparent)]
    Lut(#[from] LutError),
    /// A warp that cannot be done.
    #[error(transparent)]
    Warp(#[from] WarpError),
    /// Cameras, masks, images or gains that make no rig.
    #[error(transparent)]
    Rig(#[from] RigError),
    /// Layers or a window that do not fit a tile of a mosaic.
    #[error(transparent)]
    Mosaic(#[from] MosaicError),
    /// Depth or points that cannot be converted.
    #[error(transparent)]
    Cloud(#[from] CloudError),
    /// Points or shapes that cannot be rasterised.
    #[error(transparent)]
    Raster(#[from] RasterError),
    /// A number of threads that cannot be.
    #[error(transparent)]
    Threads(#[from] ThreadsError),
    /// An instruction set that is unknown or that this CPU or build lacks.
    #[error(transparent)]
    Isa(#[from] IsaError),
    /// Not enough memory.
    #[error("{what}: {bytes} bytes could not be allocated; use a coarser resolution or a smaller output")]
    OutOfMemory {
        /// What they were for.
        what: &'static str,
        /// How many.
        bytes: usize,
    },
    /// The caller was told to stop: see [`interruptible`](crate::interruptible).
    #[error("interrupted; what was being written is written in part")]
    Interrupted,
}

/// `Result` with this crate's [`Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// `angle` if it can be one in radians: a finite number of at most a turn.
pub(crate) fn radians(what: &'static str, angle: f64) -> Result<f64> {
    let turn = std::f64::consts::TAU * (1.0 + 1e-9); // 6.283185307 of a file is a turn
    if finite(what, angle)?.abs() <= turn { Ok(angle) } else { Err(Error::Angle { what, got: angle }) }
}

/// `value` if it is finite.
pub(crate) fn finite(what: &'static str, value: f64) -> Result<f64> {
    if value.is_finite() { Ok(value) } else { Err(Error::NotFinite { what, got: value }) }
}
