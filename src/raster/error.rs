//! What is wrong with what is rasterised.

use crate::digits::count;

/// Points or shapes that cannot be rasterised.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RasterError {
    /// Points without the coordinates that are needed.
    #[error("points: expected at least {expected} columns (x, y, z), got {got}")]
    PointColumns {
        /// Columns that are needed.
        expected: usize,
        /// Columns that came.
        got: usize,
    },
    /// Values of another number than the points.
    #[error("values: expected a row of at least one value for each of the {expected} points, got {} rows of {}", got.0, got.1)]
    PointValues {
        /// Points.
        expected: usize,
        /// (rows, columns) of the values.
        got: (usize, usize),
    },
    /// More points, or more pixels of an image of them, than one call may make.
    #[error("points: expected at most {limit}, got {got}")]
    TooManyPoints {
        /// How many.
        got: usize,
        /// The limit.
        limit: usize,
    },
    /// More cells than a table may hold.
    #[error(
        "rasterize: {} x {} cells in all slices are more than the {limit} that one call may fill; use a coarser resolution or a smaller output", count(*rows), count(*columns)
    )]
    TooManyCells {
        /// Rows, as a float because it may not fit an integer.
        rows: f64,
        /// Columns, likewise.
        columns: f64,
        /// The limit.
        limit: usize,
    },
    /// A box or a polygon that is none.
    #[error(
        "{what}: expected finite metres (boxes: x, y, length, width, yaw; polygons: at least 3 corners x, y), got {problem} at index {index}"
    )]
    Shape {
        /// The parameter's name.
        what: &'static str,
        /// Which of them.
        index: usize,
        /// What is wrong with it.
        problem: &'static str,
    },
    /// Height slices that are not ascending.
    #[error("slices: expected at least two finite heights in ascending order, the edges of the slices, got {got:?}")]
    Slices {
        /// The edges that came.
        got: Vec<f64>,
    },
    /// A density scale that ends before it begins.
    #[error("density_full: expected a finite number above 1, the count plus one at which the density is 1, got {got}")]
    DensityFull {
        /// The number that came.
        got: f64,
    },
}
