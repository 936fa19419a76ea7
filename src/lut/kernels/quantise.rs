//! Coordinates to taps.

use std::ops::Range;

use super::for_each_isa;
use crate::cpu::Isa;
use crate::lut::table::{ONE, RunKind, Tap};

/// Added to a float64 from 0 to 2^52, it leaves the whole part, rounded to even, in the low bits.
const WHOLE: f64 = (1u64 << 52) as f64;

/// What each cell of a row is.
#[derive(Default)]
pub(crate) struct Kinds {
    kinds: Vec<u8>,
}

impl Kinds {
    /// The kind and the cells of each run, from left to right.
    pub(crate) fn runs(&self) -> impl Iterator<Item = (RunKind, Range<usize>)> {
        let mut next = 0;
        std::iter::from_fn(move || {
            let first = next;
            let &kind = self.kinds.get(first)?;
            next += equal_prefix(&self.kinds[first..], kind);
            Some((RunKind::from_byte(kind), first..next))
        })
    }
}

/// Works out the cells that sample at (us[i], vs[i]): what they are, and their taps as if all were inside.
pub(crate) fn quantise(isa: Isa, us: &[f64], vs: &[f64], source: (u32, u32), taps: &mut [Tap], kinds: &mut Kinds) {
    kinds.kinds.resize(us.len(), 0);
    let kinds = &mut kinds.kinds[..];
    // SAFETY: a tap is 8 bytes with the alignment of a number, and any bits are one.
    let taps = unsafe { std::slice::from_raw_parts_mut(taps.as_mut_ptr().cast::<u64>(), taps.len()) };
    for_each_isa!(isa, body(us: &[f64], vs: &[f64], source: (u32, u32), taps: &mut [u64], kinds: &mut [u8]));
}

/// How many entries at the start of `kinds` are `kind`.
fn equal_prefix(kinds: &[u8], kind: u8) -> usize {
    let word = [kind; 16];
    let words = kinds.as_chunks::<16>().0.iter().take_while(|&&sixteen| sixteen == word).count();
    16 * words + kinds[16 * words..].iter().take_while(|&&entry| entry == kind).count()
}

#[inline(always)]
fn body(us: &[f64], vs: &[f64], source: (u32, u32), taps: &mut [u64], kinds: &mut [u8]) {
    let cells = us.len();
    let (vs, taps, kinds) = (&vs[..cells], &mut taps[..cells], &mut kinds[..cells]);
    // by index: of four zipped iterators the compiler makes no vectors
    for i in 0..cells {
        (taps[i], kinds[i]) = cell(us[i], vs[i], source);
    }
}

/// One coordinate: its tap and its kind.
#[inline(always)]
fn cell(u: f64, v: f64, (width, height): (u32, u32)) -> (u64, u8) {
    let (w, h) = (f64::from(width), f64::from(height));
    let near = (u > -1.0) & (u < w) & (v > -1.0) & (v < h); // NaN is not
    let valid = (u >= 0.0) & (v >= 0.0) & (u <= w - 1.0) & (v <= h - 1.0);
    // elsewhere these are anything at all, also where u or v is NaN, and never used; so is the offset in the halo
    let (x, fx) = axis(u);
    let (y, fy) = axis(v);
    let inside = valid & (x <= w - 2.0) & (y <= h - 2.0);
    let offset = (y * w + x + WHOLE).to_bits() & 0xffff_ffff;
    let fractions = (fx + fy * 65536.0 + WHOLE).to_bits() & 0xffff_ffff;
    // in memory as the fields of `Tap`: offset, x, y
    let tap = if cfg!(target_endian = "little") {
        offset | fractions << 32
    } else {
        offset << 32 | (fractions & 0xffff) << 16 | fractions >> 16
    };
    // outside 0, inside 1, rim 2, halo 3
    let kind = u8::from(near) * (3 - u8::from(valid) - u8::from(inside));
    (tap, kind)
}

/// The whole pixel at or before a coordinate above -1, and the Q15 fraction, plus 32768 where the nearest pixel is the
/// next one. Within 2^-16 of the next pixel the coordinate is that pixel.
#[inline(always)]
fn axis(coordinate: f64) -> (f64, f64) {
    const STEPS: f64 = ONE as f64;
    // one pixel more than it is, so that it is positive, in steps, rounded half up
    let steps = floor(coordinate * STEPS + (STEPS + 0.5));
    let pixel = floor(steps * (1.0 / STEPS));
    let fraction = steps - pixel * STEPS;
    let nearest = (coordinate + 1.5 * WHOLE) - 1.5 * WHOLE; // half to even, as np.round
    let whole = pixel - 1.0;
    (whole, fraction + (nearest - whole) * STEPS)
}

/// The floor of a number from 0 to 2^51, without an instruction for it.
#[inline(always)]
fn floor(number: f64) -> f64 {
    let rounded = (number + WHOLE) - WHOLE;
    rounded - if rounded > number { 1.0 } else { 0.0 }
}

/// The whole pixel and the packed fraction of one coordinate.
pub(crate) fn quantise_one(coordinate: f64) -> (i64, u16) {
    let (whole, fraction) = axis(coordinate);
    (whole as i64, fraction as u16)
}
