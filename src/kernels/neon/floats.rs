//! Bilinear of 16-bit and float images, in float32: the scalar kernel's expressions, never fused.

use std::arch::aarch64::*;

use super::{Four, in_groups};
use crate::kernels::places::Places;
use crate::kernels::plane::Plane;
use crate::kernels::{Source, scalar, sealed::Blend};

/// A sample that is blended in float32.
pub(in crate::kernels) trait InFloat: Blend {
    /// Four samples.
    ///
    /// # Safety
    /// They may be read from there.
    unsafe fn load_four(at: *const u8) -> float32x4_t;

    /// Two neighbouring samples of four places: the left ones, and the right ones.
    ///
    /// # Safety
    /// They may be read from each place.
    unsafe fn load_pairs(at: [*const u8; 4]) -> (float32x4_t, float32x4_t);

    /// Stores the first so many of four blends: 3 or 4.
    ///
    /// # Safety
    /// They may be written there.
    unsafe fn store<const SAMPLES: usize>(blends: float32x4_t, at: *mut Self);
}

impl InFloat for f32 {
    #[inline(always)]
    unsafe fn load_four(at: *const u8) -> float32x4_t {
        // SAFETY: the caller's.
        unsafe { vreinterpretq_f32_u8(vld1q_u8(at)) }
    }

    #[inline(always)]
    unsafe fn load_pairs(at: [*const u8; 4]) -> (float32x4_t, float32x4_t) {
        // SAFETY: the caller's, and every aarch64 has NEON.
        unsafe {
            let pair = |at| vreinterpret_f32_u8(vld1_u8(at));
            let (low, high) = (vcombine_f32(pair(at[0]), pair(at[1])), vcombine_f32(pair(at[2]), pair(at[3])));
            (vuzp1q_f32(low, high), vuzp2q_f32(low, high))
        }
    }

    #[inline(always)]
    unsafe fn store<const SAMPLES: usize>(blends: float32x4_t, at: *mut Self) {
        // SAFETY: the caller's.
        unsafe {
            if SAMPLES == 4 {
                return vst1q_f32(at, blends);
            }
            vst1_f32(at, vget_low_f32(blends));
            vst1q_lane_f32::<2>(at.add(2), blends);
        }
    }
}

impl InFloat for u16 {
    #[inline(always)]
    unsafe fn load_four(at: *const u8) -> float32x4_t {
        // SAFETY: the caller's.
        unsafe { vcvtq_f32_u32(vmovl_u16(vreinterpret_u16_u8(vld1_u8(at)))) }
    }

    #[inline(always)]
    unsafe fn load_pairs(at: [*const u8; 4]) -> (float32x4_t, float32x4_t) {
        // SAFETY: the caller's, and every aarch64 has NEON.
        unsafe {
            let pairs = at.map(|at| at.cast::<u32>().read_unaligned());
            let pairs = vld1q_u32(pairs.as_ptr());
            (vcvtq_f32_u32(vandq_u32(pairs, vdupq_n_u32(0xffff))), vcvtq_f32_u32(vshrq_n_u32::<16>(pairs)))
        }
    }

    #[inline(always)]
    unsafe fn store<const SAMPLES: usize>(blends: float32x4_t, at: *mut Self) {
        // SAFETY: the caller's.
        unsafe {
            // truncates, and saturates as `as u16` does
            let four = vqmovn_u32(vcvtq_u32_f32(vaddq_f32(blends, vdupq_n_f32(0.5))));
            if SAMPLES == 4 {
                return vst1_u16(at, four);
            }
            at.cast::<u32>().write_unaligned(vget_lane_u32::<0>(vreinterpret_u32_u16(four)));
            at.add(2).write(vget_lane_u16::<2>(four));
        }
    }
}

