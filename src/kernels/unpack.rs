//! Where taps sample, as whole numbers.

use crate::isa::{Isa, for_each_isa};
use crate::table::Tap;

/// Unpacked coordinates are in 1/1024 pixel.
pub(crate) const FRACTION_BITS: u32 = 10;

/// So many taps at once.
const LANES: usize = 16;

/// Columns and rows, in 1/1024 pixel, of taps that count as [`SpanKind::Inside`](crate::table::SpanKind) says on a source
/// of this width. Its sides have fewer than 2^20 pixels.
pub(crate) fn unpack(isa: Isa, taps: &[Tap], width: u32, xs: &mut [i32], ys: &mut [i32]) {
    for_each_isa!(isa, (body, body, body)(taps: &[Tap], width: u32, xs: &mut [i32], ys: &mut [i32]));
}

#[inline(always)]
fn body(taps: &[Tap], width: u32, xs: &mut [i32], ys: &mut [i32]) {
    let cells = taps.len();
    // SAFETY: a tap is an offset of 4 bytes, then 4 bytes of fractions, and aligned for such numbers.
    let taps = unsafe { std::slice::from_raw_parts(taps.as_ptr().cast::<[u32; 2]>(), cells) };
    let (xs, ys) = (&mut xs[..cells], &mut ys[..cells]);
    if cells < LANES {
        return some(taps, width, xs, ys);
    }
    for first in (0..cells).step_by(LANES) {
        // the last ones reach back to be as many as the others
        let own = first.min(cells - LANES)..first.min(cells - LANES) + LANES;
        some(&taps[own.clone()], width, &mut xs[own.clone()], &mut ys[own]);
    }
}

#[inline(always)]
fn some(taps: &[[u32; 2]], width: u32, xs: &mut [i32], ys: &mut [i32]) {
    /// Added to a float32 of at most 2^22, it leaves the nearest whole number in the low bits.
    const WHOLE: f32 = (1 << 23) as f32;
    let inverse_width = 1.0 / width as f32;
    let (xs, ys) = (&mut xs[..taps.len()], &mut ys[..taps.len()]);
    for i in 0..taps.len() {
        let [offset, fractions] = taps[i];
        // Three roundings, of 2^-24 each, of a row below 2^20: less than 0.2 off, so it is the row or the one below.
        let row = (offset as f32 * inverse_width + WHOLE).to_bits() - WHOLE.to_bits();
        let column = offset.wrapping_sub(row * width) as i32;
        // all bits where it is the one below
        let beyond = column >> 31;
        let (row, column) = (row as i32 + beyond, column + (width as i32 & beyond));
        let (fx, fy) =
            if cfg!(target_endian = "little") { (fractions, fractions >> 16) } else { (fractions >> 16, fractions) };
        // fractions have 15 bits
        let fixed = |whole: i32, fraction: u32| {
            whole << FRACTION_BITS | (fraction >> (15 - FRACTION_BITS) & ((1 << FRACTION_BITS) - 1)) as i32
        };
        xs[i] = fixed(column, fx);
        ys[i] = fixed(row, fy);
    }
}
