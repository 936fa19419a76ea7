//! Coordinates to taps.

use std::mem::MaybeUninit;
use std::ops::Range;

use super::runs::equal_prefix;
use crate::error::Result;
use crate::isa::{Isa, for_each_isa};
use crate::table::{ONE, SpanKind, Tap};
use crate::view::buffer;

/// The coordinates of a row on a source: `us[i]` and `vs[i]` in pixels, NaN where there is none.
#[derive(Clone, Copy)]
pub(crate) struct Sampled<'a> {
    pub(crate) us: &'a [f64],
    pub(crate) vs: &'a [f64],
    /// Width and height.
    pub(crate) source: (u32, u32),
}

impl Sampled<'_> {
    /// These cells without those outside at either end, as far as a few: a row that begins with a tap need not be moved.
    pub(crate) fn trimmed(&self, cells: Range<usize>) -> Range<usize> {
        /// Cells at either end. Windows have up to nine more than they need.
        const FEW: usize = 16;
        let sides = self.sides();
        let outside = |&cell: &usize| !is_near((self.us[cell], self.vs[cell]), sides);
        let start = cells.start + cells.clone().take(FEW).take_while(outside).count();
        let rest = start..cells.end;
        start..cells.end - rest.rev().take(FEW).take_while(outside).count()
    }

    /// Width and height.
    fn sides(&self) -> (f64, f64) {
        (f64::from(self.source.0), f64::from(self.source.1))
    }
}

/// Whether a coordinate is less than a pixel outside the rectangle of pixel centres, or on it; NaN is not.
#[inline(always)]
fn is_near((u, v): (f64, f64), (width, height): (f64, f64)) -> bool {
    (u > -1.0) & (u < width) & (v > -1.0) & (v < height)
}

/// What each cell of a row is.
#[derive(Default)]
pub(crate) struct Kinds {
    kinds: Vec<u8>,
}

impl Kinds {
    /// Writes the taps of all cells as if all were inside, and tells the kind and the cells of each run from left to right.
    pub(crate) fn quantise<'a>(
        &'a mut self,
        isa: Isa,
        row: Sampled<'a>,
        taps: &mut [MaybeUninit<Tap>],
    ) -> Result<impl Iterator<Item = (SpanKind, Range<usize>)> + use<'a>> {
        buffer::resize("Lut", &mut self.kinds, row.us.len(), 0)?;
        let kinds = &mut self.kinds[..];
        // SAFETY: a tap is 8 bytes with the alignment of a number, any bits are one, and only numbers are written.
        let taps = unsafe { std::slice::from_raw_parts_mut(taps.as_mut_ptr().cast::<MaybeUninit<u64>>(), taps.len()) };
        let mut all_inside = true;
        quantise_inside(isa, row, taps, kinds, &mut all_inside);
        Ok(runs(isa, row, kinds, all_inside))
    }

    /// The spans of a row without taps, for coordinates that are not rounded: inside is all that lies before the last
    /// pixel.
    pub(crate) fn sort<'a>(
        &'a mut self,
        isa: Isa,
        row: Sampled<'a>,
    ) -> Result<impl Iterator<Item = (SpanKind, Range<usize>)> + use<'a>> {
        buffer::resize("Lut", &mut self.kinds, row.us.len(), 0)?;
        let kinds = &mut self.kinds[..];
        let mut all_inside = true;
        sort_inside(isa, row, kinds, &mut all_inside);
        Ok(runs(isa, row, kinds, all_inside))
    }
}

/// The kind and the cells of each run, of which it is known so far whether cells are inside.
fn runs<'a>(
    isa: Isa,
    row: Sampled<'a>,
    kinds: &'a mut [u8],
    all_inside: bool,
) -> impl Iterator<Item = (SpanKind, Range<usize>)> + use<'a> {
    let cells = kinds.len();
    // most cells are inside; of the others it is found out what they are when their turn comes
    let (mut next, mut known) = (0, 0);
    std::iter::from_fn(move || {
        let first = next;
        if first == known {
            let inside = if all_inside { cells - first } else { equal_prefix(&kinds[first..], SpanKind::Inside as u8) };
            let end = first + inside;
            if end > first {
                (next, known) = (end, end);
                return Some((SpanKind::Inside, first..end));
            }
            known += equal_prefix(&kinds[first..], SpanKind::Outside as u8);
            let others = first..known;
            let others_of_row = Sampled { us: &row.us[others.clone()], vs: &row.vs[others.clone()], ..row };
            classify(isa, others_of_row, &mut kinds[others]);
        }
        let &kind = kinds[..known].get(first)?;
        next += equal_prefix(&kinds[first..known], kind);
        Some((SpanKind::from_byte(kind), first..next))
    })
}

