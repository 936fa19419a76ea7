//! From what is known of blocks to how they are averaged.

use super::block_sides::{BATCH, Fours, NODES, Samples};
use super::choose_samples::{choose, larger, largest_logs, smaller, steepness};
use super::variance_match::VarianceMatch;
use crate::isa::Isa;
use crate::isa::for_each_isa;
use crate::kernels::FRACTION_BITS;
use crate::table::block::{Block, Size, polynomials};
use crate::table::pattern::SamplePattern;

/// Decides on up to [`BATCH`] blocks of this size that look at a source of this one.
pub(super) fn decide(isa: Isa, source: (u32, u32), size: Size, samples: &Samples, fits: &mut BlockFit) {
    let mut typical = [[0.0; BATCH]; 4];
    let outer_row = f32::from(size.half_rows(size.rows() - 1));
    look_at_middles(isa, samples, [size.columns() as f32, size.rows() as f32], &mut typical, fits);
    choose(isa, largest_logs(source), &typical, &mut fits.patterns);
    let matches = VarianceMatch::new(isa, &typical, &fits.patterns);
    fit_cubic(isa, samples, &matches, outer_row, fits);
}

/// By how much sides of blocks change at most, as a part of the longest one.
#[derive(Debug, Default, Clone, Copy)]
pub(super) struct Variation {
    /// From the middle of a block to its outermost node, where the road is seen steeply.
    of_nodes: f32,
    /// In half a row.
    of_row: f32,
}

impl Variation {
    pub(super) fn or(self, other: Self) -> Self {
        Self { of_nodes: larger(self.of_nodes, other.of_nodes), of_row: larger(self.of_row, other.of_row) }
    }

    /// Whether blocks of this size are small enough: those that have the fewest columns or rows are, whatever the change is.
    pub(super) fn fits(self, size: Size) -> bool {
        self.rows_fit(size, MOST_CHANGE_OF_ROWS)
            && (size.columns() == Size::FEWEST_COLUMNS || self.of_nodes < MOST_CHANGE)
    }

    /// Whether it is of use to try this size in rows beside those that change by so much: only where it may do.
    pub(super) fn may_fit(self, size: Size) -> bool {
        self.rows_fit(size, 1.1 * MOST_CHANGE_OF_ROWS)
    }

    fn rows_fit(self, size: Size, most: f32) -> bool {
        size.rows() == Size::FEWEST_ROWS || self.of_row * f32::from(size.half_rows(size.rows() - 1)) < most
    }
}

/// How much sides may change from the middle of a block to its outermost node, as a part of the longest one, where the road
/// is seen steeply. Elsewhere what changes is the slant of slivers, which does not matter.
const MOST_CHANGE: f32 = 0.2;

/// The same, from the middle to the first and the last row, wherever it is.
///
/// Of images of 1024 x 512 the nearest cells of 20 cm lost nothing by higher blocks; with 0.1 here they lost 0.2 dB, and
/// plans took a tenth less time.
const MOST_CHANGE_OF_ROWS: f32 = 0.06;

/// Shapes of blocks of more than the fewest rows are those of footprints so far on the way from the middle to the row where
/// they are longest: boxes that are too small cost more than boxes that are too large. Without it near cells of 20 cm lost
/// 0.02 dB more.
const HALF_WAY: f32 = 0.5;

/// Works out the sides in the middle of each block, in pixels, the mean of those at the nodes beside it, longer by
/// [`HALF_WAY`]; how much they change from there; how long and wide so many columns and rows of such sides are; and the
/// offsets of footprints.
fn look_at_middles(isa: Isa, samples: &Samples, cells: [f32; 2], typical: &mut [[f32; BATCH]; 4], fits: &mut BlockFit) {
    #[inline(always)]
    #[allow(clippy::needless_range_loop)] // of zipped iterators the compiler makes no vectors
    fn body(samples: &Samples, [columns, rows]: [f32; 2], typical: &mut [[f32; BATCH]; 4], fits: &mut BlockFit) {
        const PIXEL: f32 = 1.0 / (1 << FRACTION_BITS) as f32;
        for i in 0..BATCH {
            let (mut of_nodes, mut of_rows, mut length) = (0.0, 0.0, 1024.0);
            for side in 0..4 {
                let [a, b, c, d] = samples.sides[side][i];
                typical[side][i] = (b + c) * (0.5 * PIXEL);
                let middle = typical[side][i] * f32::from(1u16 << FRACTION_BITS);
                of_nodes = larger(of_nodes, larger((a - middle).abs(), (d - middle).abs()));
                let [_, b, c, _] = samples.changes[side][i];
                of_rows = larger(of_rows, (0.5 * (b + c)).abs());
                length = larger(length, middle.abs());
            }
            let [ax, ay, bx, by] = [typical[0][i], typical[1][i], typical[2][i], typical[3][i]];
            let steep = steepness((ax * by - ay * bx).abs(), ax * ax + ay * ay + bx * bx + by * by);
            fits.change[i] = if steep > 0.0 { of_nodes / length } else { 0.0 };
            fits.change_of_row[i] = of_rows / length;
            let longer = 1.0 + HALF_WAY * (rows - Size::FEWEST_ROWS as f32) * fits.change_of_row[i];
            for side in 0..4 {
                typical[side][i] *= longer;
            }
            for axis in 0..2 {
                let (along, down) = (typical[axis][i].abs(), typical[2 + axis][i].abs());
                fits.extent[axis][i] = columns * along + rows * down;
                let [_, b, c, _] = samples.bends[axis][i];
                fits.offset[axis][i] = whole(0.5 * (b + c), i16::MAX.into());
            }
        }
    }
    for_each_isa!(isa, (body, body, body)(
        samples: &Samples,
        cells: [f32; 2],
        typical: &mut [[f32; BATCH]; 4],
        fits: &mut BlockFit,
    ));
}

