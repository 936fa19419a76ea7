//! Bilinear of float32 and 16-bit images: the expression of the scalar kernel, nothing fused. 16-bit pixels become
//! float32 on the way in.
//!
//! * 1 channel: each pair of pixels is loaded by itself, eight cells to a vector;
//! * 3 and 4 channels: a pixel is half a vector, two cells to a vector;
//! * otherwise the channels of one cell fill the vector.

use std::arch::x86_64::*;
use std::ops::Range;

use super::{ALL, CELLS, Cells, Group, Run, for_each_chunk, load_halves, opaque, rows_at};
use crate::kernels::places::Places;
use crate::kernels::plane::Plane;
use crate::kernels::{Source, scalar};
use crate::table::Tap;

/// `a + (b - a) t`.
#[inline]
#[target_feature(enable = "avx2")]
fn mix(a: __m256, b: __m256, t: __m256) -> __m256 {
    _mm256_add_ps(a, _mm256_mul_ps(_mm256_sub_ps(b, a), t))
}

/// Pixels: top left, top right, bottom left, bottom right.
#[inline]
#[target_feature(enable = "avx2")]
pub(super) fn blend((x, y): (__m256, __m256), pixels: [__m256; 4]) -> __m256 {
    let [top_left, top_right, bottom_left, bottom_right] = pixels;
    mix(mix(top_left, top_right, x), mix(bottom_left, bottom_right, x), y)
}

/// The weights of cells `QUARTER` (as a shuffle) and 4 + that, each in all four lanes of its half.
#[inline]
#[target_feature(enable = "avx2")]
fn quarter<const QUARTER: i32>((x, y): (__m256, __m256)) -> (__m256, __m256) {
    (_mm256_permute_ps::<QUARTER>(x), _mm256_permute_ps::<QUARTER>(y))
}

/// Cells whose four pixels exist, of a float image of 1, 3 or 4 channels.
///
/// # Safety
/// The CPU has AVX2.
#[target_feature(enable = "avx2")]
pub(in crate::kernels) fn bilinear_f32<P: Places<f32>, const CHANNELS: usize>(
    source: &Source<'_, f32>,
    places: P,
    cells: &mut [f32],
) {
    // 16 bytes from the right pixel where it has 12; otherwise just two pixels, which exist
    let loaded = if CHANNELS == 3 { 28 } else { 0 };
    match CHANNELS {
        1 => blend_run_f32::<P, 1, 4>(source, loaded, places, cells),
        3 => blend_run_f32::<P, 3, 12>(source, loaded, places, cells),
        _ => blend_run_f32::<P, 4, 16>(source, loaded, places, cells),
    }
}

/// Blends a run; `loaded` bytes are loaded from a position, there and one row
/// below (0: no more than a tap's pixels).
#[inline]
#[target_feature(enable = "avx2")]
fn blend_run_f32<P: Places<f32>, const CHANNELS: usize, const PIXEL: usize>(
    source: &Source<'_, f32>,
    loaded: usize,
    places: P,
    cells: &mut [f32],
) {
    let (scalar, taps) = (scalar::bilinear::<f32, P, CHANNELS, false>, places.taps());
    let plane = Plane::new(source).filter(|_| taps.len() >= CELLS);
    let Some(plane) = plane else { return scalar(source, places, cells) };
    let limit = if loaded == 0 { i32::MAX } else { plane.limit(loaded) };
    Run::<_, PIXEL, 1> { plane: &plane, limit, taps, cells }.for_each_group(
        |first, group| (group.offsets, weights_of(places, first, group)),
        |positions, &weights, cells| {
            if CHANNELS == 1 {
                blend_one_f32::<P>(&plane, positions, weights, cells);
            } else {
                blend_colour_f32::<P, CHANNELS, PIXEL>(&plane, positions, weights, cells);
            }
        },
        |range, cells| scalar(source, places.part(range), cells),
    );
}

