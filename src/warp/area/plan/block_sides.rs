//! What is known of the footprints of blocks: their sides at four columns.

use std::ops::Range;

use super::choose_samples::{larger, smaller};
use crate::isa::Isa;
use crate::isa::for_each_isa;
use crate::lut::footprint::{Coordinates, slope};
use crate::table::block::{LANES, Size};

/// So many blocks at once, for vectors.
pub(super) const BATCH: usize = 16;

/// Distances from the middle of a block for which its sides are known.
pub(super) const NODES: [i32; 4] = [-13, -5, 5, 13];

/// The nodes of the widest blocks.
const WIDE: [usize; 4] = Size::ALL[0].nodes();

/// For each block a number for each of four columns.
pub(super) type Fours<T> = [[T; 4]; BATCH];

/// Of neighbouring blocks, an array for each number; all in 1/1024 pixel.
#[derive(Debug, Default)]
pub(super) struct Samples {
    /// x and y of the side along the output's row, then of the side down its columns: at each node, in the block's middle;
    /// and by how much they change in half a row.
    pub(super) sides: [Fours<f32>; 4],
    pub(super) changes: [Fours<f32>; 4],
    /// From where cells sample to the middle of their footprints, at each node.
    pub(super) bends: [Fours<f32>; 2],
    around: Around,
}

impl Samples {
    /// Looks at up to [`BATCH`] blocks of a row of them; `near` are the coordinates of their rows, and of those before and
    /// after. Of a block without a valid cell the footprints are points. False where blocks should be smaller.
    pub(super) fn read(&mut self, isa: Isa, near: &[Coordinates], size: Size, blocks: Range<usize>) -> bool {
        let mut seen = [Seen::None; BATCH];
        let middle = near[size.rows() / 2 - 1..].first_chunk().expect("rows of a block, and those beside it");
        for (seen, block) in seen.iter_mut().zip(blocks.clone()) {
            *seen = Seen::new(middle, size, block * size.columns());
        }
        let axes = middle.each_ref().map(Coordinates::axes);
        read_blocks(isa, axes, size, blocks.start, &seen[..blocks.len()], &mut self.around);
        work_out(isa, &self.around, &mut self.sides, &mut self.changes, &mut self.bends);
        let mut fits = true;
        for (index, (seen, block)) in seen.into_iter().zip(blocks).enumerate() {
            match seen {
                Seen::At(columns) => {
                    // in rows of blocks that are seen wholly and are wide there is nothing to move
                    let at = columns.map(|column| size.distance(column));
                    if at != NODES {
                        move_to_nodes(at, [&mut self.sides, &mut self.changes], index);
                    }
                }
                Seen::None => {
                    let cells = block * size.columns()..(block + 1) * size.columns();
                    fits &= self.read_row(index, near, cells);
                }
            }
        }
        fits
    }

    /// Takes what is known of a block of which at most one row in the middle is known, by any row: footprints are alike.
    /// False if a row has all cells, and there is more to see of the block than a corner.
    #[cold]
    fn read_row(&mut self, index: usize, near: &[Coordinates], cells: Range<usize>) -> bool {
        self.bends.iter_mut().for_each(|axis| axis[index] = [0.0; 4]);
        let valid = |row: usize| &near[row].valid()[cells.clone()];
        let known = (1..near.len() - 1).find_map(|row| {
            let columns = [valid(row).iter().position(|&is| is != 0)?, valid(row).iter().rposition(|&is| is != 0)?];
            Some((row, 1 + cells.start + columns[0].midpoint(columns[1])))
        });
        let sides = known.map_or([0.0; 4], |(row, at)| {
            let [above, here, below] = [row - 1, row, row + 1].map(|row| near[row].axes());
            let along = |axis: usize| slope(here[axis][at - 1], here[axis][at], here[axis][at + 1]) as f32;
            let down = |axis: usize| slope(above[axis][at], here[axis][at], below[axis][at]) as f32;
            [along(0), along(1), down(0), down(1)]
        });
        self.sides.iter_mut().zip(sides).for_each(|(of_blocks, side)| of_blocks[index] = [side; 4]);
        self.changes.iter_mut().for_each(|of_blocks| of_blocks[index] = [0.0; 4]);
        !(1..near.len() - 1).any(|row| valid(row).iter().all(|&is| is != 0))
    }
}

/// How much of a block is valid.
#[derive(Debug, Clone, Copy)]
enum Seen {
    /// The rows in the middle, so far that sides are looked at in these columns.
    At([usize; 4]),
    /// At most one of the rows in the middle.
    None,
}

