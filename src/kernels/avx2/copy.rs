//! Nearest where a table has the nearest pixels as numbers, of images whose rows are back to back: nothing is left to work
//! out but the byte where a pixel begins.
//!
//! * 1 and 2 bytes, **window**: where four neighbouring cells look at 16 bytes, `pshufb` picks them from one load;
//!   elsewhere they are put together one by one;
//! * 3 bytes are loaded as 4 and put together by one shuffle for four cells (0.22 ms for the seed job; by stores that
//!   overlap 0.29);
//! * the others are copied one by one.

use std::arch::x86_64::*;

use super::nearest::{copy_pixel, copy_with_excess, loaded, pick_from_windows};
use super::{CELLS, all_at_most, load_halves, vector};
use crate::kernels::plane::Plane;
use crate::kernels::{Source, scalar};
use crate::view::{Sample, as_bytes_mut};

/// Cells whose nearest pixels are these, for pixels of `PIXEL` bytes (0: any).
///
/// # Safety
/// The CPU has AVX2.
#[target_feature(enable = "avx2")]
pub(in crate::kernels) fn copy<T: Sample, const PIXEL: usize>(source: &Source<'_, T>, pixels: &[u32], cells: &mut [T]) {
    let plane = Plane::new(source).filter(|plane| pixels.len() >= CELLS && plane.strided.is_none());
    let Some(plane) = plane else { return scalar::copy(source, pixels, cells) };
    let pixel = plane.pixel as usize;
    assert!(PIXEL == 0 || PIXEL == pixel);
    // the last pixel from which so many bytes may be loaded; -1 where there is none
    let limit = plane.bytes().checked_sub(loaded::<PIXEL>()).map_or(-1, |last| (last / pixel) as i32);
    let cells = as_bytes_mut(cells);
    assert_eq!(cells.len(), pixels.len() * pixel);
    for first in (0..pixels.len()).step_by(CELLS) {
        // the last group reaches back to be whole
        let first = first.min(pixels.len() - CELLS);
        let at = pixels[first..].first_chunk().expect("a whole group is left");
        let cells = &mut cells[first * pixel..(first + CELLS) * pixel];
        if matches!(PIXEL, 1 | 2 | 3 | 6 | 12) && all_at_most(vector(at), limit) {
            copy_group::<PIXEL>(&plane, at, cells);
        } else {
            for (cell, to) in cells.chunks_exact_mut(pixel).enumerate() {
                let from = plane.start().wrapping_add(one(at, cell) * pixel);
                // SAFETY: a table has only pixels that exist, and `to` is one; an image and its warp do not overlap.
                unsafe { copy_pixel(from, to.as_mut_ptr(), pixel) };
            }
        }
    }
}

/// The pixel of one cell, loaded by itself: volatile, or the compiler takes it out of a vector with two shuffles.
#[inline(always)]
fn one(at: &[u32; CELLS], cell: usize) -> usize {
    // SAFETY: a reference is good to read.
    unsafe { std::ptr::read_volatile(&at[cell]) as usize }
}

/// Copies eight pixels, from each of which on [`loaded`] bytes exist.
#[inline]
#[target_feature(enable = "avx2")]
fn copy_group<const PIXEL: usize>(plane: &Plane<'_>, at: &[u32; CELLS], cells: &mut [u8]) {
    assert_eq!(cells.len(), CELLS * PIXEL);
    let from = |cell: usize| plane.start().wrapping_add(one(at, cell) * PIXEL);
    match PIXEL {
        1 | 2 => {
            let positions = if PIXEL == 1 { vector(at) } else { _mm256_slli_epi32::<1>(vector(at)) };
            let window = |first, last| from(first).min(from(last)).cast();
            // SAFETY: the caller checked the pixels: 16 bytes may be loaded from any of them.
            let windows = || unsafe { load_halves(window(0, 3), window(4, 7)) };
            if !pick_from_windows::<PIXEL>(positions, windows, cells) {
                copy_small::<PIXEL>(from, cells);
            }
        }
        3 => copy_three(from, cells),
        _ => copy_with_excess::<PIXEL>(from, cells),
    }
}

/// Copies pixels of 1 or 2 bytes that lie apart.
#[inline]
#[target_feature(enable = "avx2")]
fn copy_small<const PIXEL: usize>(from: impl Fn(usize) -> *const u8, cells: &mut [u8]) {
    assert_eq!(cells.len(), CELLS * PIXEL);
    let zero = _mm_setzero_si128();
    if PIXEL == 1 {
        // SAFETY: the pixel exists.
        let byte = |cell: usize| i32::from(unsafe { from(cell).read() });
        let two = |to, a: usize| (to, byte(a), byte(a + 1));
        let (to, a, b) = two(zero, 0);
        let (to, a, b) = two(_mm_insert_epi8::<1>(_mm_insert_epi8::<0>(to, a), b), 2);
        let (to, a, b) = two(_mm_insert_epi8::<3>(_mm_insert_epi8::<2>(to, a), b), 4);
        let (to, a, b) = two(_mm_insert_epi8::<5>(_mm_insert_epi8::<4>(to, a), b), 6);
        let bytes = _mm_insert_epi8::<7>(_mm_insert_epi8::<6>(to, a), b);
        // SAFETY: `cells` holds 8 bytes.
        unsafe { _mm_storel_epi64(cells.as_mut_ptr().cast(), bytes) };
    } else {
        // SAFETY: the pixel exists, and has 2 bytes.
        let word = |cell: usize| i32::from(unsafe { from(cell).cast::<u16>().read_unaligned() });
        let four = |a: usize| {
            let two = _mm_insert_epi16::<1>(_mm_insert_epi16::<0>(zero, word(a)), word(a + 1));
            _mm_insert_epi16::<3>(_mm_insert_epi16::<2>(two, word(a + 2)), word(a + 3))
        };
        // SAFETY: `cells` holds 16 bytes.
        unsafe { _mm_storeu_si128(cells.as_mut_ptr().cast(), _mm_unpacklo_epi64(four(0), four(4))) };
    }
}

/// Copies pixels of 3 bytes, from each of which on 4 may be loaded.
#[inline]
#[target_feature(enable = "avx2")]
fn copy_three(from: impl Fn(usize) -> *const u8, cells: &mut [u8]) {
    assert_eq!(cells.len(), CELLS * 3);
    let order = _mm_setr_epi8(0, 1, 2, 4, 5, 6, 8, 9, 10, 12, 13, 14, -1, -1, -1, -1);
    // SAFETY: the caller's promise.
    let load = |cell: usize| _mm_cvtsi32_si128(unsafe { from(cell).cast::<i32>().read_unaligned() });
    let two = |cell: usize| _mm_unpacklo_epi32(load(cell), load(cell + 1));
    let four = |cell: usize| _mm_shuffle_epi8(_mm_unpacklo_epi64(two(cell), two(cell + 2)), order);
    let (low, high) = (four(0), four(4));
    let out = cells.as_mut_ptr();
    // SAFETY: `cells` holds 24 bytes: 16, of which the last 4 are written over, and from 12 on 8 and 4.
    unsafe {
        _mm_storeu_si128(out.cast(), low);
        _mm_storel_epi64(out.add(12).cast(), high);
        _mm_storeu_si32(out.add(20), _mm_unpackhi_epi64(high, high));
    }
}
