//! What is known of the footprints of blocks: their sides at four columns.

use std::ops::Range;

use super::block::{LANES, ROWS, Width, lanes};
use super::rows::{Coordinates, slope};
use super::shape::{larger, smaller};
use crate::cpu::Isa;
use crate::lut::kernels::for_each_isa;

/// So many blocks at once, for vectors.
pub(super) const BATCH: usize = 16;

/// Distances from the middle of a block for which its sides are told.
pub(super) const NODES: [i32; 4] = [-13, -5, 5, 13];

/// The coordinates of a row of blocks, and of the rows before and after it.
pub(super) type Near = [Coordinates; ROWS + 2];

/// The upper one of the two rows in the middle.
const UPPER: usize = ROWS / 2;

/// A number for each block.
type Lanes = [f32; BATCH];

/// Of neighbouring blocks, an array for each number; all in 1/1024 pixel.
#[derive(Debug, Default)]
pub(super) struct Samples {
    /// At each node, x and y of the side along the output's row, then of the side down its columns, in the block's middle;
    /// and by how much they change in half a row.
    pub(super) sides: [[Lanes; 4]; 4],
    pub(super) changes: [[Lanes; 4]; 4],
    /// From where cells sample to the middle of their footprints.
    pub(super) bend: [Lanes; 2],
    wide: [Wide; BATCH],
}

impl Samples {
    /// Looks at up to [`BATCH`] blocks of a row of them. Of one without a valid cell the footprints are points.
    pub(super) fn read(&mut self, isa: Isa, near: &Near, width: Width, blocks: Range<usize>) {
        let columns = width.columns();
        read_wide(isa, near.each_ref().map(Coordinates::axes), columns, blocks.clone(), &mut self.wide);
        for (index, block) in blocks.enumerate() {
            let own = block * columns..(block + 1) * columns;
            let valid = |row: usize| &near[row].valid()[own.clone()];
            if (1..=ROWS).all(|row| valid(row) == &[1; LANES][..columns]) {
                self.pick(index, width, width.nodes());
                continue;
            }
            // columns of which both rows in the middle are told
            let is_told = |column: &usize| valid(UPPER)[*column] & valid(UPPER + 1)[*column] != 0;
            match ((0..columns).find(is_told), (0..columns).rfind(is_told)) {
                (Some(first), Some(last)) => self.pick(index, width, columns_between(width, first, last)),
                _ => self.read_row(index, near, own),
            }
        }
    }

    /// Takes what is known of a block from four of its columns.
    fn pick(&mut self, index: usize, width: Width, columns: [usize; 4]) {
        let Wide { upper, lower, bend } = &self.wide[index];
        let at = columns.map(|column| width.distance(column));
        let middle = |of_columns: &Columns| of_columns[columns[1]] + of_columns[columns[2]];
        for (side, (upper, lower)) in upper.iter().zip(lower).enumerate() {
            let sum = columns.map(|column| 0.25 * (lower[column] + upper[column]));
            let difference = columns.map(|column| 0.25 * (lower[column] - upper[column]));
            // mostly: going the other way for all blocks was a seventh of a plan's time
            let (sides, changes) =
                if at == NODES { (sum, difference) } else { (at_nodes(at, sum), at_nodes(at, difference)) };
            for node in 0..NODES.len() {
                self.sides[node][side][index] = sides[node];
                self.changes[node][side][index] = changes[node];
            }
        }
        for (to, bend) in self.bend.iter_mut().zip(bend) {
            to[index] = 0.5 * middle(bend);
        }
    }

