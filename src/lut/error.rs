//! What no table can be made of.

/// Something of which no table can be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LutError {
    /// Two maps, or a map and its shape, that do not fit.
    #[error("maps: expected {expected} entries in each, got {got}")]
    MapLength {
        /// Entries expected.
        expected: usize,
        /// Entries that came.
        got: usize,
    },
    /// A homography that maps everything to a line or to nothing.
    #[error("M: expected a finite, invertible 3x3 matrix from output pixel to source pixel, got {got:?} ({problem})")]
    Homography {
        /// The matrix, row by row.
        got: [[f64; 3]; 3],
        /// Which condition fails.
        problem: &'static str,
    },
    /// A source that area interpolation cannot address.
    #[error("area: expected a source of at most {limit} pixels a side, got {width} x {height}")]
    AreaSize {
        /// Columns of the source.
        width: u32,
        /// Rows of the source.
        height: u32,
        /// The limit.
        limit: u32,
    },
}
