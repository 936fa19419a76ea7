//! Nearest: pixels are copied as bytes, whatever their samples are.
//!
//! * 1 and 2 bytes, **window**: where four neighbouring cells look at 16 bytes of one row, `pshufb` picks them from one
//!   load;
//! * 3, 6 and 12 bytes are copied 4, 8 and 16 bytes at a time: what is too much is overwritten by the next pixel;
//! * the others are copied one by one.

use std::arch::x86_64::*;

use super::{CELLS, Group, all_within, for_each_group, half_windows, lanes, load_halves, positions};
use crate::image::{Sample, as_bytes_mut};
use crate::lut::table::Tap;
use crate::warp::kernels::plane::Plane;
use crate::warp::kernels::{Source, scalar};

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
    // a smaller image has no room for the widest load
    let plane = Plane::new(source).filter(|_| taps.len() >= CELLS && size_of_val(source.image.data()) >= 16);
    let Some(plane) = plane else { return scalar::nearest::<T, 0, false>(source, taps, cells) };
    if plane.strided.is_none() {
        copy_run::<T, PIXEL, false>(source, &plane, taps, cells);
    } else {
        copy_run::<T, PIXEL, true>(source, &plane, taps, cells);
    }
}

#[inline]
#[target_feature(enable = "avx2")]
fn copy_run<T: Sample, const PIXEL: usize, const STRIDED: bool>(
    source: &Source<'_, T>,
    plane: &Plane<'_>,
    taps: &[Tap],
    cells: &mut [T],
) {
    let pixel = if PIXEL == 0 { plane.pixel as usize } else { PIXEL };
    let width = _mm256_set1_epi32(source.image.width() as i32);
    // the last position from which a pixel with excess, or a window, may be loaded
    let last = (size_of_val(source.image.data()) - loaded::<PIXEL>()) as i32;
    for_each_group(taps, as_bytes_mut(cells), pixel, |taps, cells| {
        let positions = positions::<PIXEL, STRIDED>(plane, Group::load(taps).nearest(width));
        match PIXEL {
            1 | 2 if all_within(positions, last) && copy_window::<PIXEL>(plane, positions, cells) => {}
            3 if copy_windows(plane, positions, last, cells) => {}
            3 | 6 | 12 if all_within(positions, last) => copy_with_excess::<PIXEL>(plane, lanes(positions), cells),
            _ => copy::<PIXEL>(plane, lanes(positions), cells),
        }
    });
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
fn copy<const PIXEL: usize>(plane: &Plane<'_>, positions: [u32; CELLS], cells: &mut [u8]) {
    let pixel = if PIXEL == 0 { plane.pixel as usize } else { PIXEL };
    for (position, cell) in positions.into_iter().zip(cells.chunks_exact_mut(pixel)) {
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
fn copy_with_excess<const PIXEL: usize>(plane: &Plane<'_>, positions: [u32; CELLS], cells: &mut [u8]) {
    assert_eq!(cells.len(), CELLS * PIXEL);
    let out = cells.as_mut_ptr();
    for (cell, position) in positions.into_iter().enumerate() {
        let (from, to) = (plane.start().wrapping_add(position as usize), out.wrapping_add(cell * PIXEL));
        if cell < CELLS - 1 {
            // SAFETY: the caller checked the position. `cells` has room for the excess, because another pixel follows
            // that is no smaller; it is written later.
            unsafe { std::ptr::copy_nonoverlapping(from, to, loaded::<PIXEL>()) };
        } else {
            // SAFETY: the nearest of a tap's four pixels exists, and `to` is the last pixel of `cells`.
            unsafe { copy_pixel(from, to, PIXEL) };
        }
    }
}

/// Copies eight pixels of 1 or 2 bytes from windows: where four neighbouring cells look at 16 bytes of one row, `pshufb`
/// picks them from there. False, and nothing copied, where they do not.
#[inline]
#[target_feature(enable = "avx2")]
fn copy_window<const PIXEL: usize>(plane: &Plane<'_>, positions: __m256i, cells: &mut [u8]) -> bool {
    assert_eq!(cells.len(), CELLS * PIXEL);
    let (lowest, distances) = half_windows(positions);
    if !all_within(distances, 16 - PIXEL as i32) {
        return false;
    }
    let (low, high) = (_mm256_castsi256_si128(lowest), _mm256_extracti128_si256::<1>(lowest));
    let at = |lowest| plane.start().wrapping_add(_mm_cvtsi128_si32(lowest) as usize).cast();
    // SAFETY: both are among the positions, which the caller checked: 16 bytes may be loaded from there.
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

/// Copies eight pixels of 3 bytes from windows: where four neighbouring cells look at 32 bytes of one row (up to 3.2
/// pixels apart), `pshufb` picks them from two loads. False, and nothing copied, where they do not, or where a window
/// would leave the image: `last` is the last position from which one pixel may be loaded as four bytes.
#[inline]
#[target_feature(enable = "avx2")]
fn copy_windows(plane: &Plane<'_>, positions: __m256i, last: i32, cells: &mut [u8]) -> bool {
    assert_eq!(cells.len(), CELLS * 3);
    let (lowest, distances) = half_windows(positions);
    if !all_within(distances, 32 - 3) || last < 28 || !all_within(positions, last - 28) {
        return false;
    }
    let (low, high) = (_mm256_castsi256_si128(lowest), _mm256_extracti128_si256::<1>(lowest));
    let at = |lowest| plane.start().wrapping_add(_mm_cvtsi128_si32(lowest) as usize).cast::<__m128i>();
    let (low, high) = (at(low), at(high));
    // SAFETY: both are among the positions, which were checked: 4 + 28 bytes may be loaded from there.
    let (near, far) = unsafe { (load_halves(low, high), load_halves(low.add(1), high.add(1))) };
    let spread = _mm_setr_epi8(0, 0, 0, 4, 4, 4, 8, 8, 8, 12, 12, 12, -1, -1, -1, -1);
    let spread = _mm256_shuffle_epi8(distances, _mm256_broadcastsi128_si256(spread));
    // 0x70 more: a byte of the first 16 keeps its top bit clear and is picked, a later one gets it and is zero
    let channel = _mm_setr_epi8(112, 113, 114, 112, 113, 114, 112, 113, 114, 112, 113, 114, -1, -1, -1, -1);
    let pick_near = _mm256_add_epi8(spread, _mm256_broadcastsi128_si256(channel));
    let pick_far = _mm256_xor_si256(pick_near, _mm256_set1_epi8(-128));
    let halves = _mm256_or_si256(_mm256_shuffle_epi8(near, pick_near), _mm256_shuffle_epi8(far, pick_far));
    let pixels = _mm256_permutevar8x32_epi32(halves, _mm256_setr_epi32(0, 1, 2, 4, 5, 6, 7, 7));
    let out = cells.as_mut_ptr();
    // SAFETY: `cells` holds 24 bytes: 16 and 8.
    unsafe {
        _mm_storeu_si128(out.cast(), _mm256_castsi256_si128(pixels));
        _mm_storel_epi64(out.add(16).cast(), _mm256_extracti128_si256::<1>(pixels));
    }
    true
}
