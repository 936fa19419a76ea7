//! How far the probes of blocks reach, and which may leave the level that they look at.

use std::ops::Range;

use super::RipLevel;
use super::block_sides::BATCH;
use super::column_bounds::{ColumnBounds, QuarterBounds};
use super::fit_cubic::BlockFit;
use crate::isa::Isa;
use crate::isa::for_each_isa;
use crate::kernels::FRACTION_BITS;
use crate::table::block::Size;
use crate::table::pattern::SamplePattern;

/// The entries of their levels that the probes of neighbouring blocks touch. Nothing is known of blocks that are bilinear.
#[derive(Debug, Default, Clone)]
pub(super) struct SupportBounds {
    /// The first column and row, and those behind the last, of the ones that the level has.
    starts: [[u32; BATCH]; 2],
    ends: [[u32; BATCH]; 2],
    /// Whether probes may leave the level.
    clipped: [bool; BATCH],
    /// Whether cells are so far from each other that they must be of several views.
    discontinuous: [bool; BATCH],
}

impl SupportBounds {
    /// Works them out for some blocks, the first of which is the `first`-th of its row, on a source of this size.
    pub(super) fn read(
        &mut self,
        isa: Isa,
        source: (u32, u32),
        (size, first): (Size, usize),
        fits: &BlockFit,
        blocks: usize,
        columns_bounds: &ColumnBounds,
    ) {
        let mut bounds = [[QuarterBounds::default(); BATCH]; 2];
        let of_axes = bounds.each_mut().map(|of_blocks| &mut of_blocks[..blocks]);
        columns_bounds.of_blocks(isa, first * size.columns(), size.columns(), of_axes);
        reach(isa, source, fits, &bounds, self);
    }

    pub(super) fn is_clipped(&self, index: usize) -> bool {
        self.clipped[index]
    }

    /// Whether any of the first `blocks` is of several views.
    pub(super) fn are_discontinuous(&self, blocks: usize) -> bool {
        self.discontinuous[..blocks].contains(&true)
    }

    /// Columns and rows of the level that a block touches.
    pub(super) fn entries(&self, index: usize) -> [Range<u32>; 2] {
        [0, 1].map(|axis| self.starts[axis][index]..self.ends[axis][index])
    }
}

/// Works out what blocks reach from their bounds.
fn reach(
    isa: Isa,
    source: (u32, u32),
    fits: &BlockFit,
    bounds: &[[QuarterBounds; BATCH]; 2],
    supports: &mut SupportBounds,
) {
    #[inline(always)]
    #[allow(clippy::needless_range_loop)] // of zipped iterators the compiler makes no vectors
    fn body(source: (u32, u32), fits: &BlockFit, bounds: &[[QuarterBounds; BATCH]; 2], supports: &mut SupportBounds) {
        /// Longer than the cell in the middle makes believe by this, and by some pixels.
        const TIMES: f32 = 1.5;
        const PIXELS: f32 = 16.0;
        let (mut outside, mut discontinuous) = ([[false; BATCH]; 2], [[false; BATCH]; 2]);
        for axis in 0..2 {
            let side = if axis == 0 { source.0 } else { source.1 };
            for i in 0..BATCH {
                let QuarterBounds { least: [a, b, c, d], greatest: [e, f, g, h] } = bounds[axis][i];
                let edge = Edge::new(side, fits.patterns[i] >> (8 * axis) & 0xff);
                let (offset, far) = (fits.offset[axis][i] - edge.corner, fits.far[axis][i]);
                let (least, greatest) = (smaller(smaller(a, b), smaller(c, d)), larger(larger(e, f), larger(g, h)));
                let pixels = greatest.wrapping_sub(least) as f32 * (1.0 / (1 << FRACTION_BITS) as f32);
                discontinuous[axis][i] = pixels > TIMES * fits.extent[axis][i] + PIXELS;
                let (low, high) = ((least + offset - far) >> edge.step, (greatest + offset + far) >> edge.step);
                outside[axis][i] = (low < 0) | (high >= edge.last);
                let entry = |at: i32| (smaller(larger(at, 0), edge.last) >> FRACTION_BITS) as u32;
                supports.starts[axis][i] = entry(low);
                supports.ends[axis][i] = (entry(high) + 2).min(entry(edge.last) + 1);
            }
        }
        for i in 0..BATCH {
            supports.clipped[i] = outside[0][i] | outside[1][i];
            supports.discontinuous[i] = discontinuous[0][i] | discontinuous[1][i];
        }
    }
    for_each_isa!(isa, (body, body, body)(
        source: (u32, u32), fits: &BlockFit, bounds: &[[QuarterBounds; BATCH]; 2], supports: &mut SupportBounds
    ));
}

/// Where the level of a pattern begins and ends along an axis.
#[derive(Clone, Copy)]
struct Edge {
    /// The box's top-left pixel from its middle, in 1/1024 pixel.
    corner: i32,
    /// The last entry of the level, in 1/1024 entry.
    last: i32,
    /// log2 of the pixels from entry to entry.
    step: u32,
}

impl Edge {
    /// That of boxes of `2^k` pixels along a side of the source.
    #[inline(always)]
    fn new(side: u32, k: u32) -> Self {
        Self {
            corner: ((1 << k) - 1) << (FRACTION_BITS - 1),
            last: ((RipLevel::boxes(side, k) - 1) as i32) << FRACTION_BITS,
            step: RipLevel::log_step(k),
        }
    }
}

/// Tells for each of neighbouring footprints of a pattern, whose sides are shifted by so much, 1 if a probe leaves the level
/// of a source of this size.
pub(crate) fn leaves(
    isa: Isa,
    (pattern, shift): (SamplePattern, u8),
    source: (u32, u32),
    centre: [&[i32]; 2],
    sides: [&[i16]; 4],
    leaves: &mut [u8],
) {
    #[inline(always)]
    fn body(
        edges: [Edge; 2],
        outermost: [i32; 2],
        shift: u32,
        centre: [&[i32]; 2],
        sides: [&[i16]; 4],
        leaves: &mut [u8],
    ) {
        let cells = leaves.len();
        leaves.fill(0);
        for (axis, Edge { corner, last, step }) in edges.into_iter().enumerate() {
            let (centre, along, down) = (&centre[axis][..cells], &sides[axis][..cells], &sides[2 + axis][..cells]);
            for i in 0..cells {
                let (along, down) = (i32::from(along[i]).abs(), i32::from(down[i]).abs());
                let far = ((along * outermost[0] + down * outermost[1]) >> shift) + 1;
                let middle = centre[i].wrapping_sub(corner);
                let (low, high) = (middle.wrapping_sub(far) >> step, middle.wrapping_add(far) >> step);
                leaves[i] |= u8::from((low < 0) | (high >= last));
            }
        }
    }
    let edges = [Edge::new(source.0, pattern.kx.into()), Edge::new(source.1, pattern.ky.into())];
    // how far the outermost probe is along each side, in 1/16384 of it
    let outermost =
        [pattern.along, pattern.down].map(|count| SamplePattern::offsets(count).last().map_or(0, |&last| last.into()));
    let shift = 14 - u32::from(shift);
    for_each_isa!(isa, (body, body, body)(
        edges: [Edge; 2], outermost: [i32; 2], shift: u32, centre: [&[i32]; 2], sides: [&[i16]; 4], leaves: &mut [u8]
    ));
}

#[inline(always)]
fn smaller(a: i32, b: i32) -> i32 {
    if a < b { a } else { b }
}

#[inline(always)]
fn larger(a: i32, b: i32) -> i32 {
    if a > b { a } else { b }
}