/// Numbers of blocks, which fit those of [`Block`].
#[derive(Debug, Default)]
pub(super) struct BlockFit {
    /// As bytes.
    pub(super) patterns: [u32; BATCH],
    /// Of each side, those of all degrees beside each other.
    coefficients: [Fours<i16>; 4],
    changes: [Fours<i16>; 4],
    pub(super) offset: [[i32; BATCH]; 2],
    shift: [u32; BATCH],
    /// How far from the middle of a footprint its probes are at most along each axis, 1/1024 pixel.
    pub(super) far: [[i32; BATCH]; 2],
    /// How long along each axis a block of cells is that are all as the one in its middle, pixels.
    pub(super) extent: [[f32; BATCH]; 2],
    /// How much sides change from the middle to the outermost node, as [`MOST_CHANGE`], and in half a row.
    change: [f32; BATCH],
    change_of_row: [f32; BATCH],
}

impl BlockFit {
    /// By how much sides of the first `blocks` change from node to node and from row to row.
    pub(super) fn change(&self, blocks: usize) -> Variation {
        let mut most = Variation::default();
        // of those that are bilinear nothing is known by how their sides change
        for index in (0..blocks).filter(|&index| !SamplePattern::unpacked(self.patterns[index]).is_bilinear()) {
            most.of_nodes = larger(most.of_nodes, self.change[index]);
            most.of_row = larger(most.of_row, self.change_of_row[index]);
        }
        most
    }

    /// One of the blocks.
    #[inline]
    pub(super) fn block(&self, index: usize, clipped: bool) -> Block {
        let pattern = SamplePattern::unpacked(self.patterns[index]);
        if pattern.is_bilinear() {
            return Block::BILINEAR;
        }
        Block {
            coefficients: of_sides(&self.coefficients, index),
            changes: of_sides(&self.changes, index),
            offset: [self.offset[0][index] as i16, self.offset[1][index] as i16],
            pattern,
            shift: self.shift[index] as u8,
            clipped,
        }
    }
}

/// The numbers of a block, side by side.
#[inline]
fn of_sides(sides: &[Fours<i16>; 4], index: usize) -> [i16; 16] {
    let mut numbers = [0; 16];
    for (numbers, side) in numbers.as_chunks_mut().0.iter_mut().zip(sides) {
        *numbers = side[index];
    }
    numbers
}

/// `outer_row`: half rows from the middle of blocks to their outer rows.
fn fit_cubic(isa: Isa, samples: &Samples, matches: &VarianceMatch, outer_row: f32, fits: &mut BlockFit) {
    for_each_isa!(isa, (body, body, body)(
        samples: &Samples, matches: &VarianceMatch, outer_row: f32, fits: &mut BlockFit
    ));
}

