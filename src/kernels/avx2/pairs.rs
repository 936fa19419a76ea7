//! Bilinear of images of two channels, such as optical flow, of 8 and 16 bits and float32.
//!
//! A pixel is two lanes, so four cells fill a vector: cells 0 and 1 in the low half, cells 4 and 5 in the high half, and
//! 2, 3, 6 and 7 in a second one. All loads keep to a tap's own pixels, but for the windows of 8-bit images: where four
//! neighbouring cells look at 16 bytes of one row, `pshufb` picks all their taps from one load.

use std::arch::x86_64::*;
use std::ops::Range;

use super::bytes::{Weights, round_pairs};
use super::floats::{blend, round_u16, weights_of};
use super::{ALL, CELLS, Cells, Run, distances_within, load_halves, rows_at, vector};
use crate::kernels::places::Places;
use crate::kernels::plane::Plane;
use crate::kernels::{Source, scalar};
use crate::table::Tap;

/// Bytes of a window.
const WINDOW: usize = 16;

/// Each lane twice: those of cells 0, 1, 4 and 5, and those of cells 2, 3, 6 and 7.
#[inline]
#[target_feature(enable = "avx2")]
fn twice(lanes: __m256i) -> (__m256i, __m256i) {
    (_mm256_unpacklo_epi32(lanes, lanes), _mm256_unpackhi_epi32(lanes, lanes))
}

/// [`twice`] of weights along x and y.
#[inline]
#[target_feature(enable = "avx2")]
fn weights_twice((x, y): (__m256, __m256)) -> [(__m256, __m256); 2] {
    [(_mm256_unpacklo_ps(x, x), _mm256_unpacklo_ps(y, y)), (_mm256_unpackhi_ps(x, x), _mm256_unpackhi_ps(y, y))]
}

/// Cells whose four pixels exist, of an 8-bit image of two channels.
///
/// # Safety
/// The CPU has AVX2.
#[target_feature(enable = "avx2")]
pub(in crate::kernels) fn bilinear_u8_pairs(source: &Source<'_, u8>, taps: &[Tap], cells: &mut [u8]) {
    let scalar = scalar::bilinear::<u8, &[Tap], 2, false>;
    let plane = Plane::new(source).filter(|_| taps.len() >= CELLS);
    let Some(plane) = plane else { return scalar(source, taps, cells) };
    Run::<_, 2, 1> { plane: &plane, limit: plane.limit(WINDOW), taps, cells }.for_each_group(
        |_, group| (group.offsets, Weights::new(group.fractions)),
        |positions, weights, cells| blend_u8(&plane, positions, weights, cells),
        |range, cells| scalar(source, &taps[range], cells),
    );
}

