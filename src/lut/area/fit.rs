//! From what is known of blocks to how they are averaged.

use super::Q;
use super::block::{Block, ROWS, polynomials};
use super::samples::{BATCH, NODES, Samples};
use super::shape::{Shape, choose, larger, largest_logs, smaller, steepness};
use super::stretch::Stretches;
use crate::cpu::Isa;
use crate::lut::kernels::for_each_isa;

/// Decides on up to [`BATCH`] blocks that look at a source of this size. False where blocks should be narrower.
pub(super) fn decide(
    isa: Isa,
    source: (u32, u32),
    samples: &Samples,
    fitted: &mut Fitted,
    blocks: &mut [Block],
) -> bool {
    let mut typical = [[0.0; BATCH]; 4];
    look_at_middles(isa, samples, &mut typical, fitted);
    choose(isa, largest_logs(source), &typical, &mut fitted.shapes);
    let stretches = Stretches::new(isa, &typical, &fitted.shapes);
    fit(isa, samples, &stretches, fitted);
    let mut fits = true;
    for (index, block) in blocks.iter_mut().enumerate() {
        let shape = Shape::unpacked(fitted.shapes[index]);
        if shape == Shape::BILINEAR {
            *block = Block::BILINEAR;
            continue;
        }
        let Fitted { coefficients, changes, offset, shift, .. } = &*fitted;
        *block = Block {
            coefficients: std::array::from_fn(|number| coefficients[number][index] as i16),
            changes: std::array::from_fn(|number| changes[number][index] as i16),
            offset: [offset[0][index] as i16, offset[1][index] as i16],
            shape,
            shift: shift[index] as u8,
            clipped: false,
        };
        fits &= fitted.change[index] < MOST_CHANGE;
    }
    fits
}

/// How much sides may change from the middle of a block to its outermost node, as a part of the longest one, where the
/// road is seen steeply. Elsewhere what changes is the slant of slivers, which does not matter.
const MOST_CHANGE: f32 = 0.2;

/// Works out the sides in the middle of each block, in pixels, the mean of those at the nodes beside it; and how much they
/// change from there, and the offsets of footprints.
fn look_at_middles(isa: Isa, samples: &Samples, typical: &mut [[f32; BATCH]; 4], fitted: &mut Fitted) {
    #[inline(always)]
    #[allow(clippy::needless_range_loop)] // of zipped iterators the compiler makes no vectors
    fn body(samples: &Samples, typical: &mut [[f32; BATCH]; 4], fitted: &mut Fitted) {
        const PIXEL: f32 = 1.0 / (1 << Q) as f32;
        for i in 0..BATCH {
            let (mut change, mut length) = (0.0, 1024.0);
            for side in 0..4 {
                let [a, b, c, d] = samples.sides[side][i];
                typical[side][i] = (b + c) * (0.5 * PIXEL);
                let middle = typical[side][i] * f32::from(1u16 << Q);
                change = larger(change, larger((a - middle).abs(), (d - middle).abs()));
                length = larger(length, middle.abs());
            }
            let [ax, ay, bx, by] = [typical[0][i], typical[1][i], typical[2][i], typical[3][i]];
            let steep = steepness((ax * by - ay * bx).abs(), ax * ax + ay * ay + bx * bx + by * by);
            fitted.change[i] = if steep > 0.0 { change / length } else { 0.0 };
            for axis in 0..2 {
                let [_, b, c, _] = samples.bends[axis][i];
                fitted.offset[axis][i] = whole(0.5 * (b + c), i16::MAX.into());
            }
        }
    }
    for_each_isa!(isa, (body, body, body)(samples: &Samples, typical: &mut [[f32; BATCH]; 4], fitted: &mut Fitted));
}

/// Numbers of blocks, which fit those of [`Block`].
#[derive(Debug, Default)]
pub(super) struct Fitted {
    /// As bytes.
    pub(super) shapes: [u32; BATCH],
    coefficients: [[i32; BATCH]; 16],
    changes: [[i32; BATCH]; 16],
    pub(super) offset: [[i32; BATCH]; 2],
    shift: [u32; BATCH],
    /// How far from the middle of a footprint its probes are at most along each axis, 1/1024 pixel.
    pub(super) far: [[i32; BATCH]; 2],
    /// See [`MOST_CHANGE`].
    change: [f32; BATCH],
}

fn fit(isa: Isa, samples: &Samples, stretches: &Stretches, fitted: &mut Fitted) {
    for_each_isa!(isa, (body, body, body)(
        samples: &Samples, stretches: &Stretches, fitted: &mut Fitted
    ));
}

#[inline(always)]
fn body(samples: &Samples, stretches: &Stretches, fitted: &mut Fitted) {
    // one loop, and no closures: of loops in loops the compiler gathers and scatters lanes
    for i in 0..BATCH {
        let (mut sides, mut changes) = ([[0.0; 4]; 4], [[0.0; 4]; 4]);
        for side in 0..4 {
            sides[side] = polynomial(samples.sides[side][i]);
            changes[side] = polynomial(samples.changes[side][i]);
        }
        let (xx, yx, yy) = (stretches.xx[i], stretches.yx[i], stretches.yy[i]);
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
                let most_of_rows = sides[side][degree].abs() + OUTER_ROW * changes[side][degree].abs();
                most[side] += most_of_rows * MOST_BASIS[degree];
            }
            longest = larger(longest, most[side]);
        }
        let shift = shift_of(longest);
        // of maps that jump about more than that nothing can be told: their footprints are points
        let is_told = longest < LIMIT * f32::from(1u16 << MOST_SHIFT);
        let unit = if is_told { f32::from_bits((127 - shift) << 23) } else { 0.0 };
        for side in 0..4 {
            for degree in 0..4 {
                let number = 4 * side + degree;
                fitted.coefficients[number][i] = whole(sides[side][degree] * (2.0 * unit), i16::MAX.into());
                fitted.changes[number][i] = whole(changes[side][degree] * (2.0 * unit), i16::MAX.into());
            }
        }
        fitted.shift[i] = shift;
        // of n probes the outermost are half a side, less half the distance between two, from the middle
        let outermost = |count: u32| 0.5 - 0.5 / (count as f32);
        let (along, down) = (outermost(fitted.shapes[i] >> 16 & 0xff), outermost(fitted.shapes[i] >> 24));
        for axis in 0..2 {
            // rounded coefficients are half a unit off, products and sums another one
            let far = (most[axis] * along + most[2 + axis] * down) * unit + 4.0;
            fitted.far[axis][i] = whole(far, 2.0 * LIMIT) << shift;
        }
    }
}

/// Half rows from the middle of a block to its outer rows.
const OUTER_ROW: f32 = (ROWS - 1) as f32;

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
