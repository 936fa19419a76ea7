//! Colour-coded depth to numbers and back.

use super::Body;
use crate::view::DepthSample;

/// Codes of one row to numbers: `code * scale`, rounded once to float32.
///
/// `BYTES` are 3 or 4 to a pixel; `RED_FIRST` says whether red, the least significant byte, is byte 0 or byte 2.
pub(in crate::cloud) struct Decode<'a, const BYTES: usize, const RED_FIRST: bool> {
    pub(in crate::cloud) pixels: &'a [u8],
    pub(in crate::cloud) scale: f64,
    pub(in crate::cloud) out: &'a mut [f32],
}

impl<const BYTES: usize, const RED_FIRST: bool> Body for Decode<'_, BYTES, RED_FIRST> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let pixels = self.pixels.as_chunks::<BYTES>().0;
        let count = self.out.len();
        let (pixels, out) = (&pixels[..count], &mut self.out[..count]);
        for i in 0..count {
            let pixel = pixels[i];
            let last = if BYTES == 4 { pixel[3] } else { 0 };
            // one load where there are four bytes
            let word = u32::from_le_bytes([pixel[0], pixel[1], pixel[2], last]);
            let code = if RED_FIRST { word & 0x00ff_ffff } else { word.swap_bytes() >> 8 };
            // by i32, which every instruction set converts
            out[i] = (f64::from(code as i32) * self.scale) as f32;
        }
    }
}

/// Numbers of one row to codes: `round(number * scale)`, halves to even, at most 2^24 - 1. Returns whether every
/// number was at least 0, which NaN is not.
pub(in crate::cloud) struct Encode<'a, T, const BYTES: usize, const RED_FIRST: bool> {
    pub(in crate::cloud) numbers: &'a [T],
    pub(in crate::cloud) scale: f64,
    pub(in crate::cloud) out: &'a mut [u8],
}

impl<T: DepthSample, const BYTES: usize, const RED_FIRST: bool> Body for Encode<'_, T, BYTES, RED_FIRST> {
    type Output = bool;

    #[inline(always)]
    fn run(self) -> bool {
        /// Added to a float64 from 0 to 2^52, it leaves the number, rounded to even, in the low bits.
        const WHOLE: f64 = (1u64 << 52) as f64;
        let out = self.out.as_chunks_mut::<BYTES>().0;
        let count = self.numbers.len();
        let (numbers, out) = (&self.numbers[..count], &mut out[..count]);
        let mut valid = true;
        for i in 0..count {
            let number = numbers[i].to_f64();
            valid &= number >= 0.0;
            let scaled = number * self.scale;
            let limited = if scaled < 16_777_215.0 { scaled } else { 16_777_215.0 };
            let code = (limited + WHOLE).to_bits() as u32;
            let word = if RED_FIRST { code & 0x00ff_ffff | 0xff00_0000 } else { (code << 8 | 0xff).swap_bytes() };
            out[i].copy_from_slice(&word.to_le_bytes()[..BYTES]);
        }
        valid
    }
}
