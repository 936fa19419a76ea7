//! Bilinear of 8-bit images.
//!
//! The exact sum of the scalar kernel: pixels are widened to 16 bits and multiplied by the Q15 weights, which fit 16 bits
//! without a sign (32768 too), into 32-bit lanes; a rounding shift by 15 narrows them back. With 3 and 4 channels a
//! vector is one cell, and its weights are lanes of vectors that hold those of eight cells.

use std::arch::aarch64::*;

use super::{Four, in_groups};
use crate::kernels::plane::Plane;
use crate::kernels::{Source, scalar};
use crate::table::Tap;

/// Cells whose four pixels exist, of an image of 1 to 4 channels.
///
/// # Safety
/// The CPU has NEON, and the taps are of a run that is inside.
#[target_feature(enable = "neon")]
pub(in crate::kernels) fn bilinear_u8<const CHANNELS: usize>(source: &Source<'_, u8>, taps: &[Tap], cells: &mut [u8]) {
    let Some(plane) = Plane::new(source).filter(|_| taps.len() >= 8) else {
        return scalar::bilinear::<u8, &[Tap], CHANNELS, false>(source, taps, cells);
    };
    let last = plane.limit(8) as isize;
    in_groups::<u8, 8>(taps, cells, CHANNELS, |_, taps, cells| {
        let (low, high) = halves(taps);
        let (low, high) = (Four::load(low), Four::load(high));
        let weights = Weights::new(low.fractions, high.fractions);
        let rows = plane.rows::<CHANNELS, 8>(taps);
        match CHANNELS {
            1 => blend_single(rows, &weights, cells),
            2 => blend_pairs(rows, &weights, cells),
            4 => store_four(blend::<4>(rows, &weights), cells),
            // beyond the two pixels of a row lie two bytes that the image may not have
            _ if highest::<CHANNELS>(&plane, &rows, vmaxq_u32(low.offsets, high.offsets)) as isize > last => {
                scalar::bilinear::<u8, &[Tap], CHANNELS, false>(source, taps, cells);
            }
            _ => store_three(blend::<3>(rows, &weights), cells),
        }
    });
}

/// Addresses of the two rows of each cell.
type Rows = [(*const u8, *const u8); 8];

fn halves(taps: &[Tap; 8]) -> (&[Tap; 4], &[Tap; 4]) {
    let (halves, _) = taps.as_chunks::<4>();
    (&halves[0], &halves[1])
}

/// The highest byte position of a top-left pixel.
#[inline]
#[target_feature(enable = "neon")]
fn highest<const CHANNELS: usize>(plane: &Plane<'_>, rows: &Rows, offsets: uint32x4_t) -> usize {
    if plane.strided.is_none() {
        return vmaxvq_u32(offsets) as usize * CHANNELS;
    }
    rows.iter().map(|(top, _)| top.addr() - plane.start().addr()).max().unwrap_or(0)
}

/// The Q15 weights of eight cells.
pub(super) struct Weights {
    top_left: uint16x8_t,
    top_right: uint16x8_t,
    bottom_left: uint16x8_t,
    bottom_right: uint16x8_t,
}

impl Weights {
    #[inline]
    #[target_feature(enable = "neon")]
    pub(super) fn new(low: uint32x4_t, high: uint32x4_t) -> Self {
        let (low, high) = (vreinterpretq_u16_u32(low), vreinterpretq_u16_u32(high));
        let fraction = |with_step| vandq_u16(with_step, vdupq_n_u16(0x7fff));
        let (fx, fy) = (fraction(vuzp1q_u16(low, high)), fraction(vuzp2q_u16(low, high)));
        // (2 fx fy + 2^15) >> 16 is (fx fy + 2^14) >> 15
        let both = vreinterpretq_u16_s16(vqrdmulhq_s16(vreinterpretq_s16_u16(fx), vreinterpretq_s16_u16(fy)));
        let top_right = vsubq_u16(fx, both);
        Self {
            top_left: vsubq_u16(vsubq_u16(vdupq_n_u16(0x8000), fy), top_right),
            top_right,
            bottom_left: vsubq_u16(fy, both),
            bottom_right: both,
        }
    }

