//! Nearest: pixels are copied as bytes, whatever their samples are.
//!
//! * 1 and 2 bytes, **window**: where four neighbouring cells look at 16 bytes of one row, `pshufb` picks them from one
//!   load;
//! * 3, 6 and 12 bytes are copied 4, 8 and 16 bytes at a time: what is too much is overwritten by the next pixel;
//! * the others are copied one by one.

use std::arch::x86_64::*;

use super::{CELLS, Cells, Run, distances_within, load_halves, vector};
use crate::kernels::plane::Plane;
use crate::kernels::{Source, scalar};
use crate::table::Tap;
use crate::view::{Sample, as_bytes_mut};

/// Cells whose four pixels exist: the nearest of them, for pixels of `PIXEL` bytes (0: any).
///
/// # Safety
/// The CPU has AVX2.
#[target_feature(enable = "avx2")]
pub(in crate::kernels) fn nearest<T: Sample, const PIXEL: usize>(
    source: &Source<'_, T>,
    taps: &[Tap],
    cells: &mut [T],
) {
    if matches!(PIXEL, 1 | 2) {
        copy_run::<T, PIXEL, 1>(source, taps, cells);
    } else {
        copy_run::<T, PIXEL, 8>(source, taps, cells);
    }
}

/// Copies a run in blocks of so many groups.
#[inline]
#[target_feature(enable = "avx2")]
fn copy_run<T: Sample, const PIXEL: usize, const GROUPS: usize>(source: &Source<'_, T>, taps: &[Tap], cells: &mut [T]) {
    let scalar = scalar::nearest::<T, 0, false>;
    let plane = Plane::new(source).filter(|_| taps.len() >= CELLS);
    let Some(plane) = plane else { return scalar(source, taps, cells) };
    let width = _mm256_set1_epi32(source.image.width() as i32);
    // not `Plane::limit`: nothing is loaded from the row below
    let limit = size_of_val(source.image.data()) as isize - loaded::<PIXEL>() as isize;
    Run::<_, PIXEL, GROUPS> { plane: &plane, limit: limit as i32, taps, cells }.for_each_group(
        |_, group| (group.nearest(width), ()),
        |at, (), cells| {
            let cells = as_bytes_mut(cells);
            match PIXEL {
                1 | 2 if pick_from_windows::<PIXEL>(vector(at.positions), || load_windows(&plane, at), cells) => {}
                3 | 6 | 12 => copy_with_excess::<PIXEL>(|cell| plane.start().wrapping_add(at.position(cell)), cells),
                _ => copy::<PIXEL>(&plane, at, cells),
            }
        },
        |range, cells| scalar(source, &taps[range], cells),
    );
}

/// 16 bytes from the lowest position of either half, all of which the caller checked.
#[inline]
#[target_feature(enable = "avx2")]
fn load_windows(plane: &Plane<'_>, at: &Cells<'_>) -> __m256i {
    // positions of nearest pixels, which are not those of the taps
    let lower = |first, last| plane.start().wrapping_add(at.position(first).min(at.position(last))).cast();
    // SAFETY: both are among the positions: 16 bytes may be loaded from there.
    unsafe { load_halves(lower(0, 3), lower(4, 7)) }
}

/// Bytes that are loaded for a pixel where the image has them; for pixels of 1 and 2 bytes, for several.
pub(super) const fn loaded<const PIXEL: usize>() -> usize {
    match PIXEL {
        3 => 4,
        6 => 8,
        1 | 2 | 12 => 16,
        _ => 0,
    }
}

/// Copies pixels one by one.
#[inline]
#[target_feature(enable = "avx2")]
fn copy<const PIXEL: usize>(plane: &Plane<'_>, at: &Cells<'_>, cells: &mut [u8]) {
    let pixel = if PIXEL == 0 { plane.pixel as usize } else { PIXEL };
    for (cell, pixels) in cells.chunks_exact_mut(pixel).enumerate() {
        let from = plane.start().wrapping_add(at.position(cell));
        // SAFETY: the nearest of a tap's four pixels exists, and the cell is one pixel; an image and its warp do not
        // overlap.
        unsafe { copy_pixel(from, pixels.as_mut_ptr(), pixel) };
    }
}

