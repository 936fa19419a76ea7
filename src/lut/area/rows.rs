//! The table's coordinates, row by row, and how they grow from cell to cell.

use std::ops::Range;

use super::Q;
use crate::cpu::Isa;
use crate::lut::kernels::for_each_isa;
use crate::lut::table::{RunKind, Table, Tap, unframed};

/// The coordinate of a cell without an image.
const OUTSIDE: i32 = i32::MIN;

/// The coordinates of a row in 1/1024 pixel, [`OUTSIDE`] where there is none.
#[derive(Debug, Clone)]
pub(crate) struct Coordinates {
    /// Entry i + 1 is of cell i; before the first and behind the last cell there is nothing.
    xs: Vec<i32>,
    ys: Vec<i32>,
    /// 1 for cells of the mask; those of the halo have coordinates too.
    valid: Vec<u8>,
}

impl Coordinates {
    /// The rows before, at and after `row`, of which the last is still to be read.
    pub(crate) fn three(isa: Isa, table: &Table, row: usize) -> [Self; 3] {
        let columns = table.columns();
        let none = || Self { xs: vec![OUTSIDE; columns + 2], ys: vec![OUTSIDE; columns + 2], valid: vec![0; columns] };
        let mut near = [(), (), ()].map(|()| none());
        near[0].read(isa, table, row.checked_sub(1));
        near[1].read(isa, table, Some(row));
        near
    }

    /// Whether a cell is in the mask.
    pub(crate) fn is_valid(&self, cell: usize) -> bool {
        self.valid[cell] != 0
    }

    /// For each cell whether it is in the mask.
    pub(crate) fn valid(&self) -> &[u8] {
        &self.valid
    }

    /// Where neighbouring cells sample: columns and rows, 1/1024 pixel.
    pub(crate) fn at(&self, cells: Range<usize>) -> [&[i32]; 2] {
        [&self.xs, &self.ys].map(|axis| &axis[1 + cells.start..1 + cells.end])
    }

    /// Reads row `row` of a table; all outside where there is no such row.
    pub(crate) fn read(&mut self, isa: Isa, table: &Table, row: Option<usize>) {
        self.valid.fill(0);
        let Some(row) = row.filter(|&row| row < table.rows()) else {
            self.xs.fill(OUTSIDE);
            self.ys.fill(OUTSIDE);
            return;
        };
        let (width, _) = table.source();
        for segment in table.row(row) {
            let cells = segment.first..segment.first + segment.cells;
            let own = cells.start + 1..cells.end + 1;
            let (xs, ys) = (&mut self.xs[own.clone()], &mut self.ys[own]);
            match segment.kind {
                RunKind::Outside => {
                    xs.fill(OUTSIDE);
                    ys.fill(OUTSIDE);
                }
                RunKind::Inside => unpack(isa, segment.taps, width, xs, ys),
                RunKind::Rim | RunKind::Halo => {
                    for ((x, y), tap) in xs.iter_mut().zip(ys).zip(segment.taps) {
                        let (column, row) = unframed(tap.offset, width);
                        *x = fixed(column as i32, tap.fx());
                        *y = fixed(row as i32, tap.fy());
                    }
                }
            }
            if matches!(segment.kind, RunKind::Inside | RunKind::Rim) {
                self.valid[cells].fill(1);
            }
        }
    }
}

/// The sides of the parallelograms that the cells of a row cover on the source, in 1/1024 pixel: (x, y) of the one along
/// the row, then of the one down the columns. Half the way from the cell before to the one after, or from or to the only
/// one that sees the image; 0 where neither does. Of cells without an image they are anything at all.
#[derive(Debug, Clone)]
pub(crate) struct Sides([Vec<i32>; 4]);

impl Sides {
    pub(crate) fn new(columns: usize) -> Self {
        Self([(), (), (), ()].map(|()| vec![0; columns]))
    }

    /// Works them out for the middle one of three rows.
    pub(crate) fn read(&mut self, isa: Isa, [above, here, below]: &[Coordinates; 3]) {
        let Self([ax, ay, bx, by]) = self;
        let cells = ax.len();
        for (side, axis) in [(ax, &here.xs), (ay, &here.ys)] {
            slopes(isa, &axis[..cells], &axis[1..=cells], &axis[2..], side);
        }
        for (side, [above, here, below]) in
            [(bx, [&above.xs, &here.xs, &below.xs]), (by, [&above.ys, &here.ys, &below.ys])]
        {
            slopes(isa, &above[1..=cells], &here[1..=cells], &below[1..=cells], side);
        }
    }