    /// The blend of one cell, a channel in each lane, before the shift by 15. A row is its left pixel in the low half and
    /// its right pixel in the high half.
    #[inline]
    #[target_feature(enable = "neon")]
    fn blend<const CELL: i32>(&self, top: uint16x8_t, bottom: uint16x8_t) -> uint32x4_t {
        let sum = vmull_laneq_u16::<CELL>(vget_low_u16(top), self.top_left);
        let sum = vmlal_high_laneq_u16::<CELL>(sum, top, self.top_right);
        let sum = vmlal_laneq_u16::<CELL>(sum, vget_low_u16(bottom), self.bottom_left);
        vmlal_high_laneq_u16::<CELL>(sum, bottom, self.bottom_right)
    }
}

/// Sums of weights and pixels, rounded and shifted by 15.
#[inline]
#[target_feature(enable = "neon")]
fn rounded(low: uint32x4_t, high: uint32x4_t) -> uint16x8_t {
    vrshrn_high_n_u32::<15>(vrshrn_n_u32::<15>(low), high)
}

/// Eight cells of one channel.
#[inline]
#[target_feature(enable = "neon")]
fn blend_single(rows: Rows, weights: &Weights, cells: &mut [u8]) {
    assert_eq!(cells.len(), 8);
    // SAFETY: the cells are inside, so two pixels of a byte exist at either address.
    let pair = |at: *const u8| unsafe { at.cast::<u16>().read_unaligned() };
    let (top, bottom) = (pairs(rows.map(|(top, _)| pair(top))), pairs(rows.map(|(_, bottom)| pair(bottom))));
    let left = |pairs| vandq_u16(pairs, vdupq_n_u16(0x00ff));
    let blended = blend_lanes([
        (left(top), weights.top_left),
        (vshrq_n_u16::<8>(top), weights.top_right),
        (left(bottom), weights.bottom_left),
        (vshrq_n_u16::<8>(bottom), weights.bottom_right),
    ]);
    // SAFETY: `cells` holds 8 bytes.
    unsafe { vst1_u8(cells.as_mut_ptr(), blended) };
}

/// Eight sums of pixels times weights, rounded.
#[inline]
#[target_feature(enable = "neon")]
fn blend_lanes(products: [(uint16x8_t, uint16x8_t); 4]) -> uint8x8_t {
    let (mut low, mut high) = (vdupq_n_u32(0), vdupq_n_u32(0));
    for (pixels, weights) in products {
        low = vmlal_u16(low, vget_low_u16(pixels), vget_low_u16(weights));
        high = vmlal_high_u16(high, pixels, weights);
    }
    vmovn_u16(rounded(low, high))
}

/// Eight cells of two channels, a lane to a channel.
#[inline]
#[target_feature(enable = "neon")]
fn blend_pairs(rows: Rows, weights: &Weights, cells: &mut [u8]) {
    assert_eq!(cells.len(), 16);
    // SAFETY: the cells are inside, so two pixels of two bytes exist at either address.
    let pair = |at: *const u8| unsafe { at.cast::<u32>().read_unaligned() };
    let (top, bottom) =
        (lefts_and_rights(rows.map(|(top, _)| pair(top))), lefts_and_rights(rows.map(|(_, row)| pair(row))));
    let low = |pixels: uint8x16_t| vmovl_u8(vget_low_u8(pixels));
    let first = blend_lanes([
        (low(top.0), vzip1q_u16(weights.top_left, weights.top_left)),
        (low(top.1), vzip1q_u16(weights.top_right, weights.top_right)),
        (low(bottom.0), vzip1q_u16(weights.bottom_left, weights.bottom_left)),
        (low(bottom.1), vzip1q_u16(weights.bottom_right, weights.bottom_right)),
    ]);
    let last = blend_lanes([
        (vmovl_high_u8(top.0), vzip2q_u16(weights.top_left, weights.top_left)),
        (vmovl_high_u8(top.1), vzip2q_u16(weights.top_right, weights.top_right)),
        (vmovl_high_u8(bottom.0), vzip2q_u16(weights.bottom_left, weights.bottom_left)),
        (vmovl_high_u8(bottom.1), vzip2q_u16(weights.bottom_right, weights.bottom_right)),
    ]);
    // SAFETY: `cells` holds 16 bytes.
    unsafe { vst1q_u8(cells.as_mut_ptr(), vcombine_u8(first, last)) };
}

