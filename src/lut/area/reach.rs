//! How far the probes of footprints reach, and which leave the level that they look at.

use std::ops::Range;

use super::{Cells, Level, Q, Shape};
use crate::cpu::Isa;
use crate::lut::kernels::for_each_isa;

/// The entries that probes touch are told for so many neighbouring footprints at once.
const BLOCK: usize = 16;

/// What all footprints of a run have in common.
#[derive(Clone, Copy)]
pub(super) struct Lattice {
    pub(super) shift: u8,
    /// How far the outermost probe is along each side, in 1/16384 of it.
    outermost: [i32; 2],
    /// The box's top-left pixel from its middle, in 1/1024 pixel.
    corner: [i32; 2],
    /// The last entry of the level in each direction, in 1/1024 entry.
    last: [i32; 2],
    /// log2 of the pixels from entry to entry.
    steps: [u32; 2],
}

impl Lattice {
    pub(super) fn new(shape: Shape, shift: u8, (width, height): (u32, u32)) -> Self {
        let (box_width, box_height) = shape.box_size();
        Self {
            shift,
            outermost: [shape.along, shape.down]
                .map(|count| Shape::offsets(count).last().map_or(0, |&last| last.into())),
            corner: [box_width, box_height].map(|size| (size as i32 - 1) << (Q - 1)),
            last: [(width, shape.kx), (height, shape.ky)]
                .map(|(side, k)| ((Level::boxes(side, k.into()) - 1) as i32) << Q),
            steps: [shape.kx, shape.ky].map(|k| Level::log_step(k.into())),
        }
    }
}

/// Which entries the probes of a run of footprints touch.
pub(super) struct Reach {
    /// For each block of footprints: left, right, top and bottom, 1/1024 entry, not yet kept inside the level.
    blocks: Vec<[i32; 4]>,
    clipped: Vec<u8>,
    last: [i32; 2],
}

impl Reach {
    pub(super) fn new(columns: usize) -> Self {
        Self { blocks: vec![[0; 4]; columns.div_ceil(BLOCK)], clipped: vec![0; columns], last: [0; 2] }
    }

    /// By how many bits the sides of footprints must be shifted to fit 16.
    pub(super) fn shift(isa: Isa, sides: [&[i32]; 4]) -> u8 {
        let bits = sides.into_iter().fold(0, |bits, side| bits | any_bits(isa, side));
        (17 - bits.leading_zeros().min(17)).min(14) as u8
    }

    /// Reads the footprints `range` of a band, and tells whether a probe leaves the level.
    pub(super) fn read(&mut self, isa: Isa, lattice: &Lattice, cells: &Cells, range: Range<usize>) -> bool {
        let count = range.len();
        self.last = lattice.last;
        let sides = [&cells.along[0], &cells.along[1], &cells.down[0], &cells.down[1]].map(|side| &side[range.clone()]);
        let centre = [&cells.x[range.clone()], &cells.y[range]];
        let blocks = &mut self.blocks[..count.div_ceil(BLOCK)];
        bounds_of_blocks(isa, lattice, centre, sides, blocks, &mut self.clipped[..count]);
        let [last_x, last_y] = lattice.last;
        blocks.iter().any(|&[left, right, top, bottom]| left < 0 || top < 0 || right >= last_x || bottom >= last_y)
    }

    /// For each footprint of those that were read, 1 if a probe leaves the level.
    pub(super) fn clipped(&self) -> &[u8] {
        &self.clipped
    }

    /// Tells the entries that the first `count` footprints touch, block by block: columns and rows.
    pub(super) fn blocks(&self, count: usize, mut tell: impl FnMut(Range<u32>, Range<u32>)) {
        for &[left, right, top, bottom] in &self.blocks[..count.div_ceil(BLOCK)] {
            let entries = |low: i32, high: i32, last: i32| {
                (low.clamp(0, last) >> Q) as u32..(high.clamp(0, last) >> Q) as u32 + 2
            };
            tell(entries(left, right, self.last[0]), entries(top, bottom, self.last[1]));
        }
    }
}

fn bounds_of_blocks(
    isa: Isa,
    lattice: &Lattice,
    centre: [&[i32]; 2],
    sides: [&[i16]; 4],
    blocks: &mut [[i32; 4]],
    clipped: &mut [u8],
) {
    #[inline(always)]
    fn body(lattice: &Lattice, centre: [&[i32]; 2], sides: [&[i16]; 4], blocks: &mut [[i32; 4]], clipped: &mut [u8]) {
        let Lattice { shift, outermost: [along, down], corner, last, steps } = *lattice;
        let cells = clipped.len();
        let ([x, y], [ax, ay, bx, by]) = (centre.map(|axis| &axis[..cells]), sides.map(|side| &side[..cells]));
        for (index, block) in blocks.iter_mut().enumerate() {
            let [mut left, mut right, mut top, mut bottom] = [i32::MAX, i32::MIN, i32::MAX, i32::MIN];
            for i in index * BLOCK..(index * BLOCK + BLOCK).min(cells) {
                let far = |a: i16, b: i16| {
                    ((i32::from(a).abs() * along + i32::from(b).abs() * down) >> (14 - u32::from(shift))) + 1
                };
                let (middle_x, far_x) = (x[i] - corner[0], far(ax[i], bx[i]));
                let (middle_y, far_y) = (y[i] - corner[1], far(ay[i], by[i]));
                let (low_x, high_x) = ((middle_x - far_x) >> steps[0], (middle_x + far_x) >> steps[0]);
                let (low_y, high_y) = ((middle_y - far_y) >> steps[1], (middle_y + far_y) >> steps[1]);
                clipped[i] = u8::from((low_x < 0) | (low_y < 0) | (high_x >= last[0]) | (high_y >= last[1]));
                (left, right) = (left.min(low_x), right.max(high_x));
                (top, bottom) = (top.min(low_y), bottom.max(high_y));
            }
            *block = [left, right, top, bottom];
        }
    }
    for_each_isa!(isa, (body, body, body)(
        lattice: &Lattice, centre: [&[i32]; 2], sides: [&[i16]; 4], blocks: &mut [[i32; 4]], clipped: &mut [u8]
    ));
}

/// Shifts the sides of footprints so that they fit 16 bits; those that do not are as large as they can be.
pub(super) fn narrow(isa: Isa, sides: &[i32], shift: u8, narrow: &mut [i16]) {
    #[inline(always)]
    fn body(sides: &[i32], shift: u8, narrow: &mut [i16]) {
        let sides = &sides[..narrow.len()];
        for i in 0..narrow.len() {
            narrow[i] = (sides[i] >> shift).clamp(-0x7fff, 0x7fff) as i16;
        }
    }
    for_each_isa!(isa, (body, body, body)(sides: &[i32], shift: u8, narrow: &mut [i16]));
}

/// The bits that any of these has, signs aside.
fn any_bits(isa: Isa, numbers: &[i32]) -> u32 {
    #[inline(always)]
    fn body(numbers: &[i32], bits: &mut u32) {
        let mut all = 0;
        for &number in numbers {
            all |= number.unsigned_abs();
        }
        *bits = all;
    }
    let mut bits = 0;
    let into = &mut bits;
    for_each_isa!(isa, (body, body, body)(numbers: &[i32], into: &mut u32));
    bits
}
