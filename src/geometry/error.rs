//! What is wrong with poses and points.

/// A transform that is not rigid.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PoseError {
    /// An entry that is NaN or infinite.
    #[error("expected finite numbers, got {got}")]
    NotFinite {
        /// The entry.
        got: f64,
    },
    /// A rotation that is not one. What is known of why is in its three last fields.
    #[error(
        "expected a rotation (|R^T R - I| <= 1e-4 and det R > 0), got |R^T R - I| = {deviation:.1e} and det R = {det:.4}"
    )]
    NotRigid {
        /// Largest entry of |R^T R - I|.
        deviation: f64,
        /// Determinant of R.
        det: f64,
        /// The factor by which R is a rotation, if there is one besides 1.
        scale: Option<f64>,
        /// Whether it is a rotation between frames of which one is left-handed.
        is_mirrored: bool,
        /// Whether it is near enough to a rotation to be one that was written with few digits.
        is_coarse: bool,
    },
    /// A translation that no place on a road has.
    #[error("expected a translation of at most 1e12 metres, got {got:.3e}; give coordinates from a nearer origin")]
    TooFar {
        /// The coordinate.
        got: f64,
    },
    /// A 4x4 matrix whose last row is not (0, 0, 0, 1).
    #[error("expected a rigid 4x4 transform with last row [0, 0, 0, 1], got last row {got:?}")]
    LastRow {
        /// The last row that came.
        got: [f64; 4],
        /// Whether it is a transform of row vectors, the transpose of one.
        is_transposed: bool,
    },
}

/// Points or lines that do not determine what was asked for.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PointsError {
    /// Too few of them, or ones in a place or on a line.
    #[error("{what}: expected {expected}, got {got}")]
    Unfit {
        /// The parameter's name.
        what: &'static str,
        /// Which condition fails.
        expected: &'static str,
        /// What came.
        got: String,
    },
}
