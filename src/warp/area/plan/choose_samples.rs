//! How a footprint is averaged: which lattice of probes, over which boxes.

use crate::isa::Isa;
use crate::isa::for_each_isa;
use crate::table::pattern::{MAX_LOG, MAX_PROBES};

/// The largest level that a source of this size has in each direction.
pub(super) fn largest_logs((width, height): (u32, u32)) -> [u32; 2] {
    [width, height].map(|size| if size < 4 { 0 } else { ((size - 1).ilog2() - 1).min(MAX_LOG) })
}

/// The patterns of footprints with sides (x, y) along and (x, y) down, in pixels, as bytes; levels above `largest` do not
/// fit the source.
///
/// Boxes must fit into the parallelogram, or they blur across it, and probes must lie no further apart than boxes are
/// large, or pixels between them are missed. So boxes are a part of the chords through the middle of the footprint, and
/// the sides are divided into boxes. Large footprints get more boxes to a chord, by the root of its length: there the
/// result is so good that the corners of boxes show. They show most where the footprint lies across the pixels, and where
/// it is a rectangle along them there are none.
pub(super) fn choose<const N: usize>(isa: Isa, largest: [u32; 2], sides: &[[f32; N]; 4], patterns: &mut [u32; N]) {
    let (sides, patterns) = (sides.each_ref().map(|side| &side[..]), &mut patterns[..]);
    for_each_isa!(isa, (body, body, body)(largest: [u32; 2], sides: [&[f32]; 4], patterns: &mut [u32]));
}

#[inline(always)]
fn body(largest: [u32; 2], sides: [&[f32]; 4], patterns: &mut [u32]) {
    /// Chords in pixels of which a box is as long as the chord: this where the footprint is a pixel thick in the other
    /// direction, for there the source's own pixels decide how good the result can be; shorter where it is thicker, but
    /// no shorter than `SHORTEST` across and down.
    const SINGLE: f32 = 3.0;
    const SHORTEST: [f32; 2] = [1.2, 0.6];
    /// These, times this where the footprint fills this part of its bounding box or less, and more the more it fills.
    const ACROSS: (f32, f32) = (0.5, 0.6);
    const MORE: f32 = 7.0;
    /// Where the road is seen from so far above that footprints are no longer slivers, all cells near the camera are as
    /// good as the source allows, and lattices and boxes show: they are finer by this there, see [`steepness`].
    const STEEP: f32 = 8.0;
    /// How much of a step between two sizes of boxes is rounded up: 2^0.29. With 1.32, 10 cm cells take a tenth less time,
    /// but slivers of ten pixels are worse by 0.1 dB. Less to boxes of two pixels: with 1.32, slivers of two pixels were worse
    /// than bilinear by 0.13 dB; with 1, 5 x 2.5 cm cells took half as long again.
    const UP: f32 = 1.22;
    const UP_TO_TWO: f32 = 1.15;
    /// How much of a step between two sizes of boxes is rounded up where the lattice is known: 2^0.32.
    const UP_LEFT: f32 = 1.25;
    let count = patterns.len();
    let [ax, ay, bx, by] = sides.map(|side| &side[..count]);
    for i in 0..count {
        let area = (ax[i] * by[i] - ay[i] * bx[i]).abs();
        let [ax, ay, bx, by] = [ax[i].abs(), ay[i].abs(), bx[i].abs(), by[i].abs()];
        let filled = area / larger((ax + bx) * (ay + by), 0.01);
        let longer = ACROSS.0 + MORE * larger(smaller(filled, 1.0) - ACROSS.1, 0.0);
        let squares = ax * ax + ay * ay + bx * bx + by * by;
        let few = roundness_of_few_pixels(area, squares);
        let longer = longer / (1.0 + STEEP * larger(steepness(area, squares), few));
        let (wide, high) = (larger(larger(ax, bx), 1.0), larger(larger(ay, by), 1.0));
        // a footprint is at least a pixel thick
        let chord_x = larger(smaller(larger(area, wide) / high, wide), 1.0);
        let chord_y = larger(smaller(larger(area, high) / wide, high), 1.0);
        let target = |chord: f32, other: f32, shortest: f32| {
            let single = longer * larger(SINGLE / (other * other.sqrt()), shortest);
            larger(smaller(chord, (single * chord).sqrt()), 1.0)
        };
        let log = |target: f32| {
            let rounded = if target * UP < 4.0 { target * UP_TO_TWO } else { target * UP };
            floor_log2(larger(rounded, 1.0))
        };
        let box_x = power(log(target(chord_x, chord_y, SHORTEST[0])));
        let box_y = power(log(target(chord_y, chord_x, SHORTEST[1])));
        let (at_least_along, at_least_down) = (0.5 + 0.25 * few, 0.75);
        let probes = |x: f32, y: f32| {
            let (x, y) = (x / box_x, y / box_y);
            // a side across the pixels is as long as that, not as its longer component
            let across = (x * x + y * y).sqrt() + at_least_along;
            smaller(larger(larger(across, y + at_least_down), 1.0), MAX_PROBES) as i32
        };
        let (along, down) = (probes(ax, ay), probes(bx, by));
        // the boxes that fit what the lattice leaves between its probes
        let left = |a: f32, b: f32| larger(larger(a / along as f32, b / down as f32), 1.0);
        let kx = floor_log2(left(ax, bx) * UP_LEFT).min(largest[0]);
        let ky = floor_log2(left(ay, by) * UP_LEFT).min(largest[1]);
        patterns[i] = kx | ky << 8 | (along as u32) << 16 | (down as u32) << 24;
    }
}

/// Footprints of no more than so many pixels are treated apart, by [`roundness_of_few_pixels`].
const SMALL: f32 = 16.0;

/// From 0, the footprint is a sliver or a few pixels, to 1, it is about as wide as it is long; `squares` is the sum of its
/// sides' squares.
///
/// A square cell that is seen at an angle e to the road has `2 area / squares` of `2 sin(e) / (1 + sin(e)^2)`: this is from
/// 13 to 19 degrees. The cells of a camera that looks ahead over the hood are all below.
#[inline(always)]
pub(super) fn steepness(area: f32, squares: f32) -> f32 {
    let round = 2.0 * area / larger(squares, 0.01);
    if area > SMALL { smaller(larger((round - 0.45) * (1.0 / 0.15), 0.0), 1.0) } else { 0.0 }
}

/// From 0 to 1: whether the footprint is only a few pixels and no sliver. Each of its pixels then needs a probe of its own:
/// on white noise one probe into a box of 4 pixels misses the mean of 4 x 4 by up to half its deviation, 16 probes into the
/// image by 3 %. It costs the views of a camera that looks ahead nothing: what they see so small are slivers.
#[inline(always)]
fn roundness_of_few_pixels(area: f32, squares: f32) -> f32 {
    let round = 2.0 * area / larger(squares, 0.01);
    if area > SMALL { 0.0 } else { smaller(larger((round - 0.6) * (1.0 / 0.15), 0.0), 1.0) }
}

// Plain comparisons: f32::max and min handle NaN, which blocks vectorisation.

#[inline(always)]
pub(super) fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[inline(always)]
pub(super) fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The whole part of log2 of a number of at least 1, at most [`MAX_LOG`].
#[inline(always)]
fn floor_log2(number: f32) -> u32 {
    (number.to_bits() >> 23).wrapping_sub(127).min(MAX_LOG)
}

/// `2^log`.
#[inline(always)]
pub(super) fn power(log: u32) -> f32 {
    f32::from_bits((log + 127) << 23)
}