/// Copies `size` bytes in few pieces, the last of which may overlap the one before.
///
/// # Safety
/// So many bytes can be read at `from` and written at `to`, and they do not overlap.
#[inline]
#[target_feature(enable = "avx2")]
pub(super) unsafe fn copy_pixel(from: *const u8, to: *mut u8, size: usize) {
    let piece = |at: usize, bytes: usize| {
        // SAFETY: the caller's promise, and `at + bytes <= size` in every call below.
        unsafe { std::ptr::copy_nonoverlapping(from.add(at), to.add(at), bytes) };
    };
    let (two, four) = (|at| piece(at, 2), |at| piece(at, 4));
    let (eight, sixteen) = (|at| piece(at, 8), |at| piece(at, 16));
    match size {
        0 => {}
        1 => piece(0, 1),
        2 => two(0),
        3 => {
            two(0);
            piece(2, 1);
        }
        4 => four(0),
        5..=7 => {
            four(0);
            four(size - 4);
        }
        8 => eight(0),
        9..=15 => {
            eight(0);
            eight(size - 8);
        }
        _ => {
            for at in (0..size - 15).step_by(16) {
                sixteen(at);
            }
            sixteen(size - 16);
        }
    }
}

/// Copies pixels of 3, 6 or 12 bytes, the first of which are at `from`, as if they were 4, 8 or 16: so much must exist from
/// each on.
#[inline]
#[target_feature(enable = "avx2")]
pub(super) fn copy_with_excess<const PIXEL: usize>(from: impl Fn(usize) -> *const u8, cells: &mut [u8]) {
    assert_eq!(cells.len(), CELLS * PIXEL);
    let out = cells.as_mut_ptr();
    for cell in 0..CELLS {
        let (from, to) = (from(cell), out.wrapping_add(cell * PIXEL));
        if cell < CELLS - 1 {
            // SAFETY: the caller's promise. `cells` has room for the excess, because another pixel follows that is no
            // smaller; it is written later.
            unsafe { std::ptr::copy_nonoverlapping(from, to, loaded::<PIXEL>()) };
        } else {
            // SAFETY: the pixel exists, and `to` is the last one of `cells`.
            unsafe { copy_pixel(from, to, PIXEL) };
        }
    }
}

/// Copies eight pixels of 1 or 2 bytes from windows: where four neighbouring cells look at 16 bytes, `pshufb` picks them
/// from there. False, and nothing copied, where they do not. `windows` loads 16 bytes from the lowest position of either
/// half.
#[inline]
#[target_feature(enable = "avx2")]
pub(super) fn pick_from_windows<const PIXEL: usize>(
    positions: __m256i,
    windows: impl FnOnce() -> __m256i,
    cells: &mut [u8],
) -> bool {
    assert_eq!(cells.len(), CELLS * PIXEL);
    let Some(distances) = distances_within(positions, 16 - PIXEL as i32) else { return false };
    let windows = windows();
    let picked = if PIXEL == 1 {
        let bytes = _mm_setr_epi8(0, 4, 8, 12, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1);
        let pick = _mm256_shuffle_epi8(distances, _mm256_broadcastsi128_si256(bytes));
        _mm256_shuffle_epi8(windows, pick)
    } else {
        let bytes = _mm_setr_epi8(0, 0, 4, 4, 8, 8, 12, 12, -1, -1, -1, -1, -1, -1, -1, -1);
        let pick = _mm256_shuffle_epi8(distances, _mm256_broadcastsi128_si256(bytes));
        _mm256_shuffle_epi8(windows, _mm256_add_epi8(pick, _mm256_set1_epi16(0x0100)))
    };
    let (low, high) = (_mm256_castsi256_si128(picked), _mm256_extracti128_si256::<1>(picked));
    if PIXEL == 1 {
        // SAFETY: `cells` holds 8 bytes.
        unsafe { _mm_storel_epi64(cells.as_mut_ptr().cast(), _mm_unpacklo_epi32(low, high)) };
    } else {
        // SAFETY: `cells` holds 16 bytes.
        unsafe { _mm_storeu_si128(cells.as_mut_ptr().cast(), _mm_unpacklo_epi64(low, high)) };
    }
    true
}
