//! Nearest: pixels are copied as bytes, whatever their samples are.
//!
//! Positions of up to 64 cells are worked out eight at a time and stored; by the time that they are read one by one, to
//! copy the pixels, the stores are done. Pixels of 3, 6 and 12 bytes are copied 4, 8 and 16 bytes at a time: what is too
//! much is overwritten by the next pixel.

use std::arch::x86_64::*;

use super::{CELLS, Group, all_within, for_each_group, lanes, load_halves, positions};
use crate::image::{Sample, as_bytes, as_bytes_mut};
use crate::lut::table::Tap;
use crate::warp::kernels::plane::Plane;
use crate::warp::kernels::{Source, scalar};

/// Cells whose positions are worked out before their pixels are copied.
const BLOCK: usize = 64;

/// Cells whose four pixels exist: the nearest of them, for pixels of `PIXEL` bytes (0: any).
///
/// # Safety
/// The CPU has AVX2.
#[target_feature(enable = "avx2")]
pub(in crate::warp::kernels) fn nearest<T: Sample, const PIXEL: usize>(
    source: &Source<'_, T>,
    taps: &[Tap],
    cells: &mut [T],
) {
    let plane = Plane::new(source).filter(|_| taps.len() >= CELLS);
    let Some(plane) = plane else { return scalar::nearest::<T, 0, false>(source, taps, cells) };
    let pixel = if PIXEL == 0 { plane.pixel as usize } else { PIXEL };
    let width = _mm256_set1_epi32(source.image.width() as i32);
    let cells = as_bytes_mut(cells);
    assert_eq!(cells.len(), taps.len() * pixel);
    // the last position from which a pixel with excess, or a window, may be loaded
    let last = as_bytes(source.image.data()).len() as isize - loaded::<PIXEL>() as isize;
    if PIXEL <= 2 && PIXEL > 0 && last >= 0 {
        return for_each_group(taps, cells, pixel, |taps, cells| {
            let positions = positions::<PIXEL>(&plane, Group::load(taps).nearest(width));
            if !copy_window::<PIXEL>(&plane, positions, last as i32, cells) {
                copy::<PIXEL>(&plane, &lanes(positions), cells);
            }
        });
    }
    let mut done = 0;
    while done < taps.len() {
        // the last block reaches back to hold a group
        let first = done.min(taps.len() - CELLS);
        let count = (taps.len() - first).min(BLOCK);
        let mut found = [0; BLOCK];
        let mut highest = _mm256_setzero_si256();
        for group in 0..count.div_ceil(CELLS) {
            let at = (CELLS * group).min(count - CELLS);
            let taps = taps[first + at..].first_chunk().expect("eight are left");
            let eight = positions::<PIXEL>(&plane, Group::load(taps).nearest(width));
            highest = _mm256_max_epu32(highest, eight);
            found[at..at + CELLS].copy_from_slice(&lanes(eight));
        }
        let (found, cells) = (&found[..count], &mut cells[first * pixel..(first + count) * pixel]);
        if loaded::<PIXEL>() > PIXEL && last >= 0 && all_within(highest, last as i32) {
            copy_with_excess::<PIXEL>(&plane, found, cells);
        } else {
            copy::<PIXEL>(&plane, found, cells);
        }
        done = first + count;
    }
}

/// Bytes that are loaded for a pixel where the image has them; for pixels of 1 and 2 bytes, for several.
const fn loaded<const PIXEL: usize>() -> usize {
    match PIXEL {
        3 => 4,
        6 => 8,
        1 | 2 | 12 => 16,
        _ => PIXEL,
    }
}

/// Copies pixels one by one.
#[inline]
#[target_feature(enable = "avx2")]
fn copy<const PIXEL: usize>(plane: &Plane<'_>, positions: &[u32], cells: &mut [u8]) {
    let pixel = if PIXEL == 0 { plane.pixel as usize } else { PIXEL };
    for (&position, cell) in positions.iter().zip(cells.chunks_exact_mut(pixel)) {
        let from = plane.start().wrapping_add(position as usize);
        // SAFETY: the nearest of a tap's four pixels exists, and the cell is one pixel; an image and its warp do not
        // overlap.
        unsafe { copy_pixel(from, cell.as_mut_ptr(), pixel) };
    }
}

/// Copies `size` bytes in few pieces, the last of which may overlap the one before.
///
/// # Safety
/// So many bytes can be read at `from` and written at `to`, and they do not overlap.
#[inline]
#[target_feature(enable = "avx2")]
unsafe fn copy_pixel(from: *const u8, to: *mut u8, size: usize) {
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

/// Copies pixels of 3, 6 or 12 bytes as if they were 4, 8 or 16. Every position must allow that.
#[inline]
#[target_feature(enable = "avx2")]
fn copy_with_excess<const PIXEL: usize>(plane: &Plane<'_>, positions: &[u32], cells: &mut [u8]) {
    assert_eq!(cells.len(), positions.len() * PIXEL);
    let Some((last, others)) = positions.split_last() else { return };
    let mut to = cells.as_mut_ptr();
    for &position in others {
        let from = plane.start().wrapping_add(position as usize);
        // SAFETY: the caller checked the position. `cells` has room for the excess, because another pixel follows that
        // is no smaller; it is written later.
        unsafe { std::ptr::copy_nonoverlapping(from, to, loaded::<PIXEL>()) };
        to = to.wrapping_add(PIXEL);
    }
    // SAFETY: the nearest of a tap's four pixels exists, and `to` is the last pixel of `cells`.
    unsafe { copy_pixel(plane.start().wrapping_add(*last as usize), to, PIXEL) };
}

/// Copies eight pixels of 1 or 2 bytes from windows: where four neighbouring cells look at 16 bytes of one row, `pshufb`
/// picks them from there. False, and nothing copied, where they do not, or where a window would begin after `last`.
#[inline]
#[target_feature(enable = "avx2")]
fn copy_window<const PIXEL: usize>(plane: &Plane<'_>, positions: __m256i, last: i32, cells: &mut [u8]) -> bool {
    assert_eq!(cells.len(), CELLS * PIXEL);
    // cells run along a row, so the lowest of a half is its first or, where the view is mirrored, its last
    let first = _mm256_shuffle_epi32::<0b00_00_00_00>(positions);
    let lowest = _mm256_min_epu32(first, _mm256_shuffle_epi32::<0b11_11_11_11>(positions));
    let distances = _mm256_sub_epi32(positions, lowest);
    if !all_within(distances, 16 - PIXEL as i32) || !all_within(lowest, last) {
        return false;
    }
    let (low, high) = (_mm256_castsi256_si128(lowest), _mm256_extracti128_si256::<1>(lowest));
    let at = |lowest| plane.start().wrapping_add(_mm_cvtsi128_si32(lowest) as usize).cast();
    // SAFETY: both begin at or before `last`, from where 16 bytes may be loaded.
    let windows = unsafe { load_halves(at(low), at(high)) };
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