/// The left and the right pixels of eight cells, each of two bytes.
#[inline]
#[target_feature(enable = "neon")]
fn lefts_and_rights(pairs: [u32; 8]) -> (uint8x16_t, uint8x16_t) {
    // SAFETY: eight lanes of 32 bits.
    let (low, high) = unsafe { (vld1q_u32(pairs.as_ptr()), vld1q_u32(pairs.as_ptr().add(4))) };
    let (low, high) = (vreinterpretq_u16_u32(low), vreinterpretq_u16_u32(high));
    (vreinterpretq_u8_u16(vuzp1q_u16(low, high)), vreinterpretq_u8_u16(vuzp2q_u16(low, high)))
}

#[inline]
#[target_feature(enable = "neon")]
fn pairs(pairs: [u16; 8]) -> uint16x8_t {
    // SAFETY: eight 16-bit lanes.
    unsafe { vld1q_u16(pairs.as_ptr()) }
}

/// Eight cells of 3 or 4 channels, four bytes each.
#[inline]
#[target_feature(enable = "neon")]
pub(super) fn blend<const CHANNELS: usize>(rows: Rows, weights: &Weights) -> uint8x16x2_t {
    let row = |cell: usize| (load_row::<CHANNELS>(rows[cell].0), load_row::<CHANNELS>(rows[cell].1));
    macro_rules! two {
        ($first:literal, $second:literal) => {{
            let ((top, bottom), (next_top, next_bottom)) = (row($first), row($second));
            let (cell, next) = (weights.blend::<$first>(top, bottom), weights.blend::<$second>(next_top, next_bottom));
            vreinterpretq_u8_u16(rounded(cell, next))
        }};
    }
    // the low bytes of 16-bit lanes
    uint8x16x2_t(vuzp1q_u8(two!(0, 1), two!(2, 3)), vuzp1q_u8(two!(4, 5), two!(6, 7)))
}

/// Two neighbouring pixels as 16-bit lanes: the left one's channels in the low half, the right one's in the high half.
#[inline]
#[target_feature(enable = "neon")]
fn load_row<const CHANNELS: usize>(at: *const u8) -> uint16x8_t {
    // SAFETY: of 4 channels two pixels are 8 bytes, and the cells are inside; with 3 the caller checked every position
    // against `Plane::limit(8)`.
    let bytes = unsafe { vld1_u8(at) };
    if CHANNELS == 4 {
        return vmovl_u8(bytes);
    }
    // r g b R G B x x -> r g b 0 R G B 0 in lanes of 16 bits: an index beyond the table gives 0
    const NONE: u8 = 0xff;
    #[rustfmt::skip]
    const SPREAD: [u8; 16] = [
        0, NONE, 1, NONE, 2, NONE, NONE, NONE,
        3, NONE, 4, NONE, 5, NONE, NONE, NONE,
    ];
    // SAFETY: 16 bytes.
    let spread = unsafe { vld1q_u8(SPREAD.as_ptr()) };
    vreinterpretq_u16_u8(vqtbl1q_u8(vcombine_u8(bytes, vdup_n_u8(0)), spread))
}

#[inline]
#[target_feature(enable = "neon")]
pub(super) fn store_four(eight: uint8x16x2_t, cells: &mut [u8]) {
    assert_eq!(cells.len(), 32);
    // SAFETY: `cells` holds 32 bytes.
    unsafe {
        vst1q_u8(cells.as_mut_ptr(), eight.0);
        vst1q_u8(cells.as_mut_ptr().add(16), eight.1);
    }
}

/// Without every fourth byte.
#[inline]
#[target_feature(enable = "neon")]
pub(super) fn store_three(eight: uint8x16x2_t, cells: &mut [u8]) {
    assert_eq!(cells.len(), 24);
    #[rustfmt::skip]
    const KEPT: [u8; 24] = [
        0, 1, 2, 4, 5, 6, 8, 9, 10, 12, 13, 14, 16, 17, 18, 20,
        21, 22, 24, 25, 26, 28, 29, 30,
    ];
    // SAFETY: KEPT and `cells` hold 24 bytes: 16 and 8.
    unsafe {
        vst1q_u8(cells.as_mut_ptr(), vqtbl2q_u8(eight, vld1q_u8(KEPT.as_ptr())));
        vst1_u8(cells.as_mut_ptr().add(16), vqtbl2_u8(eight, vld1_u8(KEPT.as_ptr().add(16))));
    }
}