    /// Takes what is known of a block of which at most one row in the middle is told, by any row: footprints are alike.
    fn read_row(&mut self, index: usize, near: &Near, cells: Range<usize>) {
        self.bend.iter_mut().for_each(|column| column[index] = 0.0);
        let valid = |row: usize| &near[row].valid()[cells.clone()];
        let told = (1..=ROWS).find_map(|row| {
            let columns = [valid(row).iter().position(|&is| is != 0)?, valid(row).iter().rposition(|&is| is != 0)?];
            Some((row, 1 + cells.start + columns[0].midpoint(columns[1])))
        });
        let sides = told.map_or([0.0; 4], |(row, at)| {
            let [above, here, below] = [row - 1, row, row + 1].map(|row| near[row].axes());
            let along = |axis: usize| slope(here[axis][at - 1], here[axis][at], here[axis][at + 1]) as f32;
            let down = |axis: usize| slope(above[axis][at], here[axis][at], below[axis][at]) as f32;
            [along(0), along(1), down(0), down(1)]
        });
        for (node, changes) in self.sides.iter_mut().zip(&mut self.changes) {
            node.iter_mut().zip(sides).for_each(|(column, side)| column[index] = side);
            changes.iter_mut().for_each(|column| column[index] = 0.0);
        }
    }
}

/// Columns of a block between two of it at which to look at sides: four if these are far enough apart, the two if not, and
/// one if they are close.
fn columns_between(width: Width, first: usize, last: usize) -> [usize; 4] {
    let (distance, columns) = (width.distance(last) - width.distance(first), width.columns());
    if distance < 6 {
        [first.midpoint(last); 4]
    } else if distance < 18 || last - first < 3 {
        [first, first, last, last]
    } else {
        width.nodes().map(|node| first + (2 * node * (last - first) + columns - 1) / (2 * (columns - 1)))
    }
}

/// The sides at the nodes that follow from those at four distances from a block's middle: by the cubic through them, the
/// line if these are two, or none but the same if they are one.
#[cold]
fn at_nodes(known: [i32; 4], sides: [f32; 4]) -> [f32; 4] {
    if known[0] == known[3] {
        return sides;
    }
    let part = |at: i32, from: i32, to: i32| (at - from) as f32 / (to - from) as f32;
    NODES.map(|node| {
        if known[0] == known[1] {
            return sides[0] + part(node, known[0], known[3]) * (sides[3] - sides[0]);
        }
        // Lagrange's
        let weight = |own: usize| {
            (0..4).filter(|&other| other != own).map(|other| part(node, known[other], known[own])).product::<f32>()
        };
        (0..4).map(|own| weight(own) * sides[own]).sum()
    })
}

/// Columns and rows of the coordinates of [`Near`]; entry i + 1 of a row is of cell i.
type Axes<'a> = [[&'a [i32]; 2]; ROWS + 2];

/// Reads neighbouring blocks: every column of which both rows in the middle have an image.
fn read_wide(isa: Isa, axes: Axes<'_>, columns: usize, blocks: Range<usize>, wide: &mut [Wide; BATCH]) {
    for_each_isa!(isa, (body, body, body)(
        axes: Axes<'_>, columns: usize, blocks: Range<usize>, wide: &mut [Wide; BATCH]
    ));
}

// No `map` and no large closures from here on: they are compiled as functions of their own, for the baseline.

/// A number for each column of a block.
type Columns = [f32; LANES];

/// From the cell of each column to another one on the source: (x, y).
type Ways = [Columns; 2];

/// What is known of all columns of a block.
#[derive(Debug, Default, Clone, Copy)]
struct Wide {
    /// As [`Samples::sides`] in the upper and in the lower one of the rows in the middle, twice.
    upper: [Columns; 4],
    lower: [Columns; 4],
    /// As [`Samples::bend`].
    bend: [Columns; 2],
}

