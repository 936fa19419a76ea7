//! The table's coordinates, row by row, and how they grow from cell to cell.

use std::ops::Range;

use crate::error::{Error, LutError, Result};
use crate::isa::Isa;
use crate::isa::for_each_isa;
use crate::kernels::FRACTION_BITS;
use crate::kernels::{Row, unpack};
use crate::table::block::LANES;
use crate::table::{Edges, Span, SpanKind, Table, unframed};
use crate::view::buffer;

/// Sources may not be longer or higher: coordinates in 1/1024 pixel fit 31 bits.
const MAX_SIDE: u32 = 1 << 20;

/// Whether coordinates on a source of this size can be told in 1/1024 pixel.
pub(crate) fn check_sides((width, height): (u32, u32)) -> Result<()> {
    if width.max(height) < MAX_SIDE {
        return Ok(());
    }
    Err(Error::Lut(LutError::AreaSize { width, height, limit: MAX_SIDE - 1 }))
}

/// The coordinate of a cell without an image.
pub(crate) const OUTSIDE: i32 = i32::MIN;

/// The coordinates of a row in 1/1024 pixel, [`OUTSIDE`] where there is none.
#[derive(Debug)]
pub(crate) struct Coordinates {
    /// Entry [`LEAD`] + i is of cell i; before the first and behind the last cell there is nothing, and so
    /// many entries more that vectors of cells may begin at any cell.
    xs: Row<i32>,
    ys: Row<i32>,
    /// 1 for cells of the mask that have a footprint, which are all but those beside the seam of a panorama; those of the halo
    /// have coordinates too. It goes on as the others do.
    valid: Vec<u8>,
    /// From the first cell of the mask to behind the last one.
    seen: Range<usize>,
}

/// A vector of entries, so that the first cell begins where a cache line does and the vectors of area's column bounds lie in one.
const LEAD: usize = LANES;

impl Coordinates {
    /// The coordinates of a row of which no cell sees the image.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`](crate::Error::OutOfMemory).
    pub(crate) fn none(table: &Table) -> Result<Self> {
        let whole = table.columns().next_multiple_of(LANES) + LANES;
        let axis = || Row::filled(LEAD + whole + 1, OUTSIDE);
        Ok(Self { xs: axis()?, ys: axis()?, valid: buffer::zeroed("area", whole)?, seen: 0..0 })
    }

    /// The rows before, at and after `row`, of which the last is still to be read.
    pub(crate) fn three(isa: Isa, table: &Table, row: usize) -> Result<[Self; 3]> {
        let mut near = [Self::none(table)?, Self::none(table)?, Self::none(table)?];
        near[0].read(isa, table, row.checked_sub(1));
        near[1].read(isa, table, Some(row));
        Ok(near)
    }

    /// Whether a cell is in the mask.
    pub(crate) fn is_valid(&self, cell: usize) -> bool {
        self.valid[cell] != 0
    }

    /// For each cell whether it is in the mask.
    pub(crate) fn valid(&self) -> &[u8] {
        &self.valid
    }

    /// All cells of the mask are among these.
    pub(crate) fn seen(&self) -> Range<usize> {
        self.seen.clone()
    }

    /// Where a cell samples: column and row, 1/1024 pixel.
    pub(crate) fn at(&self, cell: usize) -> [i32; 2] {
        [self.xs[LEAD + cell], self.ys[LEAD + cell]]
    }

    /// Columns and rows of the cells, 1/1024 pixel: entry i + 1 is of cell i.
    pub(crate) fn axes(&self) -> [&[i32]; 2] {
        [&self.xs[LEAD - 1..], &self.ys[LEAD - 1..]]
    }

    /// Reads row `row` of a table; all outside where there is no such row.
    pub(crate) fn read(&mut self, isa: Isa, table: &Table, row: Option<usize>) {
        self.valid.fill(0);
        self.seen = 0..0;
        let Some(row) = row.filter(|&row| row < table.rows()) else {
            self.xs.fill(OUTSIDE);
            self.ys.fill(OUTSIDE);
            return;
        };
        let (width, edges) = (table.source().0, table.edges());
        for span in table.row(row) {
            if edges.has_footprint(span.kind) {
                let start = if self.seen.is_empty() { span.first } else { self.seen.start };
                self.seen = start..span.first + span.cells;
            }
            self.read_cells(isa, span, width, edges);
        }
    }