    /// Those of one cell.
    pub(crate) fn of(&self, cell: usize) -> [i32; 4] {
        [0, 1, 2, 3].map(|side| self.0[side][cell])
    }

    /// Those of neighbouring cells, to be changed.
    pub(super) fn cells_mut(&mut self, cells: Range<usize>) -> [&mut [i32]; 4] {
        self.0.each_mut().map(|side| &mut side[cells.clone()])
    }

    /// Those of neighbouring cells.
    pub(crate) fn cells(&self, cells: Range<usize>) -> [&[i32]; 4] {
        [0, 1, 2, 3].map(|side| &self.0[side][cells.clone()])
    }
}

/// The middles of the footprints of neighbouring cells of the middle one of three rows, columns and rows in 1/1024 pixel:
/// where footprints are bent they are not where the cell samples, but by 1/24 of the second differences beside it.
pub(super) fn centroids(isa: Isa, [above, here, below]: &[Coordinates; 3], cells: Range<usize>, into: [&mut [i32]; 2]) {
    #[inline(always)]
    fn body(near: [&[i32]; 5], into: &mut [i32]) {
        let count = into.len();
        let [before, here, after, above, below] = near.map(|axis| &axis[..count]);
        let bent = |before: i32, here: i32, after: i32| {
            let (has_before, has_after) = (before != OUTSIDE, after != OUTSIDE);
            let bent = after.wrapping_sub(here).wrapping_sub(here.wrapping_sub(before));
            if has_before & has_after { bent / 24 } else { 0 }
        };
        for i in 0..count {
            let (across, down) = (bent(before[i], here[i], after[i]), bent(above[i], here[i], below[i]));
            into[i] = here[i].wrapping_add(across + down);
        }
    }
    let (before, own, after) = (cells.clone(), cells.start + 1..cells.end + 1, cells.start + 2..cells.end + 2);
    let axes = [[&above.xs, &here.xs, &below.xs], [&above.ys, &here.ys, &below.ys]];
    for ([above, here, below], into) in axes.into_iter().zip(into) {
        let near =
            [&here[before.clone()], &here[own.clone()], &here[after.clone()], &above[own.clone()], &below[own.clone()]];
        for_each_isa!(isa, (body, body, body)(near: [&[i32]; 5], into: &mut [i32]));
    }
}

/// A whole pixel and a Q15 fraction.
#[inline(always)]
fn fixed(whole: i32, fraction: u32) -> i32 {
    (whole << Q) + (fraction >> (15 - Q)) as i32
}

/// The coordinates of taps that count as [`RunKind::Inside`] says.
fn unpack(isa: Isa, taps: &[Tap], width: u32, xs: &mut [i32], ys: &mut [i32]) {
    #[inline(always)]
    fn body(taps: &[Tap], width: u32, xs: &mut [i32], ys: &mut [i32]) {
        /// Added to a float64, it leaves the nearest whole number in the low bits, also of one that is just below 0.
        const WHOLE: f64 = 1.5 * (1u64 << 52) as f64;
        let cells = taps.len();
        let (xs, ys) = (&mut xs[..cells], &mut ys[..cells]);
        let inverse_width = 1.0 / f64::from(width);
        for i in 0..cells {
            let tap = taps[i];
            // The row is the whole part of (offset + 0.5) / width, which is 0.5 / width or more from a whole number, so
            // rounding half of one less gives it.
            let row = ((f64::from(tap.offset) + 0.5) * inverse_width - 0.5 + WHOLE).to_bits() as u32;
            xs[i] = fixed((tap.offset - row * width) as i32, tap.fx());
            ys[i] = fixed(row as i32, tap.fy());
        }
    }
    for_each_isa!(isa, (body, body, body)(taps: &[Tap], width: u32, xs: &mut [i32], ys: &mut [i32]));
}

fn slopes(isa: Isa, before: &[i32], here: &[i32], after: &[i32], slopes: &mut [i32]) {
    #[inline(always)]
    fn body(before: &[i32], here: &[i32], after: &[i32], slopes: &mut [i32]) {
        let cells = slopes.len();
        let (before, here, after) = (&before[..cells], &here[..cells], &after[..cells]);
        for i in 0..cells {
            let (has_before, has_after) = (before[i] != OUTSIDE, after[i] != OUTSIDE);
            let from = if has_before { before[i] } else { here[i] };
            let to = if has_after { after[i] } else { here[i] };
            let way = to.wrapping_sub(from);
            slopes[i] = if has_before & has_after { way >> 1 } else { way };
        }
    }
    for_each_isa!(isa, (body, body, body)(before: &[i32], here: &[i32], after: &[i32], slopes: &mut [i32]));
}
