//! Lattices drawn in, so that boxes do not blur over the edge of the footprint.

use super::block_sides::BATCH;
use super::choose_samples::{larger, power, smaller};
use crate::isa::Isa;
use crate::isa::for_each_isa;

/// What footprints are multiplied with: (x, y) becomes `(xx x, yx x + yy y)`.
pub(super) struct VarianceMatch {
    pub(super) xx: [f32; BATCH],
    pub(super) yx: [f32; BATCH],
    pub(super) yy: [f32; BATCH],
}

impl VarianceMatch {
    /// The factors for footprints whose sides are (x, y) along and (x, y) down, in pixels, sampled by these patterns.
    pub(super) fn new(isa: Isa, sides: &[[f32; BATCH]; 4], patterns: &[u32; BATCH]) -> Self {
        let mut into = Self { xx: [1.0; BATCH], yx: [0.0; BATCH], yy: [1.0; BATCH] };
        let (sides, patterns) = (sides.each_ref().map(|side| &side[..]), &patterns[..]);
        let columns = [&mut into.xx[..], &mut into.yx, &mut into.yy];
        for_each_isa!(isa, (find, find, find)(sides: [&[f32]; 4], patterns: &[u32], columns: [&mut [f32]; 3]));
        into
    }
}

/// A box at every probe makes the average wider than the lattice is. The lattice is drawn in so far that variances and
/// covariance of the whole are those of the footprint: a triangular matrix takes the lattice's root to that of what boxes
/// leave. A lattice of one row has no such root and is scaled along itself.
#[inline(always)]
fn find(sides: [&[f32]; 4], patterns: &[u32], into: [&mut [f32]; 3]) {
    /// How much of the bilinear tap between boxes counts as width. All of it would be right for coarse patterns and too
    /// sharp a cut for those of a few pixels: near cells of 20 cm lose 0.3 dB, turned ones 0.25 dB.
    const TAP: f32 = 0.7;
    /// Lattices are not drawn in or out by more than this.
    const LIMITS: (f32, f32) = (0.5, 1.1);
    let count = patterns.len();
    let [ax, ay, bx, by] = sides.map(|side| &side[..count]);
    let [xx, yx, yy] = into.map(|column| &mut column[..count]);
    for i in 0..count {
        let ([ax, ay, bx, by], [kx, ky, along, down]) = ([ax[i], ay[i], bx[i], by[i]], u32::to_le_bytes(patterns[i]));
        // everything is 12 times the variance, in which the square of a side is 1 of a uniform footprint
        let of_box = |k: u8| if k > 0 { power(2 * u32::from(k)) * (1.0 + 0.5 * TAP) } else { 2.0 * TAP };
        let (box_x, box_y) = (of_box(kx), of_box(ky));
        let of_lattice = |count: u8| 1.0 - 1.0 / (f32::from(count) * f32::from(count));
        let (wa, wb) = (of_lattice(along), of_lattice(down));
        let limited = |new: f32, old: f32| smaller(larger(new, LIMITS.0 * old), LIMITS.1 * old);
        // of less than a pixel nothing can be known
        let root_x = larger(ax * ax * wa + bx * bx * wb, 1.0).sqrt();
        let root_xy = (ax * ay * wa + bx * by * wb) / root_x;
        let root_y = larger(ay * ay * wa + by * by * wb - root_xy * root_xy, 1.0).sqrt();
        let new_x = limited(larger(ax * ax + bx * bx - box_x, 0.0).sqrt(), root_x);
        let new_xy = (ax * ay + bx * by) / new_x;
        let new_y = limited(larger(ay * ay + by * by - box_y - new_xy * new_xy, 0.0).sqrt(), root_y);
        let (scale_x, scale_y) = (new_x / root_x, new_y / root_y);
        let shear = smaller(larger((new_xy - scale_y * root_xy) / root_x, -1.0), 1.0);
        // of a row of probes
        let (x, y) = if down == 1 { (ax, ay) } else { (bx, by) };
        let length = larger(x * x + y * y, 1.0);
        let left = larger(length - (x * x * box_x + y * y * box_y) / length, 0.0);
        let row = limited((left / (length * larger(larger(wa, wb), 0.1))).sqrt(), 1.0);
        let is_row = (along == 1) | (down == 1);
        xx[i] = if is_row { row } else { scale_x };
        yx[i] = if is_row { 0.0 } else { shear };
        yy[i] = if is_row { row } else { scale_y };
    }
}
