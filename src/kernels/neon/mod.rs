//! Kernels for aarch64, every one of which has NEON: eight cells at a time of 8-bit images, four of others.
//!
//! There is no gather, and none is missed: the pixels of a cell are loaded by its own address, two neighbours of a row at
//! once. All but one kernel load just the bytes of the four pixels, which exist wherever a run is
//! [`SpanKind::Inside`](crate::table::SpanKind::Inside); only RGB of 8 bits loads 8 bytes for 6 and asks
//! [`Plane::limit`] first.

mod bytes;
mod floats;
mod nearest;
mod probes;

pub(super) use bytes::bilinear_u8;
pub(super) use floats::bilinear_float;
pub(super) use nearest::nearest;
pub(super) use probes::probes_u8;

use std::arch::aarch64::*;

use super::plane::Plane;
use crate::table::Tap;

/// The taps of four cells, offsets and fractions apart.
#[derive(Clone, Copy)]
struct Four {
    /// Offset of each top-left pixel.
    offsets: uint32x4_t,
    /// x in the low and y in the high half of each lane, steps included.
    fractions: uint32x4_t,
}

impl Four {
    #[inline]
    #[target_feature(enable = "neon")]
    fn load(taps: &[Tap; 4]) -> Self {
        // SAFETY: four taps of 8 bytes are two vectors.
        let uint32x4x2_t(offsets, fractions) = unsafe { vld2q_u32(taps.as_ptr().cast()) };
        Self { offsets, fractions }
    }
}

impl Plane<'_> {
    /// Byte position of the pixel at `offset`.
    #[inline(always)]
    fn position<const PIXEL: usize>(&self, offset: u32) -> usize {
        debug_assert_eq!(self.pixel as usize, PIXEL);
        let contiguous = offset as usize * PIXEL;
        let Some(strided) = self.strided else { return contiguous };
        let row = ((f64::from(offset) + 0.5) * strided.inverse_width) as u32 as isize;
        contiguous.wrapping_add_signed(row * strided.row_extra as isize + strided.origin as isize)
    }

    /// Addresses of the top-left pixel of each cell and of the pixel below it.
    #[inline(always)]
    fn rows<const PIXEL: usize, const CELLS: usize>(&self, taps: &[Tap; CELLS]) -> [(*const u8, *const u8); CELLS] {
        taps.map(|tap| self.row_and_below(self.position::<PIXEL>(tap.offset)))
    }

    #[inline(always)]
    fn row_and_below(&self, position: usize) -> (*const u8, *const u8) {
        let top = self.start().wrapping_add(position);
        (top, top.wrapping_offset(self.row_stride))
    }
}

/// Calls `fill` for groups of neighbouring cells, with the first one's number; the last reaches back to be whole, so some cells are filled twice.
///
/// # Panics
/// Where there is not one whole group.
#[inline]
#[target_feature(enable = "neon")]
fn in_groups<T, const CELLS: usize>(
    taps: &[Tap],
    cells: &mut [T],
    samples: usize,
    fill: impl Fn(usize, &[Tap; CELLS], &mut [T]),
) {
    for group in 0..taps.len().div_ceil(CELLS) {
        let first = (CELLS * group).min(taps.len() - CELLS);
        let group = taps[first..].first_chunk().expect("a whole group is left");
        fill(first, group, &mut cells[first * samples..(first + CELLS) * samples]);
    }
}