/// Cells whose four pixels exist, of four float images of one channel and of one size: what a tap means is worked out once
/// for all of them.
///
/// # Safety
/// The CPU has AVX2.
#[target_feature(enable = "avx2")]
pub(in crate::kernels) fn bilinear_f32_planes(sources: &[Source<'_, f32>; 4], taps: &[Tap], cells: [&mut [f32]; 4]) {
    let planes = [Plane::new(&sources[0]), Plane::new(&sources[1]), Plane::new(&sources[2]), Plane::new(&sources[3])];
    let ([Some(a), Some(b), Some(c), Some(d)], CELLS..) = (planes, taps.len()) else {
        for (source, cells) in sources.iter().zip(cells) {
            scalar::bilinear::<f32, &[Tap], 1, false>(source, taps, cells);
        }
        return;
    };
    let planes = [a, b, c, d];
    for plane in &planes {
        assert!(plane.strided.is_none() && plane.pixel == 4 && plane.row_stride == planes[0].row_stride);
    }
    for first in (0..taps.len()).step_by(CELLS) {
        // the last group reaches back to be whole
        let first = first.min(taps.len() - CELLS);
        let group = taps[first..].first_chunk::<CELLS>().expect("a whole group is left");
        let weights = Group::load(group).weights();
        let mut at = [0; CELLS];
        // a loop, not `map`: what is called from code without AVX2 is not inlined there
        for (position, tap) in at.iter_mut().zip(group) {
            // SAFETY: a reference is good to read.
            *position = 4 * unsafe { std::ptr::read_volatile(&tap.offset) as usize };
        }
        blend_pairs_f32(&planes[0], &at, weights, &mut cells[0][first..first + CELLS]);
        blend_pairs_f32(&planes[1], &at, weights, &mut cells[1][first..first + CELLS]);
        blend_pairs_f32(&planes[2], &at, weights, &mut cells[2][first..first + CELLS]);
        blend_pairs_f32(&planes[3], &at, weights, &mut cells[3][first..first + CELLS]);
    }
}

/// Eight cells of one channel. `P` is not looked at: compiled for one caller each, it becomes part of it, and weights stay
/// in registers.
#[inline]
#[target_feature(enable = "avx2")]
fn blend_one_f32<P>(plane: &Plane<'_>, at: &Cells<'_>, weights: (__m256, __m256), cells: &mut [f32]) {
    blend_pairs_f32(plane, &at.early_positions::<4, CELLS>(plane, ALL), weights, cells);
}

/// Eight cells of one channel from the pairs of pixels at these positions, which are those of taps.
#[inline]
#[target_feature(enable = "avx2")]
fn blend_pairs_f32(plane: &Plane<'_>, at: &[usize; CELLS], weights: (__m256, __m256), cells: &mut [f32]) {
    assert_eq!(cells.len(), CELLS);
    let pairs = |row: isize| {
        let at = |cell: usize| plane.start().wrapping_offset(row).wrapping_add(at[cell]);
        // SAFETY: a tap of the table has two pixels, 8 bytes, in this row and in the one below.
        let two = |a: usize| unsafe { _mm_loadh_pd(_mm_load_sd(at(a).cast()), at(a + 1).cast()) };
        let four = |a: usize| _mm256_castpd_ps(_mm256_set_m128d(two(a + 4), two(a)));
        let (first, second) = (four(0), four(2));
        (_mm256_shuffle_ps::<0b10_00_10_00>(first, second), _mm256_shuffle_ps::<0b11_01_11_01>(first, second))
    };
    let ((top_left, top_right), (bottom_left, bottom_right)) = (pairs(0), pairs(plane.row_stride));
    let blended = blend(weights, [top_left, top_right, bottom_left, bottom_right]);
    // SAFETY: `cells` holds 32 bytes.
    unsafe { _mm256_storeu_ps(cells.as_mut_ptr(), blended) };
}

/// Eight cells of 3 or 4 channels; `P` as in [`blend_one_f32`].
#[inline]
#[target_feature(enable = "avx2")]
fn blend_colour_f32<P, const CHANNELS: usize, const PIXEL: usize>(
    plane: &Plane<'_>,
    at: &Cells<'_>,
    weights: (__m256, __m256),
    cells: &mut [f32],
) {
    assert_eq!(cells.len(), CELLS * CHANNELS);
    let at = at.early_positions::<PIXEL, CELLS>(plane, ALL);
    let two = |cell: usize, weights: (__m256, __m256)| {
        let pixels = |one: *const u8, other: *const u8, channel: usize| {
            // SAFETY: the caller checked every position for two pixels, and a third's first channel where there are
            // three channels, in both rows.
            let halves = unsafe { load_halves(one.add(4 * channel).cast(), other.add(4 * channel).cast()) };
            _mm256_castsi256_ps(opaque(halves))
        };
        let ((top, bottom), (other_top, other_bottom)) = (rows_at(plane, at[cell]), rows_at(plane, at[cell + 4]));
        let left = |one, other| pixels(one, other, 0);
        let right = |one, other| pixels(one, other, CHANNELS);
        blend(
            weights,
            [left(top, other_top), right(top, other_top), left(bottom, other_bottom), right(bottom, other_bottom)],
        )
    };
    let blends = [
        two(0, quarter::<0b00_00_00_00>(weights)),
        two(1, quarter::<0b01_01_01_01>(weights)),
        two(2, quarter::<0b10_10_10_10>(weights)),
        two(3, quarter::<0b11_11_11_11>(weights)),
    ];
    let out = cells.as_mut_ptr();
    for (cell, blend) in blends.into_iter().enumerate() {
        // SAFETY: `cells` holds eight pixels; a fourth channel that is not there is the next cell's first, which is
        // written later.
        unsafe { _mm_storeu_ps(out.add(cell * CHANNELS), _mm256_castps256_ps128(blend)) };
    }
    for (cell, blend) in (4..).zip(blends) {
        let (pixel, at) = (_mm256_extractf128_ps::<1>(blend), out.wrapping_add(cell * CHANNELS));
        if cell == CELLS - 1 && CHANNELS == 3 {
            // SAFETY: the last pixel of `cells`: 8 bytes and 4.
            unsafe {
                _mm_storel_pd(at.cast(), _mm_castps_pd(pixel));
                _mm_store_ss(at.add(2), _mm_movehl_ps(pixel, pixel));
            }
        } else {
            // SAFETY: as above.
            unsafe { _mm_storeu_ps(at, pixel) };
        }
    }
}

/// Cells whose four pixels exist, of a float image of four channels or more.
///
/// # Safety
/// The CPU has AVX2.
#[target_feature(enable = "avx2")]
pub(in crate::kernels) fn bilinear_f32_any<P: Places<f32>>(source: &Source<'_, f32>, places: P, cells: &mut [f32]) {
    let (channels, taps) = (source.channels(), places.taps());
    let scalar = scalar::bilinear::<f32, P, 0, false>;
    let plane = Plane::new(source).filter(|_| taps.len() >= CELLS && channels >= 4);
    let Some(plane) = plane else { return scalar(source, places, cells) };
    let fill = |at: &Cells<'_>, (x, y): &([f32; CELLS], [f32; CELLS]), cells: &mut [f32]| {
        for (cell, out) in cells.chunks_exact_mut(channels).enumerate() {
            let ((top, bottom), out) = (rows_at(&plane, at.position(cell)), out.as_mut_ptr());
            let (top, bottom) = (top.cast::<f32>(), bottom.cast::<f32>());
            let weights = (_mm256_set1_ps(x[cell]), _mm256_set1_ps(y[cell]));
            let eight = |first: usize| {
                // SAFETY: `first + 8 <= channels`, and a tap of the table has two pixels of so many samples in this row
                // and in the one below; the cell has one.
                let load = |at: *const f32| unsafe { _mm256_loadu_ps(at.add(first)) };
                let right = |left: *const f32| load(left.wrapping_add(channels));
                let pixels = [load(top), right(top), load(bottom), right(bottom)];
                // SAFETY: as above.
                unsafe { _mm256_storeu_ps(out.add(first), blend(weights, pixels)) };
            };
            let four = |first: usize| {
                // SAFETY: as above, with `first + 4 <= channels`.
                let load = |at: *const f32| unsafe { _mm256_castps128_ps256(_mm_loadu_ps(at.add(first))) };
                let right = |left: *const f32| load(left.wrapping_add(channels));
                let pixels = [load(top), right(top), load(bottom), right(bottom)];
                // SAFETY: as above.
                unsafe { _mm_storeu_ps(out.add(first), _mm256_castps256_ps128(blend(weights, pixels))) };
            };
            for_each_chunk(channels, eight, four);
        }
    };
    let prepare = |first, group: &Group| (group.offsets, weight_lanes(weights_of(places, first, group)));
    let rest = |range: Range<usize>, cells: &mut [f32]| scalar(source, places.part(range), cells);
    Run::<_, 0, 8> { plane: &plane, limit: i32::MAX, taps, cells }.for_each_group(prepare, fill, rest);
}