impl Seen {
    /// What the block sees whose cells begin at the `first`-th of each row.
    #[inline]
    fn new([before, upper, lower, after]: &Middle, size: Size, first: usize) -> Self {
        /// A byte for each column of a block that it has.
        const ALL: u128 = u128::MAX / 0xff;
        let all = ALL >> (8 * (LANES - size.columns()));
        let valid = |row: &Coordinates| {
            let row = row.valid()[first..].first_chunk().expect("rows go on to the end of a block");
            u128::from_le_bytes(*row)
        };
        let known = valid(upper) & valid(lower) & all;
        if known & valid(before) & valid(after) == all {
            Self::At(size.nodes())
        } else if known == 0 {
            Self::None
        } else {
            let (first, last) = (known.trailing_zeros() / 8, known.ilog2() / 8);
            Self::At(columns_between(size, first as usize, last as usize))
        }
    }
}

/// The coordinates around the cells of four columns of neighbouring blocks, of x and of y.
#[derive(Debug, Default)]
struct Around {
    /// In the rows in the middle: of the cell before, of the cell and of the one after.
    upper: [[Fours<i32>; 2]; 3],
    lower: [[Fours<i32>; 2]; 3],
    /// In the rows before and after these.
    first: [Fours<i32>; 2],
    last: [Fours<i32>; 2],
}

/// Reads neighbouring blocks, the first of which is the `first`-th of its row.
fn read_blocks(isa: Isa, axes: Axes<'_>, size: Size, first: usize, seen: &[Seen], around: &mut Around) {
    #[inline(always)]
    fn body(axes: Axes<'_>, size: Size, first: usize, seen: &[Seen], around: &mut Around) {
        for (index, seen) in seen.iter().enumerate() {
            let own = (first + index) * size.columns();
            match seen {
                // columns that are known are read by vectors
                Seen::At(WIDE) => read_block(axes, own, WIDE, index, around),
                Seen::At(columns) => read_block(axes, own, *columns, index, around),
                Seen::None => {}
            }
        }
    }
    for_each_isa!(isa, (body, body, body)(
        axes: Axes<'_>, size: Size, first: usize, seen: &[Seen], around: &mut Around
    ));
}

/// Reads a block whose cells begin at the `first`-th of each row.
#[inline(always)]
fn read_block(axes: Axes<'_>, first: usize, columns: [usize; 4], index: usize, around: &mut Around) {
    #[allow(clippy::needless_range_loop)] // `axes` is indexed by row first, so there is nothing to iterate over
    for axis in 0..2 {
        // from the cell before the block's first to the one after its last
        let row = |row: usize| -> &[i32; LANES + 2] {
            axes[row][axis][first..].first_chunk().expect("rows go on to the end of a block, and one further")
        };
        let of_columns = |row: &[i32; LANES + 2], step: usize| columns.map(|column| row[column % LANES + step]);
        let [before, upper, lower, after] = [row(0), row(1), row(2), row(3)];
        for step in 0..3 {
            around.upper[step][axis][index] = of_columns(upper, step);
            around.lower[step][axis][index] = of_columns(lower, step);
        }
        around.first[axis][index] = of_columns(before, 1);
        around.last[axis][index] = of_columns(after, 1);
    }
}

/// Columns of a block between two of it at which to look at sides: four if these are far enough apart, the two if not, and
/// one if they are close.
fn columns_between(size: Size, first: usize, last: usize) -> [usize; 4] {
    let (distance, columns) = (size.distance(last) - size.distance(first), size.columns());
    if distance < 6 {
        [first.midpoint(last); 4]
    } else if distance < 18 || last - first < 3 {
        [first, first, last, last]
    } else {
        size.nodes().map(|node| first + (2 * node * (last - first) + columns - 1) / (2 * (columns - 1)))
    }
}

/// Takes the sides of a block from four distances from its middle to its nodes: by the cubic through them, the line if these
/// are two, or none but the same if they are one.
#[cold]
fn move_to_nodes(known: [i32; 4], sides: [&mut [Fours<f32>; 4]; 2], index: usize) {
    if known[0] == known[3] {
        return;
    }
    let part = |at: i32, from: i32, to: i32| (at - from) as f32 / (to - from) as f32;
    let ends = NODES.map(|node| part(node, known[0], known[3]));
    // Lagrange's
    let weights = NODES.map(|node| {
        [0, 1, 2, 3].map(|own| {
            (0..4).filter(|&other| other != own).map(|other| part(node, known[other], known[own])).product::<f32>()
        })
    });
    for side in sides.into_iter().flatten() {
        let old = side[index];
        side[index] = if known[0] == known[1] {
            ends.map(|part| old[0] + part * (old[3] - old[0]))
        } else {
            weights.map(|weights| (0..4).map(|own| weights[own] * old[own]).sum())
        };
    }
}

