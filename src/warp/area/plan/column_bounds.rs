//! The least and the greatest coordinates of a row of blocks.

use std::ops::Range;

use crate::error::Result;
use crate::isa::Isa;
use crate::isa::for_each_isa;
use crate::kernels::Row;
use crate::lut::footprint::{Coordinates, OUTSIDE};
use crate::table::block::{LANES, Size, lanes};

/// The least and the greatest x and y that each column of a row of blocks samples. Column by column, so that vectors hold
/// sixteen columns whatever the blocks are: a third of the time of block by block, for 10 cm cells.
#[derive(Debug)]
pub(super) struct ColumnBounds {
    /// The least coordinate of each column, less 1.
    least: [Row<i32>; 2],
    greatest: [Row<i32>; 2],
}

/// Further than any coordinate.
const FAR: i32 = 1 << 30;

/// The least and the greatest coordinate of each quarter of a block's columns. Down to one of all columns, the compiler
/// would take the lanes of its vectors one by one.
#[derive(Debug, Default, Clone, Copy)]
pub(super) struct QuarterBounds {
    pub(super) least: [i32; 4],
    pub(super) greatest: [i32; 4],
}

impl ColumnBounds {
    /// For rows of so many columns.
    pub(super) fn new(columns: usize) -> Result<Self> {
        let axis = || Row::filled(columns.next_multiple_of(LANES) + LANES, 0);
        Ok(Self { least: [axis()?, axis()?], greatest: [axis()?, axis()?] })
    }

    /// Looks at the cells of the rows of a row of blocks, and at some beside them.
    pub(super) fn read(&mut self, isa: Isa, rows: &[Coordinates], cells: Range<usize>) {
        let cells = cells.start / LANES * LANES..cells.end.next_multiple_of(LANES) + LANES;
        for axis in 0..2 {
            let (least, greatest) = (&mut self.least[axis][cells.clone()], &mut self.greatest[axis][cells.clone()]);
            for (part, rows) in rows.as_chunks::<{ Size::FEWEST_ROWS }>().0.iter().enumerate() {
                let rows = rows.each_ref().map(|row| &row.axes()[axis][1 + cells.start..]);
                extend(isa, rows, part == 0, least, greatest);
            }
        }
    }

    /// The bounds of x and of y of neighbouring blocks that are `columns` wide, the first of which begins at the `first`-th
    /// cell. Where blocks are narrow, the bounds of the next ones are written too.
    pub(super) fn of_blocks(&self, isa: Isa, first: usize, columns: usize, bounds: [&mut [QuarterBounds]; 2]) {
        for (axis, bounds) in bounds.into_iter().enumerate() {
            let [least, greatest] = [&self.least[axis], &self.greatest[axis]].map(|row| &row[first..]);
            bound(isa, least, greatest, columns, bounds);
        }
    }
}

/// Takes in rows, which may be the first ones.
fn extend(isa: Isa, rows: [&[i32]; Size::FEWEST_ROWS], first: bool, least: &mut [i32], greatest: &mut [i32]) {
    #[inline(always)]
    fn body(rows: [&[i32]; Size::FEWEST_ROWS], first: bool, least: &mut [i32], greatest: &mut [i32]) {
        let cells = least.len();
        let ([a, b, c, d], greatest) = (rows.map(|row| &row[..cells]), &mut greatest[..cells]);
        for i in 0..cells {
            let (mut low, mut high) = if first { (FAR, -FAR) } else { (least[i], greatest[i]) };
            for number in [a[i], b[i], c[i], d[i]] {
                // the least number is that of cells outside, and one less is the greatest
                const { assert!(OUTSIDE == i32::MIN) };
                let less = number.wrapping_sub(1);
                low = if less < low { less } else { low };
                high = if number > high { number } else { high };
            }
            (least[i], greatest[i]) = (low, high);
        }
    }
    for_each_isa!(isa, (body, body, body)(
        rows: [&[i32]; Size::FEWEST_ROWS], first: bool, least: &mut [i32], greatest: &mut [i32]
    ));
}

fn bound(isa: Isa, least: &[i32], greatest: &[i32], columns: usize, bounds: &mut [QuarterBounds]) {
    #[inline(always)]
    fn body(least: &[i32], greatest: &[i32], columns: usize, bounds: &mut [QuarterBounds]) {
        for (index, bounds) in bounds.iter_mut().enumerate() {
            let of_block = |row: &[i32]| -> [i32; LANES] {
                *row[index * columns..].first_chunk().expect("rows go on to the end of a block")
            };
            let least = of_quarters(of_block(least), |a, b| if a < b { a } else { b });
            let greatest = of_quarters(of_block(greatest), |a, b| if a > b { a } else { b });
            *bounds = QuarterBounds { least: lanes(|i| least[i] + 1), greatest };
        }
    }
    for_each_isa!(isa, (body, body, body)(least: &[i32], greatest: &[i32], columns: usize, bounds: &mut [QuarterBounds]));
}

#[inline(always)]
fn of_quarters(numbers: [i32; LANES], of_two: impl Fn(i32, i32) -> i32) -> [i32; 4] {
    lanes(|i| of_two(of_two(numbers[i], numbers[i + 4]), of_two(numbers[i + 8], numbers[i + 12])))
}