/// The weights of a group whose first cell is `first`.
#[inline]
#[target_feature(enable = "avx2")]
pub(super) fn weights_of<P: Places<f32>>(places: P, first: usize, group: &Group) -> (__m256, __m256) {
    match places.floats::<CELLS>(first) {
        // SAFETY: eight numbers are 32 bytes; the loads need no alignment.
        Some([x, y]) => unsafe { (_mm256_loadu_ps(x.as_ptr()), _mm256_loadu_ps(y.as_ptr())) },
        None => group.weights(),
    }
}

/// Weights as arrays.
#[inline]
#[target_feature(enable = "avx2")]
fn weight_lanes((x, y): (__m256, __m256)) -> ([f32; CELLS], [f32; CELLS]) {
    let mut lanes = ([0.0; CELLS], [0.0; CELLS]);
    // SAFETY: eight lanes are 32 bytes.
    unsafe {
        _mm256_storeu_ps(lanes.0.as_mut_ptr(), x);
        _mm256_storeu_ps(lanes.1.as_mut_ptr(), y);
    }
    lanes
}

/// The 16-bit result of a blend, in 32 bits: rounded as the scalar kernel does it.
#[inline]
#[target_feature(enable = "avx2")]
pub(super) fn round_u16(blend: __m256) -> __m256i {
    _mm256_cvttps_epi32(_mm256_add_ps(blend, _mm256_set1_ps(0.5)))
}