/// Eight cells of 8 bits.
#[inline]
#[target_feature(enable = "avx2")]
fn blend_u8(plane: &Plane<'_>, at: &Cells<'_>, weights: &Weights, cells: &mut [u8]) {
    assert_eq!(cells.len(), 2 * CELLS);
    let ((top, next_top), (bottom, next_bottom)) = (twice(weights.top), twice(weights.bottom));
    let (weights, next_weights) = (Weights { top, bottom }, Weights { top: next_top, bottom: next_bottom });
    // bytes of the two lanes of a pixel: right, nothing, left, nothing
    const FIRST: i64 = 0x8000_8002_u32 as i64;
    const SECOND: i64 = 0x8001_8003_u32 as i64;
    let (sums, next_sums) = if let Some(distances) = distances_within(vector(at.positions), WINDOW as i32 - 4) {
        let (low, high) = at.lowest::<2>(plane);
        let (low, high) = (rows_at(plane, low), rows_at(plane, high));
        // SAFETY: both are positions of taps, which the caller checked against `Plane::limit(WINDOW)`: 16 bytes exist from
        // there on.
        let top = unsafe { load_halves(low.0.cast(), high.0.cast()) };
        // SAFETY: and so do they one row below.
        let bottom = unsafe { load_halves(low.1.cast(), high.1.cast()) };
        let both = _mm256_or_si256(distances, _mm256_slli_epi32::<16>(distances));
        let (both, next) = twice(both);
        let spread = _mm256_set1_epi64x(SECOND << 32 | FIRST);
        let (pick, next) = (_mm256_add_epi32(both, spread), _mm256_add_epi32(next, spread));
        (
            weights.sums(_mm256_shuffle_epi8(top, pick), _mm256_shuffle_epi8(bottom, pick)),
            next_weights.sums(_mm256_shuffle_epi8(top, next), _mm256_shuffle_epi8(bottom, next)),
        )
    } else {
        let at = at.early_positions::<2, CELLS>(plane, ALL);
        let row = |row: isize| {
            let pair = |cell: usize| {
                let from = plane.start().wrapping_offset(row).wrapping_add(at[cell]);
                // SAFETY: a tap of the table has two pixels, 4 bytes, in this row and in the one below.
                unsafe { from.cast::<i32>().read_unaligned() }
            };
            let four = |a: usize| {
                let two = _mm_insert_epi32::<1>(_mm_cvtsi32_si128(pair(a)), pair(a + 1));
                _mm_insert_epi32::<3>(_mm_insert_epi32::<2>(two, pair(a + 2)), pair(a + 3))
            };
            _mm256_set_m128i(four(4), four(0))
        };
        let (top, bottom) = (row(0), row(plane.row_stride));
        #[rustfmt::skip]
        let (pick, next) = (
            _mm_setr_epi8(2, -1, 0, -1, 3, -1, 1, -1, 6, -1, 4, -1, 7, -1, 5, -1),
            _mm_setr_epi8(10, -1, 8, -1, 11, -1, 9, -1, 14, -1, 12, -1, 15, -1, 13, -1),
        );
        let (pick, next) = (_mm256_broadcastsi128_si256(pick), _mm256_broadcastsi128_si256(next));
        (
            weights.sums(_mm256_shuffle_epi8(top, pick), _mm256_shuffle_epi8(bottom, pick)),
            next_weights.sums(_mm256_shuffle_epi8(top, next), _mm256_shuffle_epi8(bottom, next)),
        )
    };
    // 16-bit lanes of a half: those of the first two cells in the even, of the next two in the odd ones
    let rounded = round_pairs(sums, next_sums);
    let order = _mm_setr_epi8(0, 4, 8, 12, 2, 6, 10, 14, -1, -1, -1, -1, -1, -1, -1, -1);
    let pixels = _mm256_shuffle_epi8(rounded, _mm256_broadcastsi128_si256(order));
    let pixels = _mm_unpacklo_epi64(_mm256_castsi256_si128(pixels), _mm256_extracti128_si256::<1>(pixels));
    // SAFETY: `cells` holds 16 bytes.
    unsafe { _mm_storeu_si128(cells.as_mut_ptr().cast(), pixels) };
}

/// Cells whose four pixels exist, of a 16-bit image of two channels.
///
/// # Safety
/// The CPU has AVX2.
#[target_feature(enable = "avx2")]
pub(in crate::kernels) fn bilinear_u16_pairs(source: &Source<'_, u16>, taps: &[Tap], cells: &mut [u16]) {
    let scalar = scalar::bilinear::<u16, &[Tap], 2, false>;
    let plane = Plane::new(source).filter(|_| taps.len() >= CELLS);
    let Some(plane) = plane else { return scalar(source, taps, cells) };
    Run::<_, 4, 1> { plane: &plane, limit: i32::MAX, taps, cells }.for_each_group(
        |_, group| (group.offsets, group.weights()),
        |positions, &weights, cells| blend_u16(&plane, positions, weights, cells),
        |range, cells| scalar(source, &taps[range], cells),
    );
}