fn sort_inside(isa: Isa, row: Sampled<'_>, kinds: &mut [u8], all: &mut bool) {
    for_each_isa!(isa, (inside_of_row, inside_of_row, inside_of_row)(
        row: Sampled<'_>, kinds: &mut [u8], all: &mut bool
    ));
}

fn quantise_inside(isa: Isa, row: Sampled<'_>, taps: &mut [MaybeUninit<u64>], kinds: &mut [u8], all: &mut bool) {
    for_each_isa!(isa, (taps_of_row, taps_of_row, super::avx512::taps_of_row)(
        row: Sampled<'_>, taps: &mut [MaybeUninit<u64>], kinds: &mut [u8], all: &mut bool
    ));
}

fn classify(isa: Isa, row: Sampled<'_>, kinds: &mut [u8]) {
    for_each_isa!(isa, (kinds_of_cells, kinds_of_cells, kinds_of_cells)(row: Sampled<'_>, kinds: &mut [u8]));
}

/// The taps of all cells, and [`SpanKind::Inside`] or else [`SpanKind::Outside`] for each; `all` stays true where all are
/// inside.
#[inline(always)]
pub(super) fn taps_of_row(row: Sampled<'_>, taps: &mut [MaybeUninit<u64>], kinds: &mut [u8], all: &mut bool) {
    let Sampled { us, vs, source: (width, height) } = row;
    let cells = us.len();
    let (vs, taps, kinds) = (&vs[..cells], &mut taps[..cells], &mut kinds[..cells]);
    let (last_u, last_v) = (last(width), last(height));
    let stride = u64::from(width);
    let mut all_inside = true;
    // by index: of zipped iterators the compiler makes no vectors
    for i in 0..cells {
        let (u, v) = (us[i], vs[i]);
        let inside = (u.to_bits() < last_u) & (v.to_bits() < last_v);
        // elsewhere the tap is anything at all, and not used
        let ((x, fx), (y, fy)) = (axis(u), axis(v));
        let offset = (y & LOW).wrapping_mul(stride).wrapping_add(x) & LOW;
        // in memory as the fields of `Tap`: offset, x, y
        taps[i].write(if cfg!(target_endian = "little") {
            offset | (fx & 0xffff) << 32 | fy << 48
        } else {
            offset << 32 | (fx & 0xffff) << 16 | fy & 0xffff
        });
        kinds[i] = u8::from(inside);
        all_inside &= inside;
    }
    *all &= all_inside;
}

/// [`SpanKind::Inside`] or else [`SpanKind::Outside`] for each cell, as [`taps_of_row`] tells it of coordinates that are
/// not rounded.
#[inline(always)]
fn inside_of_row(row: Sampled<'_>, kinds: &mut [u8], all: &mut bool) {
    let Sampled { us, vs, source: (width, height) } = row;
    let cells = us.len();
    let (vs, kinds) = (&vs[..cells], &mut kinds[..cells]);
    let last = |side: u32| (f64::from(side) - 1.0).to_bits();
    let (last_u, last_v) = (last(width), last(height));
    let mut all_inside = true;
    for i in 0..cells {
        let inside = (us[i].to_bits() < last_u) & (vs[i].to_bits() < last_v);
        kinds[i] = u8::from(inside);
        all_inside &= inside;
    }
    *all &= all_inside;
}

/// What cells are that [`taps_of_row`] or [`inside_of_row`] did not find inside.
#[inline(always)]
fn kinds_of_cells(row: Sampled<'_>, kinds: &mut [u8]) {
    let Sampled { us, vs, .. } = row;
    let cells = us.len();
    let (vs, kinds) = (&vs[..cells], &mut kinds[..cells]);
    let (w, h) = row.sides();
    for i in 0..cells {
        let (u, v) = (us[i], vs[i]);
        let near = is_near((u, v), (w, h));
        let valid = (u >= 0.0) & (v >= 0.0) & (u <= w - 1.0) & (v <= h - 1.0);
        // outside 0, rim 2, halo 3
        kinds[i] = u8::from(near) * (3 - u8::from(valid));
    }
}

/// The bits of the first coordinate that is not inside a side of so many pixels: within 2^-16 of the last pixel a
/// coordinate becomes that pixel, which has no next, so such cells are on the rim. The bits of a positive float64 grow with
/// it, and those of a negative one or of NaN are above them all.
pub(super) fn last(side: u32) -> u64 {
    (f64::from(side) - 1.0 - 1.0 / STEPS).max(0.0).to_bits()
}

const STEPS: f64 = ONE as f64;

/// The low half of a number.
pub(super) const LOW: u64 = 0xffff_ffff;

/// Bits of a coordinate below a Q15 step that are looked at for rounding.
pub(super) const BELOW: u32 = 5;

/// Added to a coordinate from 0 to 2^31, which is more than a source is wide, it leaves the coordinate in 2^-20 pixels in
/// the low bits, and half a step of Q15 more, so that dropping [`BELOW`] bits rounds to the nearest step.
pub(super) const FIXED: f64 = (1u64 << (52 - 15 - BELOW)) as f64 + 0.5 / STEPS;

/// Added to a float64 of less than 2^50, it leaves the nearest whole number, halves to even, in the low bits.
pub(super) const WHOLE: f64 = 1.5 * (1u64 << 52) as f64;

/// The whole pixel at or before a coordinate that is not negative, in the low 32 bits, and in the low 16 of the other its
/// Q15 fraction, plus 32768 where the nearest pixel is the next one. Within 2^-16 of the next pixel the coordinate is
/// that pixel.
///
/// The integers are sums of float64: with floors, taps of the seed job took 0.19 ms instead of 0.11, and 2.5 ms instead of
/// 1.0 without vectors.
#[inline(always)]
fn axis(coordinate: f64) -> (u64, u64) {
    split(coordinate + FIXED, coordinate + WHOLE)
}

/// [`axis`] from the coordinate, or one that is an even number of pixels further, in steps, and from the nearest pixel.
#[inline(always)]
fn split(fixed: f64, nearest: f64) -> (u64, u64) {
    let (steps, pixel) = (fixed.to_bits() >> BELOW, fixed.to_bits() >> (BELOW + 15));
    // the nearest is this pixel or the next: one bit tells which
    (pixel, steps ^ nearest.to_bits() << 15)
}

/// The whole pixel at or before a coordinate above -1, and the packed fraction.
pub(crate) fn quantise_one(coordinate: f64) -> (i64, u16) {
    let moved = if coordinate < 0.0 { 2.0 } else { 0.0 };
    let (pixel, fraction) = split(coordinate + moved + FIXED, coordinate + WHOLE);
    ((pixel & LOW) as i64 - moved as i64, fraction as u16)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn taps_hold_the_pixel_the_fraction_and_the_step_to_the_nearest() {
        // as far as a source may reach, and around whole pixels, halves and halves of a step
        let whole = [0.0, 1.0, 2.0, 1079.0, 65_535.0, 65_536.0, 1_048_575.0, 1_400_000_000.0];
        let parts = [0.0, 0.25, 0.5, 0.75, 0.5 / STEPS, 1.5 / STEPS, 1.0 - 0.5 / STEPS, 1.0 - 1.0 / STEPS];
        let nudges = [-1e-9, 0.0, 1e-9, 1e-6, 0.125];
        let mut coordinates = vec![];
        for at in whole {
            for part in parts {
                coordinates.extend(nudges.map(|nudge| at + part + nudge).into_iter().filter(|&u| u >= 0.0));
            }
        }
        let vs = vec![0.75; coordinates.len()];
        let source = (1_431_655_760, 2);
        for &isa in Isa::available() {
            let mut taps = vec![MaybeUninit::new(Tap::default()); coordinates.len()];
            let row = Sampled { us: &coordinates, vs: &vs, source };
            let mut scratch = Kinds::default();
            let runs: Vec<_> = scratch.quantise(isa, row, &mut taps).unwrap().collect();
            // rows of so wide sources have rims only below
            assert_eq!(runs, [(SpanKind::Inside, 0..coordinates.len())]);
            for (u, tap) in coordinates.iter().zip(&taps) {
                // SAFETY: it was made from a tap, and only taps are written.
                let tap = unsafe { tap.assume_init() };
                let (pixel, packed) = quantise_one(*u);
                assert_eq!((i64::from(tap.offset), tap.x, tap.y), (pixel, packed, 0xe000), "{isa:?} {u}");
                let at = f64::from(tap.offset) + f64::from(tap.fx()) / STEPS;
                assert!((at - u).abs() <= 0.516 / STEPS, "{isa:?} {u} {at}");
                assert_eq!(f64::from(tap.offset + tap.step_x()), u.round_ties_even(), "{isa:?} {u}");
            }
        }
    }

    #[test]
    fn zeros_of_both_signs_and_what_is_no_number_are_sorted_out() {
        let us = [0.0, -0.0, -1e-300, 1e-300, f64::NAN, -f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 2.5];
        for &isa in Isa::available() {
            let (vs, mut taps) = ([0.5; 9], [MaybeUninit::uninit(); 9]);
            let row = Sampled { us: &us, vs: &vs, source: (4, 3) };
            let mut scratch = Kinds::default();
            let mut kinds = vec![];
            for (kind, cells) in scratch.quantise(isa, row, &mut taps).unwrap() {
                kinds.extend(cells.map(|_| kind));
            }
            use SpanKind::{Halo, Inside, Outside, Rim};
            // -0.0 is on the image; that it is on the rim costs nothing
            let expected = [Inside, Rim, Halo, Inside, Outside, Outside, Outside, Outside, Inside];
            assert_eq!(kinds, expected, "{isa:?}");
        }
    }
}