    /// Reads where the cells of these columns and their neighbours sample, not which are in the mask; all outside where
    /// there is no such row.
    pub(crate) fn read_columns(&mut self, isa: Isa, table: &Table, row: Option<usize>, columns: &Range<usize>) {
        let columns = columns.start.saturating_sub(1)..(columns.end + 1).min(table.columns());
        let Some(row) = row.filter(|&row| row < table.rows()) else {
            let own = LEAD + columns.start..LEAD + columns.end;
            self.xs[own.clone()].fill(OUTSIDE);
            self.ys[own].fill(OUTSIDE);
            return;
        };
        let (width, edges) = (table.source().0, table.edges());
        for span in table.row_part(row, &columns) {
            self.read_coordinates(isa, &span, width, edges);
        }
    }

    /// Reads some cells of a row, of a source of this width.
    pub(crate) fn read_cells(&mut self, isa: Isa, span: Span<'_>, width: u32, edges: Edges) {
        self.read_coordinates(isa, &span, width, edges);
        if edges.has_footprint(span.kind) {
            self.valid[span.first..span.first + span.cells].fill(1);
        }
    }

    fn read_coordinates(&mut self, isa: Isa, span: &Span<'_>, width: u32, edges: Edges) {
        let own = LEAD + span.first..LEAD + span.first + span.cells;
        let (xs, ys) = (&mut self.xs[own.clone()], &mut self.ys[own]);
        match span.kind {
            // what samples elsewhere says nothing of how far the footprint of the cell beside it reaches
            kind if !edges.is_in_place(kind) => {
                xs.fill(OUTSIDE);
                ys.fill(OUTSIDE);
            }
            SpanKind::Outside => {
                xs.fill(OUTSIDE);
                ys.fill(OUTSIDE);
            }
            SpanKind::Inside => unpack(isa, span.taps, width, xs, ys),
            SpanKind::Rim | SpanKind::Halo => {
                for ((x, y), tap) in xs.iter_mut().zip(ys).zip(span.taps) {
                    let (column, row) = unframed(tap.offset, width);
                    *x = fixed(column as i32, tap.fx());
                    *y = fixed(row as i32, tap.fy());
                }
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
    pub(crate) fn new(columns: usize) -> Result<Self> {
        let side = || buffer::zeroed("area", columns);
        Ok(Self([side()?, side()?, side()?, side()?]))
    }

    /// Works them out for the middle one of three rows.
    pub(crate) fn read(&mut self, isa: Isa, near: &[Coordinates; 3]) {
        let Self([ax, ay, bx, by]) = self;
        let [above, here, below] = near.each_ref().map(Coordinates::axes);
        for (axis, (along, down)) in [(ax, bx), (ay, by)].into_iter().enumerate() {
            let (above, here, below) = (above[axis], here[axis], below[axis]);
            slopes(isa, here, &here[1..], &here[2..], along);
            slopes(isa, &above[1..], &here[1..], &below[1..], down);
        }
    }

    /// The sides of one cell: x along, y along, x down and y down.
    pub(crate) fn of(&self, cell: usize) -> [i32; 4] {
        [0, 1, 2, 3].map(|side| self.0[side][cell])
    }
}

/// A whole pixel and a Q15 fraction.
#[inline(always)]
fn fixed(whole: i32, fraction: u32) -> i32 {
    (whole << FRACTION_BITS) + (fraction >> (15 - FRACTION_BITS)) as i32
}

fn slopes(isa: Isa, before: &[i32], here: &[i32], after: &[i32], slopes: &mut [i32]) {
    #[inline(always)]
    fn body(before: &[i32], here: &[i32], after: &[i32], slopes: &mut [i32]) {
        let cells = slopes.len();
        let (before, here, after) = (&before[..cells], &here[..cells], &after[..cells]);
        for i in 0..cells {
            slopes[i] = slope(before[i], here[i], after[i]);
        }
    }
    for_each_isa!(isa, (body, body, body)(before: &[i32], here: &[i32], after: &[i32], slopes: &mut [i32]));
}

/// How a coordinate grows from cell to cell, by those before and after, or by one of them where there is no other.
#[inline(always)]
pub(crate) fn slope(before: i32, here: i32, after: i32) -> i32 {
    let (has_before, has_after) = (before != OUTSIDE, after != OUTSIDE);
    let from = if has_before { before } else { here };
    let to = if has_after { after } else { here };
    let way = to.wrapping_sub(from);
    if has_before & has_after { way >> 1 } else { way }
}