/// Eight cells of 16 bits.
#[inline]
#[target_feature(enable = "avx2")]
fn blend_u16(plane: &Plane<'_>, at: &Cells<'_>, weights: (__m256, __m256), cells: &mut [u16]) {
    assert_eq!(cells.len(), 2 * CELLS);
    let at = at.early_positions::<4, CELLS>(plane, ALL);
    let left = _mm256_broadcastsi128_si256(_mm_setr_epi8(0, 1, -1, -1, 2, 3, -1, -1, 8, 9, -1, -1, 10, 11, -1, -1));
    let right = _mm256_broadcastsi128_si256(_mm_setr_epi8(4, 5, -1, -1, 6, 7, -1, -1, 12, 13, -1, -1, 14, 15, -1, -1));
    // of cells `a`, `a + 1`, `a + 4` and `a + 5`
    let four = |a: usize, weights: (__m256, __m256)| {
        let row = |row: isize| {
            let from = |cell: usize| plane.start().wrapping_offset(row).wrapping_add(at[cell]);
            // SAFETY: a tap of the table has two pixels, 8 bytes, in this row and in the one below.
            let two = |a: usize| unsafe { _mm_loadh_pd(_mm_load_sd(from(a).cast()), from(a + 1).cast()) };
            let pixels = _mm256_castpd_si256(_mm256_set_m128d(two(a + 4), two(a)));
            let side = |side| _mm256_cvtepi32_ps(_mm256_shuffle_epi8(pixels, side));
            (side(left), side(right))
        };
        let ((top_left, top_right), (bottom_left, bottom_right)) = (row(0), row(plane.row_stride));
        round_u16(blend(weights, [top_left, top_right, bottom_left, bottom_right]))
    };
    let [weights, next_weights] = weights_twice(weights);
    let words = _mm256_packus_epi32(four(0, weights), four(2, next_weights));
    // SAFETY: `cells` holds 32 bytes.
    unsafe { _mm256_storeu_si256(cells.as_mut_ptr().cast(), words) };
}

/// Cells whose four pixels exist, of a float image of two channels.
///
/// # Safety
/// The CPU has AVX2.
#[target_feature(enable = "avx2")]
pub(in crate::kernels) fn bilinear_f32_pairs<P: Places<f32>>(source: &Source<'_, f32>, places: P, cells: &mut [f32]) {
    let (scalar, taps) = (scalar::bilinear::<f32, P, 2, false>, places.taps());
    let plane = Plane::new(source).filter(|_| taps.len() >= CELLS);
    let Some(plane) = plane else { return scalar(source, places, cells) };
    let rest = |range: Range<usize>, cells: &mut [f32]| scalar(source, places.part(range), cells);
    Run::<_, 8, 1> { plane: &plane, limit: i32::MAX, taps, cells }.for_each_group(
        |first, group| (group.offsets, weights_of(places, first, group)),
        |positions, &weights, cells| blend_f32::<P>(&plane, positions, weights, cells),
        rest,
    );
}

/// Eight cells of floats. `P` is not looked at: compiled for one caller each, it becomes part of it.
#[inline]
#[target_feature(enable = "avx2")]
fn blend_f32<P>(plane: &Plane<'_>, at: &Cells<'_>, weights: (__m256, __m256), cells: &mut [f32]) {
    assert_eq!(cells.len(), 2 * CELLS);
    let at = at.early_positions::<8, CELLS>(plane, ALL);
    // of cells `a`, `a + 1`, `a + 4` and `a + 5`
    let four = |a: usize, weights: (__m256, __m256)| {
        let row = |row: isize| {
            let two = |a: usize| {
                let from = |cell: usize| plane.start().wrapping_offset(row).wrapping_add(at[cell]).cast();
                // SAFETY: a tap of the table has two pixels, 16 bytes, in this row and in the one below.
                _mm256_castsi256_pd(unsafe { load_halves(from(a), from(a + 4)) })
            };
            let (one, next) = (two(a), two(a + 1));
            (_mm256_castpd_ps(_mm256_unpacklo_pd(one, next)), _mm256_castpd_ps(_mm256_unpackhi_pd(one, next)))
        };
        let ((top_left, top_right), (bottom_left, bottom_right)) = (row(0), row(plane.row_stride));
        blend(weights, [top_left, top_right, bottom_left, bottom_right])
    };
    let [weights, next_weights] = weights_twice(weights);
    let (first, second) = (four(0, weights), four(2, next_weights));
    let out = cells.as_mut_ptr();
    // SAFETY: `cells` holds 64 bytes.
    unsafe {
        _mm256_storeu_ps(out, _mm256_permute2f128_ps::<0x20>(first, second));
        _mm256_storeu_ps(out.add(8), _mm256_permute2f128_ps::<0x31>(first, second));
    }
}
