//! What is wrong with depth images and points.

/// Depth or points that cannot be converted.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CloudError {
    /// An image with another number of channels than its coding of depth has.
    #[error("image: expected {expected} channels for this coding of depth, got {got}")]
    DepthChannels {
        /// Channels expected.
        expected: usize,
        /// Channels that came.
        got: usize,
    },
    /// Depth that no code can say.
    #[error("depth: expected numbers from 0, got {got} at row {row}, column {column}; replace what has no depth first")]
    NegativeDepth {
        /// The number that came.
        got: f64,
        /// Its row.
        row: usize,
        /// Its column.
        column: usize,
    },
    /// A limit or a scale of depth that means nothing.
    #[error("{what}: expected {expected}, got {got}")]
    DepthLimit {
        /// The parameter's name.
        what: &'static str,
        /// What it may be.
        expected: &'static str,
        /// What came.
        got: f64,
    },
    /// A depth image of another size than the camera's.
    #[error("depth is {}x{} but the camera's image is {}x{}", got.0, got.1, expected.0, expected.1)]
    DepthSize {
        /// (width, height) of the camera's image.
        expected: (usize, usize),
        /// (width, height) that came.
        got: (usize, usize),
    },
    /// A mask of another size than its depth image.
    #[error(
        "mask is {}x{} but depth is {}x{}", got.0, got.1, expected.0, expected.1
    )]
    MaskSize {
        /// (width, height) of the depth image.
        expected: (usize, usize),
        /// (width, height) that came.
        got: (usize, usize),
    },
    /// An output for another number of points.
    #[error("{what}: expected {expected} entries, got {got}")]
    PointsLength {
        /// The output's name.
        what: &'static str,
        /// Entries expected.
        expected: usize,
        /// Entries that came.
        got: usize,
    },
    /// More points, or more pixels of an image of them, than one call may make.
    #[error("{what}: expected at most {limit} points, got {got}")]
    TooManyPoints {
        /// What asked for them.
        what: &'static str,
        /// How many.
        got: usize,
        /// The limit.
        limit: usize,
    },
    /// A matrix that projects onto a line or a point.
    #[error("K: expected an invertible 3x3 matrix of finite numbers, got {got:?}")]
    Singular {
        /// The matrix, row by row.
        got: [[f64; 3]; 3],
    },
    /// Points without the coordinates that are needed.
    #[error("points: expected at least {expected} columns (x, y, z), got {got}")]
    PointColumns {
        /// Columns that are needed.
        expected: usize,
        /// Columns that came.
        got: usize,
    },
}