/// Cells whose four pixels exist, of a 16-bit image of 1, 3 or 4 channels.
///
/// # Safety
/// The CPU has AVX2.
#[target_feature(enable = "avx2")]
pub(in crate::kernels) fn bilinear_u16<const CHANNELS: usize>(
    source: &Source<'_, u16>,
    taps: &[Tap],
    cells: &mut [u16],
) {
    // two pixels of each row, of which those of 6 bytes are loaded together with 4 more
    let loaded = if CHANNELS == 1 { 0 } else { 16 };
    match CHANNELS {
        1 => blend_run_u16::<1, 2>(source, loaded, taps, cells),
        3 => blend_run_u16::<3, 6>(source, loaded, taps, cells),
        _ => blend_run_u16::<4, 8>(source, loaded, taps, cells),
    }
}

/// Blends a run; `loaded` bytes are loaded from a position, there and one row
/// below (0: no more than a tap's pixels).
#[inline]
#[target_feature(enable = "avx2")]
fn blend_run_u16<const CHANNELS: usize, const PIXEL: usize>(
    source: &Source<'_, u16>,
    loaded: usize,
    taps: &[Tap],
    cells: &mut [u16],
) {
    let scalar = scalar::bilinear::<u16, &[Tap], CHANNELS, false>;
    let plane = Plane::new(source).filter(|_| taps.len() >= CELLS);
    let Some(plane) = plane else { return scalar(source, taps, cells) };
    let limit = if loaded == 0 { i32::MAX } else { plane.limit(loaded) };
    Run::<_, PIXEL, 1> { plane: &plane, limit, taps, cells }.for_each_group(
        |_, group| (group.offsets, group.weights()),
        |positions, &weights, cells| {
            if CHANNELS == 1 {
                blend_one_u16(&plane, positions, weights, cells);
            } else {
                blend_colour_u16::<CHANNELS, PIXEL>(&plane, positions, weights, cells);
            }
        },
        |range, cells| scalar(source, &taps[range], cells),
    );
}

