//! The table's coordinates, row by row, and how they grow from cell to cell.

use super::Q;
use crate::lut::table::{RunKind, Table, unframed};

/// The coordinate of a cell without an image.
const OUTSIDE: i32 = i32::MIN;

/// The coordinates of a row in 1/1024 pixel, [`OUTSIDE`] where there is none.
#[derive(Debug, Clone)]
pub(crate) struct Coordinates {
    pub(crate) xs: Vec<i32>,
    pub(crate) ys: Vec<i32>,
    /// 1 for cells of the mask; those of the halo have coordinates too.
    pub(crate) valid: Vec<u8>,
}

impl Coordinates {
    pub(crate) fn new(columns: usize) -> Self {
        Self { xs: vec![OUTSIDE; columns], ys: vec![OUTSIDE; columns], valid: vec![0; columns] }
    }

    /// The rows before, at and after `row`, of which the last is still to be read.
    pub(crate) fn three(table: &Table, row: usize) -> [Self; 3] {
        let mut near = [(), (), ()].map(|()| Self::new(table.columns()));
        near[0].read(table, row.checked_sub(1));
        near[1].read(table, Some(row));
        near
    }

    /// Whether a cell is in the mask.
    pub(crate) fn is_valid(&self, cell: usize) -> bool {
        self.valid[cell] != 0
    }

    /// Where a cell samples, 1/1024 pixel.
    pub(crate) fn at(&self, cell: usize) -> [i32; 2] {
        [self.xs[cell], self.ys[cell]]
    }

    /// The sides of the parallelogram that a cell of the middle row covers on the source, in 1/1024 pixel: (x, y) of the
    /// one along the row, then of the one down the columns.
    pub(crate) fn sides([above, here, below]: &[Self; 3], cell: usize) -> [i32; 4] {
        let row = |values: &[i32]| {
            let at = |cell: Option<usize>| cell.and_then(|cell| values.get(cell)).copied().unwrap_or(OUTSIDE);
            slope(at(cell.checked_sub(1)), values[cell], at(Some(cell + 1)))
        };
        let down = |pick: fn(&Self) -> &[i32]| slope(pick(above)[cell], pick(here)[cell], pick(below)[cell]);
        [row(&here.xs), row(&here.ys), down(|row| &row.xs), down(|row| &row.ys)]
    }

    /// Reads row `row` of a table; all outside where there is no such row.
    pub(crate) fn read(&mut self, table: &Table, row: Option<usize>) {
        self.xs.fill(OUTSIDE);
        self.ys.fill(OUTSIDE);
        self.valid.fill(0);
        let Some(row) = row.filter(|&row| row < table.rows()) else { return };
        let (width, _) = table.source();
        let inverse_width = 1.0 / f64::from(width);
        for segment in table.row(row) {
            let cells = segment.first..segment.first + segment.cells;
            let (xs, ys) = (&mut self.xs[cells.clone()], &mut self.ys[cells.clone()]);
            match segment.kind {
                RunKind::Outside => continue,
                RunKind::Inside => {
                    for ((x, y), tap) in xs.iter_mut().zip(ys).zip(segment.taps) {
                        // exact: see `Strided` of the kernels
                        let row = ((f64::from(tap.offset) + 0.5) * inverse_width) as u32;
                        *x = fixed((tap.offset - row * width) as i32, tap.fx());
                        *y = fixed(row as i32, tap.fy());
                    }
                }
                RunKind::Rim | RunKind::Halo => {
                    for ((x, y), tap) in xs.iter_mut().zip(ys).zip(segment.taps) {
                        let (column, row) = unframed(tap.offset, width);
                        *x = fixed(column as i32, tap.fx());
                        *y = fixed(row as i32, tap.fy());
                    }
                }
            }
            if segment.kind != RunKind::Halo {
                self.valid[cells].fill(1);
            }
        }
    }
}

/// A whole pixel and a Q15 fraction.
#[inline(always)]
fn fixed(whole: i32, fraction: u32) -> i32 {
    (whole << Q) + (fraction >> (15 - Q)) as i32
}

/// How a coordinate grows from cell to cell at `here`: half the way from the one before to the one after, or from or to
/// the only one that sees the image; 0 where neither does.
#[inline(always)]
fn slope(before: i32, here: i32, after: i32) -> i32 {
    match (before != OUTSIDE, after != OUTSIDE) {
        (true, true) => (after - before) / 2,
        (true, false) => here - before,
        (false, true) => after - here,
        (false, false) => 0,
    }
}
