//! Sets of cells as ranges of columns, and where several of them meet.

use std::ops::Range;

use super::WHAT;
use crate::error::Result;
use crate::lut::Lut;
use crate::parallel::check_interrupt;
use crate::view::buffer;

/// Neighbouring cells of a row: the first column, and the one behind the last.
pub(super) type Columns = (u32, u32);

/// Some of the cells of a grid: for each row, ranges of columns from left to right that do not touch.
///
/// What a camera sees of a grid is a range or two a row, so whole regions are gone through in a fraction of the time of
/// their cells.
#[derive(Debug, Clone, Default)]
pub(super) struct Region {
    /// Where each row's ranges end.
    ends: Vec<usize>,
    ranges: Vec<Columns>,
}

impl Region {
    /// The cells that a table's mask has and, if it is given, `shown` too (row-major).
    pub(super) fn seen(lut: &Lut, shown: Option<&[bool]>) -> Result<Self> {
        let mut seen = Self { ends: buffer::reserved(WHAT, lut.rows())?, ranges: Vec::new() };
        for row in 0..lut.rows() {
            check_interrupt()?;
            for span in lut.table().row(row).filter(|span| span.kind.is_valid()) {
                let cells = span.first..span.first + span.cells;
                let Some(shown) = shown else {
                    seen.push(cells)?;
                    continue;
                };
                let mut first = cells.start;
                let shown = &shown[row * lut.columns()..][cells];
                for same in shown.chunk_by(|one, next| one == next) {
                    if same[0] {
                        seen.push(first..first + same.len())?;
                    }
                    first += same.len();
                }
            }
            seen.end_row()?;
        }
        Ok(seen)
    }

    /// Rows of its grid.
    pub(super) fn rows(&self) -> usize {
        self.ends.len()
    }

    pub(super) fn row(&self, row: usize) -> &[Columns] {
        &self.ranges[self.begin(row)..self.ends[row]]
    }

    /// Adds cells to the row that is being written; they lie behind all that it has.
    pub(super) fn push(&mut self, cells: Range<usize>) -> Result<()> {
        let (first, end) = (cells.start as u32, cells.end as u32);
        let begin = self.ends.last().copied().unwrap_or(0);
        match self.ranges[begin..].last_mut() {
            Some(last) if last.1 == first => last.1 = end,
            _ if first < end => buffer::push(WHAT, &mut self.ranges, (first, end))?,
            _ => {}
        }
        Ok(())
    }

    pub(super) fn end_row(&mut self) -> Result<()> {
        buffer::push(WHAT, &mut self.ends, self.ranges.len())
    }

    /// Adds the rows of another below its own.
    pub(super) fn append(&mut self, below: &Self) -> Result<()> {
        let before = self.ranges.len();
        buffer::room_for(WHAT, &mut self.ends, below.ends.len())?;
        buffer::room_for(WHAT, &mut self.ranges, below.ranges.len())?;
        self.ends.extend(below.ends.iter().map(|end| before + end));
        self.ranges.extend_from_slice(&below.ranges);
        Ok(())
    }

    fn begin(&self, row: usize) -> usize {
        if row == 0 { 0 } else { self.ends[row - 1] }
    }
}

/// Goes through a row of several regions; what it needs for that is kept from row to row.
#[derive(Default)]
pub(super) struct Sweep {
    /// Where a region begins or ends, and its number.
    edges: Vec<(u32, u8)>,
}

impl Sweep {
    /// Calls `visit` with neighbouring cells and the numbers of the regions that hold them, as bits, from left to right
    /// without a gap. There are at most 64 regions.
    pub(super) fn row<'a>(
        &mut self,
        columns: usize,
        regions: impl Iterator<Item = &'a [Columns]>,
        mut visit: impl FnMut(Range<usize>, u64) -> Result<()>,
    ) -> Result<()> {
        self.edges.clear();
        for (number, ranges) in regions.enumerate() {
            buffer::room_for(WHAT, &mut self.edges, 2 * ranges.len())?;
            self.edges.extend(ranges.iter().flat_map(|&(first, end)| [(first, number as u8), (end, number as u8)]));
        }
        self.edges.sort_unstable();
        let (mut first, mut inside) = (0, 0);
        for &(at, number) in &self.edges {
            if at as usize > first {
                visit(first..at as usize, inside)?;
                first = at as usize;
            }
            inside ^= 1 << number;
        }
        if first < columns { visit(first..columns, inside) } else { Ok(()) }
    }
}

/// The numbers of the bits that are set, from the lowest on.
pub(super) fn numbers(mut bits: u64) -> impl Iterator<Item = u8> {
    std::iter::from_fn(move || {
        let lowest = bits.trailing_zeros();
        bits &= bits.wrapping_sub(1);
        (lowest < u64::BITS).then_some(lowest as u8)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn region(rows: &[&[Range<usize>]]) -> Region {
        let mut region = Region::default();
        for ranges in rows {
            ranges.iter().for_each(|range| region.push(range.clone()).unwrap());
            region.end_row().unwrap();
        }
        region
    }

    #[test]
    fn ranges_that_touch_are_one_and_rows_keep_apart() {
        let mut two = region(&[&[0..3, 3..5, 7..7, 8..9], &[]]);
        assert_eq!((two.row(0), two.row(1)), (&[(0, 5), (8, 9)][..], &[][..]));
        two.append(&region(&[&[9..10, 10..11]])).unwrap();
        assert_eq!((two.row(1), two.row(2)), (&[][..], &[(9, 11)][..]));
    }

    #[test]
    fn a_sweep_says_of_every_cell_who_holds_it() {
        let regions = [region(&[&[2..6, 8..10]]), region(&[&[0..4, 6..10]]), region(&[&[4..5, 5..6]])];
        let mut cells = [u64::MAX; 12];
        let visit = |at: Range<usize>, inside| {
            assert!(cells[at.clone()].iter().all(|&cell| cell == u64::MAX));
            cells[at].fill(inside);
            Ok(())
        };
        Sweep::default().row(12, regions.iter().map(|region| region.row(0)), visit).unwrap();
        assert_eq!(cells, [2, 2, 3, 3, 5, 5, 2, 2, 3, 3, 0, 0]);
        assert!(numbers(0b1001_0010).eq([1, 4, 7]) && numbers(1 << 63).eq([63]) && numbers(0).next().is_none());
    }
}