/// Eight cells of one channel.
#[inline]
#[target_feature(enable = "avx2")]
fn blend_one_u16(plane: &Plane<'_>, at: &Cells<'_>, weights: (__m256, __m256), cells: &mut [u16]) {
    assert_eq!(cells.len(), CELLS);
    let at = at.early_positions::<2, CELLS>(plane, ALL);
    // a lane of either row is the left pixel in its low and the right pixel in its high half
    let pairs = |row: isize| {
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
    let (top, bottom) = (pairs(0), pairs(plane.row_stride));
    let left = |row| _mm256_cvtepi32_ps(_mm256_and_si256(row, _mm256_set1_epi32(0xffff)));
    let right = |row| _mm256_cvtepi32_ps(_mm256_srli_epi32::<16>(row));
    let rounded = round_u16(blend(weights, [left(top), right(top), left(bottom), right(bottom)]));
    let words = _mm_packus_epi32(_mm256_castsi256_si128(rounded), _mm256_extracti128_si256::<1>(rounded));
    // SAFETY: `cells` holds 16 bytes.
    unsafe { _mm_storeu_si128(cells.as_mut_ptr().cast(), words) };
}

/// Eight cells of 3 or 4 channels.
#[inline]
#[target_feature(enable = "avx2")]
fn blend_colour_u16<const CHANNELS: usize, const PIXEL: usize>(
    plane: &Plane<'_>,
    at: &Cells<'_>,
    weights: (__m256, __m256),
    cells: &mut [u16],
) {
    assert_eq!(cells.len(), CELLS * CHANNELS);
    let at = at.early_positions::<PIXEL, CELLS>(plane, ALL);
    #[rustfmt::skip]
    let (left, right) = if CHANNELS == 3 {
        (
            _mm_setr_epi8(0, 1, -1, -1, 2, 3, -1, -1, 4, 5, -1, -1, -1, -1, -1, -1),
            _mm_setr_epi8(6, 7, -1, -1, 8, 9, -1, -1, 10, 11, -1, -1, -1, -1, -1, -1),
        )
    } else {
        (
            _mm_setr_epi8(0, 1, -1, -1, 2, 3, -1, -1, 4, 5, -1, -1, 6, 7, -1, -1),
            _mm_setr_epi8(8, 9, -1, -1, 10, 11, -1, -1, 12, 13, -1, -1, 14, 15, -1, -1),
        )
    };
    let (left, right) = (_mm256_broadcastsi128_si256(left), _mm256_broadcastsi128_si256(right));
    let two = |cell: usize, weights: (__m256, __m256)| {
        // SAFETY: the caller checked every position for 16 bytes in both rows.
        let load = |one: *const u8, other: *const u8| opaque(unsafe { load_halves(one.cast(), other.cast()) });
        let ((top, bottom), (other_top, other_bottom)) = (rows_at(plane, at[cell]), rows_at(plane, at[cell + 4]));
        let (top, bottom) = (load(top, other_top), load(bottom, other_bottom));
        let pixel = |row, side| _mm256_cvtepi32_ps(_mm256_shuffle_epi8(row, side));
        let pixels = [pixel(top, left), pixel(top, right), pixel(bottom, left), pixel(bottom, right)];
        round_u16(blend(weights, pixels))
    };
    // halves: cells 0 and 1, cells 4 and 5
    let first =
        _mm256_packus_epi32(two(0, quarter::<0b00_00_00_00>(weights)), two(1, quarter::<0b01_01_01_01>(weights)));
    // halves: cells 2 and 3, cells 6 and 7
    let second =
        _mm256_packus_epi32(two(2, quarter::<0b10_10_10_10>(weights)), two(3, quarter::<0b11_11_11_11>(weights)));
    let out = cells.as_mut_ptr();
    let order = if CHANNELS == 3 {
        _mm_setr_epi8(0, 1, 2, 3, 4, 5, 8, 9, 10, 11, 12, 13, -1, -1, -1, -1)
    } else {
        _mm_setr_epi8(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15)
    };
    let order = _mm256_broadcastsi128_si256(order);
    let (first, second) = (_mm256_shuffle_epi8(first, order), _mm256_shuffle_epi8(second, order));
    let store = |cell: usize, half: __m128i| {
        let at = out.wrapping_add(cell * CHANNELS);
        if CHANNELS == 3 && cell == 6 {
            // SAFETY: the last two pixels of `cells`: 8 bytes and 4.
            unsafe {
                _mm_storel_epi64(at.cast(), half);
                _mm_storeu_si32(at.add(4).cast(), _mm_unpackhi_epi64(half, half));
            }
        } else {
            // SAFETY: `cells` holds eight pixels; what follows two pixels of three channels is written later.
            unsafe { _mm_storeu_si128(at.cast(), half) };
        }
    };
    store(0, _mm256_castsi256_si128(first));
    store(2, _mm256_castsi256_si128(second));
    store(4, _mm256_extracti128_si256::<1>(first));
    store(6, _mm256_extracti128_si256::<1>(second));
}

/// Cells whose four pixels exist, of a 16-bit image of four channels or more.
///
/// # Safety
/// The CPU has AVX2.
#[target_feature(enable = "avx2")]
pub(in crate::kernels) fn bilinear_u16_any(source: &Source<'_, u16>, taps: &[Tap], cells: &mut [u16]) {
    let channels = source.channels();
    let scalar = scalar::bilinear::<u16, &[Tap], 0, false>;
    let plane = Plane::new(source).filter(|_| taps.len() >= CELLS && channels >= 4);
    let Some(plane) = plane else { return scalar(source, taps, cells) };
    let fill = |at: &Cells<'_>, (x, y): &([f32; CELLS], [f32; CELLS]), cells: &mut [u16]| {
        for (cell, out) in cells.chunks_exact_mut(channels).enumerate() {
            let ((top, bottom), out) = (rows_at(&plane, at.position(cell)), out.as_mut_ptr());
            let (top, bottom) = (top.cast::<u16>(), bottom.cast::<u16>());
            let weights = (_mm256_set1_ps(x[cell]), _mm256_set1_ps(y[cell]));
            let float = |words| _mm256_cvtepi32_ps(_mm256_cvtepu16_epi32(words));
            let pack =
                |rounded| _mm_packus_epi32(_mm256_castsi256_si128(rounded), _mm256_extracti128_si256::<1>(rounded));
            let eight = |first: usize| {
                // SAFETY: `first + 8 <= channels`, and a tap of the table has two pixels of so many samples in this row
                // and in the one below; the cell has one.
                let load = |at: *const u16| float(unsafe { _mm_loadu_si128(at.add(first).cast()) });
                let right = |left: *const u16| load(left.wrapping_add(channels));
                let words = pack(round_u16(blend(weights, [load(top), right(top), load(bottom), right(bottom)])));
                // SAFETY: as above.
                unsafe { _mm_storeu_si128(out.add(first).cast(), words) };
            };
            let four = |first: usize| {
                // SAFETY: as above, with `first + 4 <= channels`.
                let load = |at: *const u16| float(unsafe { _mm_loadl_epi64(at.add(first).cast()) });
                let right = |left: *const u16| load(left.wrapping_add(channels));
                let words = pack(round_u16(blend(weights, [load(top), right(top), load(bottom), right(bottom)])));
                // SAFETY: as above.
                unsafe { _mm_storel_epi64(out.add(first).cast(), words) };
            };
            for_each_chunk(channels, eight, four);
        }
    };
    let prepare = |_, group: &Group| (group.offsets, weight_lanes(group.weights()));
    let rest = |range: Range<usize>, cells: &mut [u16]| scalar(source, &taps[range], cells);
    Run::<_, 0, 8> { plane: &plane, limit: i32::MAX, taps, cells }.for_each_group(prepare, fill, rest);
}