#[inline(always)]
fn body(samples: &Samples, matches: &VarianceMatch, outer_row: f32, fits: &mut BlockFit) {
    // Coefficients and changes are rounded to half a unit, and what they are multiplied to to a whole one.
    let rounded = 0.25 * (1.0 + outer_row) * (MOST_BASIS[0] + MOST_BASIS[1] + MOST_BASIS[2] + MOST_BASIS[3]) + 1.0;
    // one loop, and no closures: of loops in loops the compiler gathers and scatters lanes
    for i in 0..BATCH {
        let (mut sides, mut changes) = ([[0.0; 4]; 4], [[0.0; 4]; 4]);
        for side in 0..4 {
            sides[side] = polynomial(samples.sides[side][i]);
            changes[side] = polynomial(samples.changes[side][i]);
        }
        let (xx, yx, yy) = (matches.xx[i], matches.yx[i], matches.yy[i]);
        let (mut most, mut longest) = ([0.0; 4], 0.0);
        for side in [0, 2] {
            for degree in 0..4 {
                let (x, y) = (sides[side][degree], sides[side + 1][degree]);
                (sides[side][degree], sides[side + 1][degree]) = (xx * x, yx * x + yy * y);
                let (x, y) = (changes[side][degree], changes[side + 1][degree]);
                (changes[side][degree], changes[side + 1][degree]) = (xx * x, yx * x + yy * y);
            }
        }
        for side in 0..4 {
            for degree in 0..4 {
                let most_of_rows = sides[side][degree].abs() + outer_row * changes[side][degree].abs();
                most[side] += most_of_rows * MOST_BASIS[degree];
            }
            longest = larger(longest, most[side]);
        }
        let shift = shift_of(longest);
        // of maps that jump about more than that nothing can be known: their footprints are points
        let is_known = longest < LIMIT * f32::from(1u16 << MOST_SHIFT);
        let unit = if is_known { f32::from_bits((127 - shift) << 23) } else { 0.0 };
        for side in 0..4 {
            let [c0, c1, c2, c3] = sides[side].map(|number| whole(number * (2.0 * unit), i16::MAX.into()) as i16);
            fits.coefficients[side][i] = [c0, c1, c2, c3];
            let [c0, c1, c2, c3] = changes[side].map(|number| whole(number * (2.0 * unit), i16::MAX.into()) as i16);
            fits.changes[side][i] = [c0, c1, c2, c3];
        }
        fits.shift[i] = shift;
        // of n probes the outermost are half a side, less half the distance between two, from the middle
        let outermost = |count: u32| 0.5 - 0.5 / (count as f32);
        let (along, down) = (outermost(fits.patterns[i] >> 16 & 0xff), outermost(fits.patterns[i] >> 24));
        for axis in 0..2 {
            // and the sum of both parts is rounded
            let far = (most[axis] * unit + rounded) * along + (most[2 + axis] * unit + rounded) * down + 1.5;
            fits.far[axis][i] = whole(far, 2.0 * LIMIT) << shift;
        }
    }
}

/// The longest side of a block in units of its shift: 2^14, and room for coefficients that are larger than what they are
/// multiplied to.
const LIMIT: f32 = 14000.0;

/// The largest unit is 16 pixels.
const MOST_SHIFT: u32 = 14;

/// How large a polynomial of the basis is at most.
const MOST_BASIS: [f32; 4] = {
    let [_, first, second, third] = polynomials(15);
    [1.0, first as f32 / 64.0, second as f32 / 64.0, third as f32 / 64.0]
};

/// The coefficients of the cubic through the numbers at four nodes.
#[inline(always)]
fn polynomial([a, b, c, d]: [f32; 4]) -> [f32; 4] {
    /// Degree by degree what the basis is at the near and at the far node.
    const AT: [[f32; 2]; 4] = {
        let [near, far] = [polynomials(NODES[2]), polynomials(NODES[3])];
        let mut at = [[0.0; 2]; 4];
        let mut degree = 0;
        while degree < 4 {
            at[degree] = [near[degree] as f32 / 64.0, far[degree] as f32 / 64.0];
            degree += 1;
        }
        at
    };
    const EVEN: f32 = 0.5 / (AT[2][1] - AT[2][0]);
    const ODD: f32 = 0.5 / (AT[1][0] * AT[3][1] - AT[1][1] * AT[3][0]);
    // the basis is even or odd, so are the parts of the cubic
    let c2 = ((a + d) - (b + c)) * EVEN;
    let c0 = 0.5 * (b + c) - c2 * AT[2][0];
    let c1 = ((c - b) * AT[3][1] - (d - a) * AT[3][0]) * ODD;
    let c3 = ((d - a) * AT[1][0] - (c - b) * AT[1][1]) * ODD;
    [c0, c1, c2, c3]
}

/// By how much to shift sides of up to `longest` so that twice their coefficients fit 16 bits. Even, so that neighbouring
/// blocks are mostly of one shift.
#[inline(always)]
fn shift_of(longest: f32) -> u32 {
    let parts = longest * (1.0 / LIMIT);
    let log = ((parts.to_bits() >> 23) & 0xff).wrapping_sub(126);
    let shift = log.wrapping_add(1) & !1;
    if parts < 1.0 { 0 } else { shift.min(MOST_SHIFT) }
}

/// The nearest whole number to one that is cut to `most` either way, which is at most 2^22.
#[inline(always)]
fn whole(number: f32, most: f32) -> i32 {
    /// Added to a float32, it leaves the nearest whole number in the low bits: conversions are not made with vectors, for
    /// the sake of numbers that are too large.
    const WHOLE: f32 = 1.5 * (1 << 23) as f32;
    (smaller(larger(number, -most), most) + WHOLE).to_bits().wrapping_sub(WHOLE.to_bits()) as i32
}
