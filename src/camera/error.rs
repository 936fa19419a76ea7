//! What is wrong with a camera.

use crate::digits::readable;

/// A camera, or a question to one, that makes no sense.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CameraError {
    /// An intrinsic matrix that is no pinhole matrix.
    #[error(
        "K: expected [[fx, skew, cx], [0, fy, cy], [0, 0, 1]] with finite entries and fx, fy > 0, got {got:?} ({problem})"
    )]
    Intrinsics {
        /// The matrix, row by row.
        got: [[f64; 3]; 3],
        /// Which of the conditions fails.
        problem: &'static str,
    },
    /// Focal lengths of a placeholder matrix, or of one that is not in pixels.
    #[error(
        "K: expected focal lengths in pixels, got fx {}, fy {} for an image of {width} x {height}; a matrix like the identity is a placeholder of a camera that is not calibrated; one in units of the image's size wants its first row times the width and its second times the height", readable(*fx), readable(*fy)
    )]
    FocalLength {
        /// Pixels that a radian takes on the axis, along the rows.
        fx: f64,
        /// The same along the columns.
        fy: f64,
        /// Columns of the image.
        width: u32,
        /// Rows of the image.
        height: u32,
    },
    /// A crop that reaches outside its image.
    #[error(
        "cropped: expected a rectangle of at least 1 x 1 inside the {width} x {height} image, got x {x}, y {y}, {crop_width} x {crop_height}"
    )]
    Crop {
        /// Left column of the crop.
        x: u64,
        /// Top row of the crop.
        y: u64,
        /// Columns of the crop.
        crop_width: u64,
        /// Rows of the crop.
        crop_height: u64,
        /// Columns of the image.
        width: u32,
        /// Rows of the image.
        height: u32,
    },
    /// Blocks of pixels that an image has none of.
    #[error("binned: expected blocks of at least 1 x 1 pixel that fit the {width} x {height} image, got {x} x {y}")]
    Binning {
        /// Columns of a block.
        x: u64,
        /// Rows of a block.
        y: u64,
        /// Columns of the image.
        width: u32,
        /// Rows of the image.
        height: u32,
    },
    /// A margin or a tolerance that no curve can be drawn with.
    #[error(
        "margin, tolerance: expected a margin of at least 0 and a tolerance of at least 0.001 pixel, both up to 1e9, got {margin:?} and {tolerance:?}"
    )]
    Tracing {
        /// Pixels around the image.
        margin: f64,
        /// Pixels from the curve.
        tolerance: f64,
    },
    /// A curve whose image winds without end.
    #[error(
        "polyline: expected a curve whose image is points follow to {tolerance} pixels, got one that winds on and on; check the lens and the heights of the road, or give a larger tolerance"
    )]
    Winding {
        /// Pixels from the curve.
        tolerance: f64,
    },
    /// A line that a lens bends.
    #[error("horizon_line: expected a pinhole camera, got one behind {lens}, which bends the horizon")]
    Horizon {
        /// The lens model's name.
        lens: &'static str,
    },
}
