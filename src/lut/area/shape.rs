//! How a footprint is averaged: which lattice of probes, over which boxes.

use super::{MAX_PROBES, Q};

/// Boxes have at most `2^MAX_LOG` pixels a side.
const MAX_LOG: u32 = 6;

/// A lattice of `along x down` probes, each over a box of `2^kx x 2^ky` pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct Shape {
    pub(crate) kx: u8,
    pub(crate) ky: u8,
    /// Probes along the side of the footprint that follows the output's row, and along the one down its columns.
    pub(crate) along: u8,
    pub(crate) down: u8,
}

impl Shape {
    /// Plain bilinear: the footprint is no larger than a pixel.
    pub(crate) const BILINEAR: Self = Self { kx: 0, ky: 0, along: 1, down: 1 };

    /// The shape for a footprint with sides `along` and `down`, in 1/1024 pixel, on a source of `(width, height)`.
    ///
    /// Boxes must fit into the parallelogram, or they blur across it, and probes must lie no further apart than boxes
    /// are large, or pixels between them are missed. So boxes are a part of the chords through the middle of the
    /// footprint, and the sides are divided by what is left of them: all of it in units of boxes. Large footprints get
    /// more boxes to a chord, by the root of its length: there the result is so good that the box's corners show.
    #[inline]
    pub(crate) fn choose(along: [i32; 2], down: [i32; 2], (width, height): (u32, u32)) -> Self {
        /// Chords in pixels of which a box is as long as the chord.
        const SINGLE: [f32; 2] = [2.0, 0.7];
        /// Of a step between two sizes of boxes, how much is rounded up.
        const UP: f32 = 1.32; // 2^0.4
        let pixels = |value: i32| value as f32 * (1.0 / (1 << Q) as f32);
        let [[ax, ay], [bx, by]] = [along, down].map(|side| side.map(pixels));
        let area = (ax * by - ay * bx).abs();
        let [ax, ay, bx, by] = [ax, ay, bx, by].map(f32::abs);
        let (wide, high) = (ax.max(bx).max(1.0), ay.max(by).max(1.0));
        // chords through the middle; a footprint is at least a pixel thick
        let chord = [(area.max(wide) / high).clamp(1.0, wide), (area.max(high) / wide).clamp(1.0, high)];
        let target = |axis: usize| chord[axis].min((SINGLE[axis] * chord[axis]).sqrt()).max(1.0);
        let [kx, ky] = [0, 1].map(|axis| floor_log2(target(axis) * UP));
        let (box_x, box_y) = ((1u32 << kx) as f32, (1u32 << ky) as f32);
        let probes = |x: f32, y: f32| ((x / box_x + 0.5).max(y / box_y + 0.85) as i32).clamp(1, MAX_PROBES);
        let (along, down) = (probes(ax, ay), probes(bx, by));
        // the boxes that fit what the lattice leaves between its probes
        let left = |a: f32, b: f32| (a / along as f32).max(b / down as f32).max(1.0);
        let largest = |size: u32| if size < 4 { 0 } else { (size - 1).ilog2() - 1 };
        Self {
            kx: floor_log2(left(ax, bx) * UP).min(largest(width)) as u8,
            ky: floor_log2(left(ay, by) * UP).min(largest(height)) as u8,
            along: along as u8,
            down: down as u8,
        }
    }

    /// The offset of probe `index` of `count` along a side of length 1, in 1/16384.
    #[inline]
    pub(crate) fn offset(index: u8, count: u8) -> i32 {
        let (index, count) = (i32::from(index), i32::from(count));
        ((2 * index + 1 - count) << 13) / count
    }

    /// Columns and rows of a box.
    pub(crate) fn box_size(self) -> (u32, u32) {
        (1 << self.kx, 1 << self.ky)
    }

    /// Probes of a footprint.
    pub(crate) fn probes(self) -> u32 {
        u32::from(self.along) * u32::from(self.down)
    }

    /// How many times pixels were averaged by twos.
    pub(crate) fn halvings(self) -> u32 {
        u32::from(self.kx) + u32::from(self.ky)
    }
}

/// The whole part of log2 of a number of at least 1, at most [`MAX_LOG`].
#[inline(always)]
fn floor_log2(number: f32) -> u32 {
    ((number.to_bits() >> 23).wrapping_sub(127)).min(MAX_LOG)
}
