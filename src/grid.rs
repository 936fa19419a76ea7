//! The metric grid on the road.

use crate::digits::{count, readable};
use crate::view::{MAX_CELLS, are_too_many};

/// How far from a whole number of cells a range may be, in cells.
const WHOLE_CELLS: f64 = 1e-6;

/// Which point of a cell is looked up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum SampleAt {
    /// The middle of the cell (KITTI's road benchmark, rasters). The default.
    #[default]
    Center,
    /// The far left corner: `X = x_max - i dx`, `Y = y_max - j dy`, as in the widely copied IPM tutorials.
    Corner,
}

impl SampleAt {
    /// Distance of the sample from the cell's far left corner, in cells.
    #[inline]
    fn offset(self) -> f64 {
        match self {
            Self::Center => 0.5,
            Self::Corner => 0.0,
        }
    }
}

/// A rectangle of equal cells on the road, in the vehicle frame: row 0 is the farthest (x_max), column 0 the leftmost
/// (y_max).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BevGrid {
    x: (f64, f64),
    y: (f64, f64),
    resolution: (f64, f64),
    sample_at: SampleAt,
    rows: usize,
    columns: usize,
}

impl BevGrid {
    /// A grid from its ranges (min, max) and cell sizes (along x, along y), metres.
    ///
    /// # Errors
    /// [`GridError::Range`](GridError::Range), [`GridError::CellSize`](GridError::CellSize), [`GridError::PartialCell`](GridError::PartialCell) and [`GridError::TooManyCells`](GridError::TooManyCells).
    pub fn new(x: (f64, f64), y: (f64, f64), resolution: (f64, f64), sample_at: SampleAt) -> Result<Self, GridError> {
        let rows = cells("x", x, resolution.0)?;
        let columns = cells("y", y, resolution.1)?;
        if are_too_many(rows, columns) {
            return Err(GridError::TooManyCells { rows, columns, limit: MAX_CELLS });
        }
        Ok(Self { x, y, resolution, sample_at, rows: rows as usize, columns: columns as usize })
    }

    /// Cells along x: 43 m of 0.05 m are 860.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Cells along y.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// (min, max) along x.
    pub fn x(&self) -> (f64, f64) {
        self.x
    }

    /// (min, max) along y.
    pub fn y(&self) -> (f64, f64) {
        self.y
    }

    /// Cell size (along x, along y).
    pub fn resolution(&self) -> (f64, f64) {
        self.resolution
    }

    /// Which point of a cell is looked up.
    pub fn sample_at(&self) -> SampleAt {
        self.sample_at
    }

    /// x of a row's samples; rows may be fractional or outside the grid.
    #[inline]
    pub fn x_of_row(&self, row: f64) -> f64 {
        self.x.1 - (row + self.sample_at.offset()) * self.resolution.0
    }

    /// y of a column's samples.
    #[inline]
    pub fn y_of_column(&self, column: f64) -> f64 {
        self.y.1 - (column + self.sample_at.offset()) * self.resolution.1
    }

    /// (row, column) of a road point, fractional: whole at the samples.
    pub fn cell_from_ground(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let offset = self.sample_at.offset();
        [(self.x.1 - x) / self.resolution.0 - offset, (self.y.1 - y) / self.resolution.1 - offset]
    }

    /// The road point of a (row, column): the inverse of [`BevGrid::cell_from_ground`].
    pub fn ground_from_cell(&self, [row, column]: [f64; 2]) -> [f64; 2] {
        [self.x_of_row(row), self.y_of_column(column)]
    }
}

/// A grid without whole cells.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GridError {
    /// A grid range that is reversed, empty or not finite.
    #[error("{axis}: expected a finite range (min, max) in metres with min < max, got ({min}, {max})")]
    Range {
        /// "x" or "y".
        axis: &'static str,
        /// Lower end.
        min: f64,
        /// Upper end.
        max: f64,
    },
    /// A cell size that is zero, negative or not finite.
    #[error("resolution: expected a positive cell size in metres along {axis}, got {got}")]
    CellSize {
        /// "x" or "y".
        axis: &'static str,
        /// The size that came.
        got: f64,
    },
    /// A range that is not a whole number of cells.
    #[error(
        "{axis}: ({min}, {max}) is {cells} cells of {cell} m, expected a whole number (to 1e-6); the nearest is ({min}, {}), {nearest} cells", readable(*nearest_max)
    )]
    PartialCell {
        /// "x" or "y".
        axis: &'static str,
        /// Lower end.
        min: f64,
        /// Upper end.
        max: f64,
        /// Cell size, metres.
        cell: f64,
        /// Cells in the range, not whole.
        cells: f64,
        /// Nearest whole number of cells, at least one.
        nearest: f64,
        /// Upper end of the range of that many cells.
        nearest_max: f64,
    },
    /// More cells than a table may hold.
    #[error(
        "BevGrid: {} x {} cells are more than the {limit} that one table may hold; use a coarser resolution or a smaller output", count(*rows), count(*columns)
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

