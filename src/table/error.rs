//! What is wrong with a table.

use crate::digits::count;

/// A table that cannot be.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TableError {
    /// Bytes that are not a table this version wrote.
    #[error("Lut: expected the bytes of a table, got damaged or foreign data ({problem}); build it again")]
    Damaged {
        /// What was found first.
        problem: &'static str,
    },
    /// A table that could not be read to its end.
    #[error("Lut: expected to read a table, got: {problem}; check where it is read from")]
    Unreadable {
        /// What the reader said.
        problem: String,
    },
    /// A table whose cells keep what an output holds, which a table cannot know.
    #[error("border_mode: expected one that says what lies beyond the image, got \"transparent\", which a warp takes")]
    Transparent,
    /// More cells than a table may hold.
    #[error(
        "{} x {} cells are more than the {limit} that one table or one picture without a table may hold; use a coarser resolution or a smaller output", count(*rows), count(*columns)
    )]
    TooManyCells {
        /// Rows, as a float because it may not fit an integer.
        rows: f64,
        /// Columns, likewise.
        columns: f64,
        /// The limit.
        limit: usize,
    },
}