/// Cells whose four pixels exist, of an image of 1 to 4 channels.
///
/// # Safety
/// The CPU has NEON, and the taps are of a run that is inside.
#[target_feature(enable = "neon")]
pub(in crate::kernels) fn bilinear_float<T: InFloat, P: Places<T>, const CHANNELS: usize>(
    source: &Source<'_, T>,
    places: P,
    cells: &mut [T],
) {
    let taps = places.taps();
    let Some(plane) = Plane::new(source).filter(|_| taps.len() >= 4) else {
        return scalar::bilinear::<T, P, CHANNELS, false>(source, places, cells);
    };
    in_groups::<T, 4>(taps, cells, CHANNELS, |first, taps, cells| {
        assert_eq!(cells.len(), 4 * CHANNELS);
        let rows = match size_of::<T>() * CHANNELS {
            2 => plane.rows::<2, 4>(taps),
            4 => plane.rows::<4, 4>(taps),
            6 => plane.rows::<6, 4>(taps),
            8 => plane.rows::<8, 4>(taps),
            12 => plane.rows::<12, 4>(taps),
            _ => plane.rows::<16, 4>(taps),
        };
        let (fx, fy) = match places.floats::<4>(first) {
            // SAFETY: four numbers are 16 bytes.
            Some([x, y]) => unsafe { (vld1q_f32(x.as_ptr()), vld1q_f32(y.as_ptr())) },
            None => {
                let fractions = Four::load(taps).fractions;
                // exact: 15 bits and a power of two
                let fx = vcvtq_n_f32_u32::<15>(vandq_u32(fractions, vdupq_n_u32(0x7fff)));
                (fx, vcvtq_n_f32_u32::<15>(vandq_u32(vshrq_n_u32::<16>(fractions), vdupq_n_u32(0x7fff))))
            }
        };
        let at = cells.as_mut_ptr();
        if CHANNELS == 1 {
            // SAFETY: the cells are inside, so two pixels exist at either address of each; `cells` holds 4.
            unsafe {
                let (top, bottom) = (T::load_pairs(rows.map(|row| row.0)), T::load_pairs(rows.map(|row| row.1)));
                let (top, bottom) = (between(top, fx), between(bottom, fx));
                T::store::<4>(between((top, bottom), fy), at);
            }
            return;
        }
        if CHANNELS == 2 {
            // SAFETY: the cells are inside, so two pixels, four samples, exist at either address of each; `cells` holds 8.
            unsafe {
                let two = |first: usize, fx, fy| {
                    let row = |one, other| lefts_and_rights(T::load_four(one), T::load_four(other));
                    let ((top, bottom), (next_top, next_bottom)) = (rows[first], rows[first + 1]);
                    between((between(row(top, next_top), fx), between(row(bottom, next_bottom), fx)), fy)
                };
                T::store::<4>(two(0, vzip1q_f32(fx, fx), vzip1q_f32(fy, fy)), at);
                T::store::<4>(two(2, vzip2q_f32(fx, fx), vzip2q_f32(fy, fy)), at.add(4));
            }
            return;
        }
        // SAFETY: the cells are inside, and `cells` holds four. With three channels all but the last write a fourth sample too, where the
        // next cell is written after it.
        unsafe {
            T::store::<4>(blend::<T, CHANNELS, 0>(rows, fx, fy), at);
            T::store::<4>(blend::<T, CHANNELS, 1>(rows, fx, fy), at.add(CHANNELS));
            T::store::<4>(blend::<T, CHANNELS, 2>(rows, fx, fy), at.add(2 * CHANNELS));
            match CHANNELS {
                3 => T::store::<3>(blend::<T, CHANNELS, 3>(rows, fx, fy), at.add(3 * CHANNELS)),
                _ => T::store::<4>(blend::<T, CHANNELS, 3>(rows, fx, fy), at.add(3 * CHANNELS)),
            }
        }
    });
}

/// `a + (b - a) f`
#[inline]
#[target_feature(enable = "neon")]
fn between((a, b): (float32x4_t, float32x4_t), f: float32x4_t) -> float32x4_t {
    vaddq_f32(a, vmulq_f32(vsubq_f32(b, a), f))
}

/// The left and the right pixels of two cells of two channels, from the two pixels of each.
#[inline]
#[target_feature(enable = "neon")]
fn lefts_and_rights(one: float32x4_t, other: float32x4_t) -> (float32x4_t, float32x4_t) {
    (vcombine_f32(vget_low_f32(one), vget_low_f32(other)), vcombine_f32(vget_high_f32(one), vget_high_f32(other)))
}

/// One of four cells of 3 or 4 channels.
///
/// # Safety
/// The cells are inside.
#[inline]
#[target_feature(enable = "neon")]
unsafe fn blend<T: InFloat, const CHANNELS: usize, const CELL: i32>(
    rows: [(*const u8, *const u8); 4],
    fx: float32x4_t,
    fy: float32x4_t,
) -> float32x4_t {
    let (top, bottom) = rows[CELL as usize];
    let (fx, fy) = (vdupq_laneq_f32::<CELL>(fx), vdupq_laneq_f32::<CELL>(fy));
    // SAFETY: the caller's.
    let (top, bottom) = unsafe { (load_row::<T, CHANNELS>(top), load_row::<T, CHANNELS>(bottom)) };
    between((between(top, fx), between(bottom, fx)), fy)
}

/// Two neighbouring pixels of 3 or 4 channels; of 3, the fourth lanes are of no use.
///
/// # Safety
/// Both pixels exist.
#[inline]
#[target_feature(enable = "neon")]
unsafe fn load_row<T: InFloat, const CHANNELS: usize>(at: *const u8) -> (float32x4_t, float32x4_t) {
    // SAFETY: two pixels of three are six samples: the first four and the last four of them.
    let (left, right) = unsafe { (T::load_four(at), T::load_four(at.add((2 * CHANNELS - 4) * size_of::<T>()))) };
    if CHANNELS == 4 { (left, right) } else { (left, vextq_f32::<1>(right, right)) }
}