/// The two rows in the middle of a row of blocks, and those before and after these.
type Middle = [Coordinates; 4];

/// Columns and rows of the coordinates of [`Middle`]; entry i + 1 of a row is of cell i.
type Axes<'a> = [[&'a [i32]; 2]; 4];

/// Works out sides, changes and, for each node, bends as [`Samples`] has them.
fn work_out(
    isa: Isa,
    around: &Around,
    sides: &mut [Fours<f32>; 4],
    changes: &mut [Fours<f32>; 4],
    bends: &mut [Fours<f32>; 2],
) {
    for_each_isa!(isa, (body, body, body)(
        around: &Around, sides: &mut [Fours<f32>; 4], changes: &mut [Fours<f32>; 4], bends: &mut [Fours<f32>; 2]
    ));
}

#[inline(always)]
fn body(around: &Around, sides: &mut [Fours<f32>; 4], changes: &mut [Fours<f32>; 4], bends: &mut [Fours<f32>; 2]) {
    let Around { upper, lower, first, last } = around;
    // one loop, for vectors of columns and blocks
    for i in 0..4 * BATCH {
        let at = |[x, y]: &[Fours<i32>; 2]| (x.as_flattened()[i], y.as_flattened()[i]);
        let of_row = |[before, here, after]: &[[Fours<i32>; 2]; 3]| {
            tame_two(way(at(before), at(here)), way(at(here), at(after)))
        };
        let [[before, after], [below_before, below_after]] = [of_row(upper), of_row(lower)];
        let (at_upper, at_lower) = (at(&upper[1]), at(&lower[1]));
        let [a, b, c] = tame_three(way(at(first), at_upper), way(at_upper, at_lower), way(at_lower, at(last)));
        let mut of_axis = |axis: usize, [before, after, below_before, below_after, a, b, c]: [f32; 7]| {
            let of_upper = [before + after, a + b];
            let of_lower = [below_before + below_after, b + c];
            for side in 0..2 {
                sides[2 * side + axis].as_flattened_mut()[i] = 0.25 * (of_lower[side] + of_upper[side]);
                changes[2 * side + axis].as_flattened_mut()[i] = 0.25 * (of_lower[side] - of_upper[side]);
            }
            // second differences of the two rows, of which 1/24 is what counts
            let of_rows = (after - before) + (below_after - below_before);
            bends[axis].as_flattened_mut()[i] = (of_rows + (c - a)) * (0.5 / 24.0);
        };
        let ways = [before, after, below_before, below_after, a, b, c];
        of_axis(0, ways.map(|way| way.0));
        of_axis(1, ways.map(|way| way.1));
    }
}

/// From one cell to another on the source, (x, y). A tuple: arrays of two the compiler puts into one number.
type Way = (f32, f32);

#[inline(always)]
fn way(from: (i32, i32), to: (i32, i32)) -> Way {
    (to.0.wrapping_sub(from.0) as f32, to.1.wrapping_sub(from.1) as f32)
}

#[inline(always)]
fn length((x, y): Way) -> f32 {
    x.abs() + y.abs()
}

/// Where one step from cell to cell is much longer than another it goes from one view into the next, and all are taken to
/// be as the shortest.
#[inline(always)]
fn is_wild(shortest: f32, longest: f32) -> bool {
    /// Several times as long, and by some pixels.
    const TIMES: f32 = 4.0;
    const PIXELS: f32 = 4096.0;
    longest > TIMES * shortest + PIXELS
}

#[inline(always)]
fn tame_two(a: Way, b: Way) -> [Way; 2] {
    let (of_a, of_b) = (length(a), length(b));
    let wild = is_wild(smaller(of_a, of_b), larger(of_a, of_b));
    let shortest = either(of_a < of_b, a, b);
    [either(wild, shortest, a), either(wild, shortest, b)]
}

#[inline(always)]
fn tame_three(a: Way, b: Way, c: Way) -> [Way; 3] {
    let (of_a, of_b, of_c) = (length(a), length(b), length(c));
    let least = smaller(smaller(of_a, of_b), of_c);
    let wild = is_wild(least, larger(larger(of_a, of_b), of_c));
    let shortest = either(of_a > least, either(of_b < of_c, b, c), a);
    [either(wild, shortest, a), either(wild, shortest, b), either(wild, shortest, c)]
}

#[inline(always)]
fn either(condition: bool, a: Way, b: Way) -> Way {
    (if condition { a.0 } else { b.0 }, if condition { a.1 } else { b.1 })
}