/// Whole cells in a range.
fn cells(axis: &'static str, (min, max): (f64, f64), cell: f64) -> Result<f64, GridError> {
    let length = max - min;
    if !(min.is_finite() && max.is_finite() && length > 0.0 && length.is_finite()) {
        return Err(GridError::Range { axis, min, max });
    }
    if !(cell > 0.0 && cell.is_finite()) {
        return Err(GridError::CellSize { axis, got: cell });
    }
    let cells = length / cell;
    let nearest = cells.round().max(1.0);
    if (cells - nearest).abs() > WHOLE_CELLS && cells <= MAX_CELLS as f64 {
        let nearest_max = min + nearest * cell;
        return Err(GridError::PartialCell { axis, min, max, cell, cells, nearest, nearest_max });
    }
    Ok(nearest)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seed(sample_at: SampleAt) -> BevGrid {
        BevGrid::new((7.0, 50.0), (-10.0, 10.0), (0.05, 0.025), sample_at).unwrap()
    }

    #[test]
    fn the_seed_grid_is_860_by_800() {
        let grid = seed(SampleAt::Corner);
        assert_eq!((grid.rows(), grid.columns()), (860, 800));
        assert_eq!((grid.x_of_row(0.0), grid.y_of_column(0.0)), (50.0, 10.0));
        assert!((grid.x_of_row(859.0) - 7.05).abs() < 1e-12 && (grid.y_of_column(799.0) + 9.975).abs() < 1e-12);
        let grid = seed(SampleAt::Center);
        assert_eq!((grid.x_of_row(0.0), grid.y_of_column(0.0)), (49.975, 9.9875));
    }

    #[test]
    fn cells_and_metres_are_inverse_in_both_samplings() {
        for sample_at in [SampleAt::Center, SampleAt::Corner] {
            let grid = seed(sample_at);
            for cell in [[0.0, 0.0], [859.0, 799.0], [12.25, -3.5]] {
                let back = grid.cell_from_ground(grid.ground_from_cell(cell));
                assert!((back[0] - cell[0]).abs() < 1e-9 && (back[1] - cell[1]).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn refuses_what_is_no_grid() {
        let new = |x, dx| BevGrid::new(x, (-10.0, 10.0), (dx, 0.1), SampleAt::Center);
        assert!(matches!(new((50.0, 7.0), 0.05), Err(GridError::Range { axis: "x", .. })));
        assert!(matches!(new((7.0, 7.0), 0.05), Err(GridError::Range { .. })));
        assert!(matches!(new((f64::NAN, 7.0), 0.05), Err(GridError::Range { .. })));
        assert!(matches!(new((-f64::MAX, f64::MAX), 0.05), Err(GridError::Range { .. })));
        for cell in [0.0, -0.1, f64::NAN, f64::INFINITY] {
            assert!(matches!(new((7.0, 50.0), cell), Err(GridError::CellSize { .. })));
        }
        assert!(matches!(new((7.0, 50.0), 1e-9), Err(GridError::TooManyCells { .. })));
        assert!(matches!(new((7.0, 50.0), f64::MIN_POSITIVE), Err(GridError::TooManyCells { .. })));
        match new((7.0, 50.02), 0.05) {
            Err(GridError::PartialCell { nearest, nearest_max, .. }) => {
                assert_eq!(nearest, 860.0);
                assert!((nearest_max - 50.0).abs() < 1e-9);
            }
            other => panic!("{other:?}"),
        }
        assert!(matches!(new((7.0, 7.01), 0.05), Err(GridError::PartialCell { nearest: 1.0, .. })));
    }
}
