//! Coordinates to taps by hand, for CPUs with AVX-512: eight cells at a time.

use std::arch::x86_64::*;
use std::mem::MaybeUninit;

use crate::kernels::Sampled;
use crate::kernels::rounding::{self, BELOW, FIXED, WHOLE, last};

/// A control of `vpmultishiftqb` that lays eight bits from each of these on into a byte, the lowest byte first. 0 is for
/// bytes that are not looked at.
const fn bits_from(at: [u32; 8]) -> i64 {
    let mut control = 0;
    let mut byte = 0;
    while byte < 8 {
        control |= (at[byte] as i64) << (8 * byte);
        byte += 1;
    }
    control
}

/// Where the Q15 fraction begins in what [`FIXED`] makes of a coordinate, and where the whole pixel does.
const FRACTION: u32 = BELOW;
const PIXEL: u32 = BELOW + 15;

/// As [`rounding::taps_of_row`].
///
/// A byte of a number may begin at any of its bits here, so that one instruction takes pixel and fraction out of a
/// coordinate and puts them where a tap has them: half the time of the shifts and masks that the plain loop needs.
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
pub(in crate::kernels) fn taps_of_row(
    row: Sampled<'_>,
    taps: &mut [MaybeUninit<u64>],
    kinds: &mut [u8],
    all: &mut bool,
) {
    let Sampled { us, vs, source: (width, height) } = row;
    let cells = us.len();
    let number = |bits: u64| _mm512_set1_epi64(bits as i64);
    let (fixed, whole) = (_mm512_set1_pd(FIXED), _mm512_set1_pd(WHOLE));
    let (last_u, last_v, stride) = (number(last(width)), number(last(height)), number(width.into()));
    let pixel = [PIXEL, PIXEL + 8, PIXEL + 16, PIXEL + 24];
    let [p0, p1, p2, p3] = pixel;
    let of_u = _mm512_set1_epi64(bits_from([p0, p1, p2, p3, FRACTION, FRACTION + 8, 0, 0]));
    let of_v = _mm512_set1_epi64(bits_from([p0, p1, p2, p3, 0, 0, FRACTION, FRACTION + 8]));
    let (step_of_x, y) = (number(1 << 47), number(0xffff << 48));
    let (us_by_8, us) = us.as_chunks::<8>();
    let (vs_by_8, vs) = vs[..cells].as_chunks::<8>();
    let (taps_by_8, taps) = taps[..cells].as_chunks_mut::<8>();
    let (kinds_by_8, kinds) = kinds[..cells].as_chunks_mut::<8>();
    let mut all_inside = 0xff;
    for (((us, vs), taps), kinds) in us_by_8.iter().zip(vs_by_8).zip(taps_by_8).zip(kinds_by_8) {
        // SAFETY: eight numbers of eight bytes each; the loads need no alignment.
        let (u, v) = unsafe { (_mm512_loadu_pd(us.as_ptr()), _mm512_loadu_pd(vs.as_ptr())) };
        let inside = _mm512_cmplt_epu64_mask(_mm512_castpd_si512(u), last_u);
        let inside = _mm512_mask_cmplt_epu64_mask(inside, _mm512_castpd_si512(v), last_v);
        all_inside &= inside;
        let parts = |coordinate, control| {
            let fixed = _mm512_castpd_si512(_mm512_add_pd(coordinate, fixed));
            let nearest = _mm512_castpd_si512(_mm512_add_pd(coordinate, whole));
            (_mm512_multishift_epi64_epi8(control, fixed), nearest)
        };
        let ((x, nearest_x), (y_and_row, nearest_y)) = (parts(u, of_u), parts(v, of_v));
        // the top bit of a fraction is the pixel's last bit, to which that of the nearest pixel is added
        let x = _mm512_ternarylogic_epi64::<{ A ^ B & C }>(x, _mm512_slli_epi64::<47>(nearest_x), step_of_x);
        let offset_and_x = _mm512_add_epi32(x, _mm512_mul_epu32(y_and_row, stride));
        let y_of_tap = _mm512_xor_si512(y_and_row, _mm512_slli_epi64::<63>(nearest_y));
        let tap = _mm512_ternarylogic_epi64::<{ A & B | !A & C & 0xff }>(y, y_of_tap, offset_and_x);
        // SAFETY: eight taps of eight bytes each, and any bits are one.
        unsafe { _mm512_storeu_si512(taps.as_mut_ptr().cast(), tap) };
        // SAFETY: eight kinds of a byte each; the store writes the lower eight bytes.
        unsafe { _mm_storel_epi64(kinds.as_mut_ptr().cast(), _mm_maskz_set1_epi8(inside.into(), 1)) };
    }
    rounding::taps_of_row(Sampled { us, vs, ..row }, taps, kinds, all);
    *all &= all_inside == 0xff;
}

/// The three inputs of `vpternlogq`: what is made of them is its truth table.
const A: i32 = 0xf0;
const B: i32 = 0xcc;
const C: i32 = 0xaa;
