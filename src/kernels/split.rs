//! Coordinates to pixels and exact fractions, for warps that keep no table.

use super::rounding::{LOW, WHOLE};
use crate::isa::{self, Body, Isa};
use crate::table::Tap;

/// How far a coordinate is beyond its pixel, from 0 to 1.
pub(crate) trait Fraction: Copy + Default + PartialEq + Send + Sync {
    /// The nearest number of this kind.
    fn of(fraction: f64) -> Self;
}

impl Fraction for f32 {
    #[inline(always)]
    fn of(fraction: f64) -> Self {
        fraction as Self
    }
}

impl Fraction for f64 {
    #[inline(always)]
    fn of(fraction: f64) -> Self {
        fraction
    }
}

/// The top-left pixels of neighbouring cells inside a source of this width, as the offsets of `taps`, and how far beyond
/// them the coordinates are, in `x` and `y`. The taps have no fractions of their own.
pub(crate) fn split<F: Fraction>(
    isa: Isa,
    [us, vs]: [&[f64]; 2],
    width: usize,
    taps: &mut [Tap],
    [x, y]: [&mut [F]; 2],
) {
    // SAFETY: a tap is 8 bytes with the alignment of a number, and any bits are one.
    let taps = unsafe { std::slice::from_raw_parts_mut(taps.as_mut_ptr().cast::<u64>(), taps.len()) };
    isa::run(isa, Split { us, vs, width: width as u64, taps, x, y });
}

struct Split<'a, F> {
    us: &'a [f64],
    vs: &'a [f64],
    width: u64,
    taps: &'a mut [u64],
    x: &'a mut [F],
    y: &'a mut [F],
}

impl<F: Fraction> Body for Split<'_, F> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let cells = self.us.len();
        let (us, vs, taps) = (self.us, &self.vs[..cells], &mut self.taps[..cells]);
        let (x, y) = (&mut self.x[..cells], &mut self.y[..cells]);
        // by index: of zipped iterators the compiler makes no vectors
        for i in 0..cells {
            let ((column, fx), (row, fy)) = (axis(us[i]), axis(vs[i]));
            let offset = row.wrapping_mul(self.width).wrapping_add(column) & LOW;
            taps[i] = if cfg!(target_endian = "little") { offset } else { offset << 32 };
            (x[i], y[i]) = (F::of(fx), F::of(fy));
        }
    }
}

/// The whole pixel at or before a coordinate from 0 to 2^31, and what is left. Sums of float64 find it, because the
/// baseline of x86-64 has no floor.
#[inline(always)]
fn axis(coordinate: f64) -> (u64, f64) {
    let nearest = coordinate + WHOLE;
    let before = if nearest - WHOLE > coordinate { nearest - 1.0 } else { nearest };
    (before.to_bits() & LOW, coordinate - (before - WHOLE))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_and_what_is_left() {
        let whole = [0.0, 1.0, 2.0, 3.0, 1079.0, 65_535.0, 1_400_000_000.0];
        let parts = [0.0, 1e-7, 0.25, 0.5, 0.5 + 1e-7, 0.75, 1.0 - 1e-7];
        let us: Vec<f64> = whole.iter().flat_map(|at| parts.map(|part| at + part)).collect();
        let vs: Vec<f64> = us.iter().map(|u| u.fract() + 1.0).collect();
        for &isa in Isa::available() {
            let mut taps = vec![Tap::default(); us.len()];
            let (mut x, mut y) = (vec![0f64; us.len()], vec![0f64; us.len()]);
            split(isa, [&us, &vs], 7, &mut taps, [&mut x, &mut y]);
            for (i, (&u, &v)) in us.iter().zip(&vs).enumerate() {
                assert_eq!(taps[i].offset, v.floor() as u32 * 7 + u.floor() as u32, "{isa:?} ({u}, {v})");
                assert_eq!((x[i], y[i]), (u - u.floor(), v - v.floor()), "{isa:?} ({u}, {v})");
                assert_eq!((taps[i].fx(), taps[i].fy()), (0, 0));
            }
        }
    }
}
