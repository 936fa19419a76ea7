//! What is wrong with a road.

/// A road that no road can be.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GroundError {
    /// A road height that is NaN, infinite, or farther away than any road.
    #[error("ground: expected a finite height in metres, at most 100 000 above or below the vehicle, got {got}")]
    Height {
        /// The height that came.
        got: f64,
    },
    /// A plane that is upright, and so has no height.
    #[error("Plane: expected {expected} got {got:?}; a road has one height at each (x, y)")]
    Plane {
        /// Which condition fails.
        expected: &'static str,
        /// The normal, or (slope, bank, height).
        got: [f64; 3],
    },
    /// Heights that make no map.
    #[error("HeightMap: expected {expected}, got {got}")]
    HeightMap {
        /// Which condition fails.
        expected: &'static str,
        /// What came.
        got: String,
    },
    /// Heights that stand for "no data" in elevation files.
    #[error(
        "heights: expected finite metres, and NaN where the road is not known, got {got:?} at [{row}, {column}] ({count} in all), which stands for \"no data\" or is no height"
    )]
    NoData {
        /// The first such number.
        got: f64,
        /// Where it is.
        row: usize,
        /// Where it is.
        column: usize,
        /// How many there are.
        count: usize,
    },
}