#[inline(always)]
fn body(axes: Axes<'_>, columns: usize, blocks: Range<usize>, wide: &mut [Wide; BATCH]) {
    let [first, upper, lower, last] = [axes[UPPER - 1], axes[UPPER], axes[UPPER + 1], axes[UPPER + 2]];
    for (wide, block) in wide.iter_mut().zip(blocks) {
        let at = 1 + block * columns;
        let [before_upper, after_upper] = along(upper, at);
        let [before_lower, after_lower] = along(lower, at);
        let [a, b, c] = tame_three(way(first, upper, at), way(upper, lower, at), way(lower, last, at));
        for axis in 0..2 {
            let (a, b, c) = (&a[axis], &b[axis], &c[axis]);
            let (before, after) = (&before_upper[axis], &after_upper[axis]);
            let (before_lower, after_lower) = (&before_lower[axis], &after_lower[axis]);
            wide.upper[axis] = lanes(|i| before[i] + after[i]);
            wide.lower[axis] = lanes(|i| before_lower[i] + after_lower[i]);
            wide.upper[2 + axis] = lanes(|i| a[i] + b[i]);
            wide.lower[2 + axis] = lanes(|i| b[i] + c[i]);
            // second differences of the two rows, of which 1/24 is what counts
            wide.bend[axis] =
                lanes(|i| ((after[i] - before[i]) + (after_lower[i] - before_lower[i]) + (c[i] - a[i])) * (0.5 / 24.0));
        }
    }
}

/// The ways from the cells before those of a row, and to those after them.
#[inline(always)]
fn along(row: [&[i32]; 2], at: usize) -> [Ways; 2] {
    let mut ways = [[[0.0; LANES]; 2]; 2];
    let [before, after] = &mut ways;
    for (axis, row) in row.into_iter().enumerate() {
        let (left, here, right) = (sixteen(row, at - 1), sixteen(row, at), sixteen(row, at + 1));
        before[axis] = lanes(|i| here[i].wrapping_sub(left[i]) as f32);
        after[axis] = lanes(|i| right[i].wrapping_sub(here[i]) as f32);
    }
    tame_two(ways)
}

/// The ways from the cells of a row to those of the next one.
#[inline(always)]
fn way(from: [&[i32]; 2], to: [&[i32]; 2], at: usize) -> Ways {
    let mut way = [[0.0; LANES]; 2];
    for (way, (from, to)) in way.iter_mut().zip(from.into_iter().zip(to)) {
        let (from, to) = (sixteen(from, at), sixteen(to, at));
        *way = lanes(|i| to[i].wrapping_sub(from[i]) as f32);
    }
    way
}

#[inline(always)]
fn sixteen(row: &[i32], at: usize) -> &[i32; LANES] {
    row[at..].first_chunk().expect("rows go on to the end of a block, and one further")
}

#[inline(always)]
fn length([x, y]: &Ways) -> Columns {
    lanes(|i| x[i].abs() + y[i].abs())
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
fn tame_two([mut a, mut b]: [Ways; 2]) -> [Ways; 2] {
    let (of_a, of_b) = (length(&a), length(&b));
    let least: Columns = lanes(|i| smaller(of_a[i], of_b[i]));
    let most: Columns = lanes(|i| larger(of_a[i], of_b[i]));
    for (a, b) in a.iter_mut().zip(&mut b) {
        let shortest: Columns = lanes(|i| if of_a[i] < of_b[i] { a[i] } else { b[i] });
        tame(a, &shortest, &least, &most);
        tame(b, &shortest, &least, &most);
    }
    [a, b]
}

#[inline(always)]
fn tame_three(mut a: Ways, mut b: Ways, mut c: Ways) -> [Ways; 3] {
    let (of_a, of_b, of_c) = (length(&a), length(&b), length(&c));
    let least: Columns = lanes(|i| smaller(smaller(of_a[i], of_b[i]), of_c[i]));
    let most: Columns = lanes(|i| larger(larger(of_a[i], of_b[i]), of_c[i]));
    for ((a, b), c) in a.iter_mut().zip(&mut b).zip(&mut c) {
        let of_others: Columns = lanes(|i| if of_b[i] < of_c[i] { b[i] } else { c[i] });
        let shortest: Columns = lanes(|i| if of_a[i] > least[i] { of_others[i] } else { a[i] });
        tame(a, &shortest, &least, &most);
        tame(b, &shortest, &least, &most);
        tame(c, &shortest, &least, &most);
    }
    [a, b, c]
}

#[inline(always)]
fn tame(ways: &mut Columns, shortest: &Columns, least: &Columns, most: &Columns) {
    let from = *ways;
    *ways = lanes(|i| if is_wild(least[i], most[i]) { shortest[i] } else { from[i] });
}
