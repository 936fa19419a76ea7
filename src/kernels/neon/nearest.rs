//! Nearest, for pixels of 1, 2, 3, 4 and 8 bytes.

use std::arch::aarch64::*;

use super::{Four, in_groups};
use crate::kernels::plane::Plane;
use crate::kernels::{Source, scalar};
use crate::table::Tap;
use crate::view::{Sample, as_bytes_mut};

/// Cells whose four pixels exist.
///
/// # Safety
/// The CPU has NEON, the taps are of a run that is inside, and pixels are of so many bytes.
#[target_feature(enable = "neon")]
pub(in crate::kernels) fn nearest<T: Sample, const PIXEL: usize>(
    source: &Source<'_, T>,
    taps: &[Tap],
    cells: &mut [T],
) {
    let Some(plane) = Plane::new(source).filter(|_| taps.len() >= 4) else {
        return scalar::nearest::<T, 0, false>(source, taps, cells);
    };
    let width = source.image.width() as u32;
    in_groups::<u8, 4>(taps, as_bytes_mut(cells), PIXEL, |_, taps, cells| {
        assert_eq!(cells.len(), 4 * PIXEL);
        let Four { offsets, fractions } = Four::load(taps);
        let step_x = vandq_u32(vshrq_n_u32::<15>(fractions), vdupq_n_u32(1));
        let offsets = vmlaq_n_u32(vaddq_u32(offsets, step_x), vshrq_n_u32::<31>(fractions), width);
        let (offsets, step_x) = (lanes(offsets), lanes(step_x));
        for cell in 0..4 {
            let from = plane.start().wrapping_add(plane.position::<PIXEL>(offsets[cell]));
            let to = cells[cell * PIXEL..].as_mut_ptr();
            // SAFETY: the cells are inside, so the nearest of the four pixels exists, and `cells` holds four of its size.
            unsafe {
                match PIXEL {
                    1 => *to = *from,
                    2 => to.cast::<u16>().write_unaligned(from.cast::<u16>().read_unaligned()),
                    3 => copy_three(from, step_x[cell], to, cell == 3),
                    4 => to.cast::<u32>().write_unaligned(from.cast::<u32>().read_unaligned()),
                    _ => to.cast::<[u8; PIXEL]>().write(from.cast::<[u8; PIXEL]>().read()),
                }
            }
        }
    });
}

/// Copies three bytes by way of four: beyond the left of two pixels there is one byte of the right one, and before the
/// right one of the left.
///
/// # Safety
/// The pixel and its neighbour exist: the next one, or where `step` is 1 the one before. Four bytes may be written, or
/// three if it is the `last`.
#[inline(always)]
unsafe fn copy_three(from: *const u8, step: u32, to: *mut u8, last: bool) {
    // SAFETY: the caller's.
    unsafe {
        let pixel = from.sub(step as usize).cast::<u32>().read_unaligned() >> (8 * step);
        if last {
            to.cast::<u16>().write_unaligned(pixel as u16);
            *to.add(2) = (pixel >> 16) as u8;
        } else {
            to.cast::<u32>().write_unaligned(pixel);
        }
    }
}

#[inline]
#[target_feature(enable = "neon")]
fn lanes(four: uint32x4_t) -> [u32; 4] {
    [vgetq_lane_u32::<0>(four), vgetq_lane_u32::<1>(four), vgetq_lane_u32::<2>(four), vgetq_lane_u32::<3>(four)]
}
