//! Bilinear of 8-bit images.
//!
//! Two pixels that lie side by side and their weights are the two 16-bit halves of a lane, so `pmaddwd` blends them:
//! one for the top row, one for the bottom row, and their sum is the exact sum of the scalar kernel. The right pixel
//! comes first, because so the weights fall into place with one blend for each row.
//!
//! Pixels get into lanes in one of three ways:
//!
//! * 5 channels and more: the channels of one cell fill the vector;
//! * 3 and 4 channels: 16 bytes from either row for each cell, two cells to a vector, and `pshufb` spreads them;
//! * 1 channel, **window**: where eight, or four, neighbouring cells look at 16 bytes of one row (up to 2 and 4.6 pixels
//!   apart), `pshufb` picks all their taps from one load;
//! * 1 channel, **gather**: elsewhere each pair of pixels is loaded by itself.

use std::arch::x86_64::*;
use std::ops::Range;

use super::{
    ALL, CELLS, Cells, Group, Run, distances_within, for_each_chunk, lanes, load_halves, opaque, rows_at, vector,
};
use crate::kernels::plane::Plane;
use crate::kernels::{Source, scalar};
use crate::table::Tap;

/// Bytes that the widest load touches beyond a position.
pub(super) const LOADED: usize = 16;

/// Cells whose four pixels exist, of an image of 1, 3 or 4 channels.
///
/// # Safety
/// The CPU has AVX2.
#[target_feature(enable = "avx2")]
pub(in crate::kernels) fn bilinear_u8<const CHANNELS: usize>(source: &Source<'_, u8>, taps: &[Tap], cells: &mut [u8]) {
    if CHANNELS == 1 {
        blend_run::<CHANNELS, 1>(source, taps, cells);
    } else {
        blend_run::<CHANNELS, 8>(source, taps, cells);
    }
}

/// Blends a run in blocks of so many groups.
#[inline]
#[target_feature(enable = "avx2")]
fn blend_run<const CHANNELS: usize, const GROUPS: usize>(source: &Source<'_, u8>, taps: &[Tap], cells: &mut [u8]) {
    let scalar = scalar::bilinear::<u8, &[Tap], CHANNELS, false>;
    let plane = Plane::new(source).filter(|_| taps.len() >= CELLS);
    let Some(plane) = plane else { return scalar(source, taps, cells) };
    Run::<_, CHANNELS, GROUPS> { plane: &plane, limit: plane.limit(LOADED), taps, cells }.for_each_group(
        |_, group| (group.offsets, Weights::new(group.fractions)),
        |positions, weights, cells| {
            if CHANNELS == 1 {
                blend_gray(&plane, positions, weights, cells);
            } else {
                blend_colour::<CHANNELS>(&plane, positions, weights, cells);
            }
        },
        |range, cells| scalar(source, &taps[range], cells),
    );
}

/// The weights of eight cells. 32768 does not fit and is 32767, which changes no result: `32767 p + 2^14` is still at
/// least `32768 p` for every 8-bit p.
#[derive(Clone, Copy)]
pub(super) struct Weights {
    /// Top right in the low half of each lane, top left in the high half.
    pub(super) top: __m256i,
    /// Bottom right in the low half, bottom left in the high half.
    pub(super) bottom: __m256i,
}

impl Weights {
    #[inline]
    #[target_feature(enable = "avx2")]
    pub(super) fn new(fractions: __m256i) -> Self {
        #[rustfmt::skip]
        let swap = _mm256_setr_epi8(
            2, 3, 0, 1, 6, 7, 4, 5, 10, 11, 8, 9, 14, 15, 12, 13,
            2, 3, 0, 1, 6, 7, 4, 5, 10, 11, 8, 9, 14, 15, 12, 13,
        );
        // in 16-bit halves of a lane, low | high:
        let xy = _mm256_and_si256(fractions, _mm256_set1_epi16(0x7fff)); // fx | fy
        let yx = _mm256_shuffle_epi8(xy, swap); // fy | fx
        let both = _mm256_mulhrs_epi16(xy, yx); // w11 | w11 = (fx fy + 2^14) >> 15
        let one = _mm256_sub_epi16(xy, both); // w01 | w10
        let sum = _mm256_add_epi16(one, yx); // fx + fy - w11, twice
        let none = _mm256_sub_epi16(_mm256_set1_epi16(i16::MIN), sum); // w00 twice: 32768 is 0x8000
        let none = _mm256_min_epu16(none, _mm256_set1_epi16(i16::MAX));
        const HIGH: i32 = 0b1010_1010;
        Self { top: _mm256_blend_epi16::<HIGH>(one, none), bottom: _mm256_blend_epi16::<HIGH>(both, one) }
    }

    /// The Q15 sums of each lane's four pixels, not rounded.
    #[inline]
    #[target_feature(enable = "avx2")]
    pub(super) fn sums(&self, top: __m256i, bottom: __m256i) -> __m256i {
        _mm256_add_epi32(_mm256_madd_epi16(top, self.top), _mm256_madd_epi16(bottom, self.bottom))
    }

    /// The weights of cells `quarter` and 4 + quarter, each in all four lanes of its half.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn quarter<const QUARTER: i32>(&self) -> Self {
        Self { top: _mm256_shuffle_epi32::<QUARTER>(self.top), bottom: _mm256_shuffle_epi32::<QUARTER>(self.bottom) }
    }
}

/// `(sum + 2^14) >> 15` of two vectors of sums, each result in 16 bits: `a` in the low and `b` in the high half of each
/// lane. Sums are below 2^23, so 15 of their bits and one rounding multiplication are enough.
#[inline]
#[target_feature(enable = "avx2")]
pub(super) fn round_pairs(a: __m256i, b: __m256i) -> __m256i {
    let high_bits = _mm256_blend_epi16::<0b1010_1010>(_mm256_srli_epi32::<8>(a), _mm256_slli_epi32::<8>(b));
    _mm256_mulhrs_epi16(high_bits, _mm256_set1_epi16(1 << 8))
}

/// Eight cells of 3 or 4 channels, four lanes to a cell.
#[inline]
#[target_feature(enable = "avx2")]
fn blend_colour<const CHANNELS: usize>(plane: &Plane<'_>, at: &Cells<'_>, weights: &Weights, cells: &mut [u8]) {
    store_colour::<CHANNELS>(colour_sums::<CHANNELS>(plane, at, weights), cells);
}

/// Their samples as 16-bit numbers, in the order that [`store_colour`] packs. All positions are within the plane's limit
/// of [`LOADED`] bytes.
#[inline]
#[target_feature(enable = "avx2")]
pub(super) fn colour_sums<const CHANNELS: usize>(plane: &Plane<'_>, at: &Cells<'_>, weights: &Weights) -> [__m256i; 2] {
    // right and left pixel of each channel as 16-bit numbers; -1 is zero
    #[rustfmt::skip]
    let spread = if CHANNELS == 3 {
        _mm_setr_epi8(3, -1, 0, -1, 4, -1, 1, -1, 5, -1, 2, -1, -1, -1, -1, -1)
    } else {
        _mm_setr_epi8(4, -1, 0, -1, 5, -1, 1, -1, 6, -1, 2, -1, 7, -1, 3, -1)
    };
    let spread = _mm256_broadcastsi128_si256(spread);
    let sums = |cell: usize, weights: Weights| {
        let ((top, bottom), (other_top, other_bottom)) =
            (rows_at(plane, at.position(cell)), rows_at(plane, at.position(cell + 4)));
        // SAFETY: the caller checked every position against `Plane::limit(LOADED)`: 16 bytes exist from there on.
        let top = unsafe { load_halves(top.cast(), other_top.cast()) };
        // SAFETY: and so do they one row below.
        let bottom = unsafe { load_halves(bottom.cast(), other_bottom.cast()) };
        let spread = |row| _mm256_shuffle_epi8(opaque(row), spread);
        weights.sums(spread(top), spread(bottom))
    };
    let first = round_pairs(sums(0, weights.quarter::<0b00_00_00_00>()), sums(1, weights.quarter::<0b01_01_01_01>()));
    let second = round_pairs(sums(2, weights.quarter::<0b10_10_10_10>()), sums(3, weights.quarter::<0b11_11_11_11>()));
    [first, second]
}

/// Packs samples of eight cells of 3 or 4 channels.
#[inline]
#[target_feature(enable = "avx2")]
pub(super) fn store_colour<const CHANNELS: usize>([first, second]: [__m256i; 2], cells: &mut [u8]) {
    assert_eq!(cells.len(), CELLS * CHANNELS);
    // a half holds r0 r1 g0 g1 b0 b1 a0 a1 r2 r3 g2 g3 b2 b3 a2 a3
    let packed = _mm256_packus_epi16(first, second);
    let out = cells.as_mut_ptr();
    if CHANNELS == 4 {
        let order = _mm_setr_epi8(0, 2, 4, 6, 1, 3, 5, 7, 8, 10, 12, 14, 9, 11, 13, 15);
        let pixels = _mm256_shuffle_epi8(packed, _mm256_broadcastsi128_si256(order));
        // SAFETY: `cells` holds 32 bytes.
        unsafe { _mm256_storeu_si256(out.cast(), pixels) };
    } else {
        let order = _mm_setr_epi8(0, 2, 4, 1, 3, 5, 8, 10, 12, 9, 11, 13, -1, -1, -1, -1);
        let halves = _mm256_shuffle_epi8(packed, _mm256_broadcastsi128_si256(order));
        let pixels = _mm256_permutevar8x32_epi32(halves, _mm256_setr_epi32(0, 1, 2, 4, 5, 6, 7, 7));
        // SAFETY: `cells` holds 24 bytes: 16 and 8.
        unsafe {
            _mm_storeu_si128(out.cast(), _mm256_castsi256_si128(pixels));
            _mm_storel_epi64(out.add(16).cast(), _mm256_extracti128_si256::<1>(pixels));
        }
    }
}

/// Eight cells of one channel, a lane to a cell.
#[inline]
#[target_feature(enable = "avx2")]
fn blend_gray(plane: &Plane<'_>, at: &Cells<'_>, weights: &Weights, cells: &mut [u8]) {
    let sums = if let Some((distances, lowest)) = window_of_eight(plane, at) {
        let (top, bottom) = rows_at(plane, lowest);
        // SAFETY: it is a position of a tap, which the caller checked against `Plane::limit(LOADED)`: 16 bytes exist from
        // there on.
        let top = _mm256_broadcastsi128_si256(unsafe { _mm_loadu_si128(top.cast()) });
        // SAFETY: and so do they one row below.
        let bottom = _mm256_broadcastsi128_si256(unsafe { _mm_loadu_si128(bottom.cast()) });
        let pick = right_and_left(distances);
        weights.sums(_mm256_shuffle_epi8(top, pick), _mm256_shuffle_epi8(bottom, pick))
    } else if let Some(distances) = distances_within(vector(at.positions), LOADED as i32 - 2) {
        let (low, high) = at.lowest::<1>(plane);
        let (low, high) = (rows_at(plane, low), rows_at(plane, high));
        // SAFETY: both are positions of taps, which the caller checked against `Plane::limit(LOADED)`: 16 bytes exist
        // from there on.
        let top = unsafe { load_halves(low.0.cast(), high.0.cast()) };
        // SAFETY: and so do they one row below.
        let bottom = unsafe { load_halves(low.1.cast(), high.1.cast()) };
        let pick = right_and_left(distances);
        weights.sums(_mm256_shuffle_epi8(top, pick), _mm256_shuffle_epi8(bottom, pick))
    } else {
        gather_pairs(plane, at, weights)
    };
    let rounded = _mm256_srli_epi32::<15>(_mm256_add_epi32(sums, _mm256_set1_epi32(1 << 14)));
    store_gray(rounded, cells);
}

/// Where all eight cells of one channel look at 16 bytes of one row, the lowest position, and how far each is from it.
#[inline]
#[target_feature(enable = "avx2")]
fn window_of_eight(plane: &Plane<'_>, at: &Cells<'_>) -> Option<(__m256i, usize)> {
    let [first, last] = at.early_positions::<1, 2>(plane, [0, CELLS - 1]);
    // cells run along a row, so the lowest is the first or, where the view is mirrored, the last
    let lowest = first.min(last);
    let distances = _mm256_sub_epi32(vector(at.positions), _mm256_set1_epi32(lowest as i32));
    let beyond = _mm256_sub_epi32(_mm256_set1_epi32(LOADED as i32 - 2), distances);
    let negative = _mm256_or_si256(distances, beyond);
    (_mm256_movemask_ps(_mm256_castsi256_ps(negative)) == 0).then_some((distances, lowest))
}

/// Which bytes of a window are each cell's right and left pixel, as 16-bit halves of a lane.
#[inline]
#[target_feature(enable = "avx2")]
fn right_and_left(distances: __m256i) -> __m256i {
    let both = _mm256_or_si256(distances, _mm256_slli_epi32::<16>(distances));
    // bytes of a lane: right, nothing, left, nothing
    _mm256_add_epi32(both, _mm256_set1_epi32(0x8000_8001_u32 as i32))
}

/// The sums of eight cells of one channel, whose pairs of pixels are loaded one by one.
#[inline]
#[target_feature(enable = "avx2")]
fn gather_pairs(plane: &Plane<'_>, at: &Cells<'_>, weights: &Weights) -> __m256i {
    let at = at.early_positions::<1, CELLS>(plane, ALL);
    let cell = |cell: usize| {
        let (top, bottom) = rows_at(plane, at[cell]);
        // SAFETY: the caller's positions were checked against `Plane::limit(LOADED)`, of which these are the first four
        // bytes of the top row and all 16 of the bottom row.
        let (top, bottom) = unsafe { (_mm_loadu_si32(top), _mm_loadu_si128(bottom.cast())) };
        _mm_unpacklo_epi16(top, bottom) // left and right of the top row, then of the bottom row
    };
    let two = |a, b| _mm_unpacklo_epi32(cell(a), cell(b));
    let four = |a| _mm_unpacklo_epi64(two(a, a + 1), two(a + 2, a + 3));
    let pixels = _mm256_set_m128i(four(4), four(0));
    // lanes are left, right, left, right; the weights' halves are right and left, top and bottom
    let left = _mm256_and_si256(pixels, _mm256_set1_epi16(0xff));
    let right = _mm256_srli_epi16::<8>(pixels);
    let by_side = |high: __m256i, low: __m256i| _mm256_blend_epi16::<0b1010_1010>(low, high);
    let left_weights = by_side(weights.bottom, _mm256_srli_epi32::<16>(weights.top));
    let right_weights = by_side(_mm256_slli_epi32::<16>(weights.bottom), weights.top);
    _mm256_add_epi32(_mm256_madd_epi16(left, left_weights), _mm256_madd_epi16(right, right_weights))
}

/// Stores the low byte of each lane.
#[inline]
#[target_feature(enable = "avx2")]
fn store_gray(lanes: __m256i, cells: &mut [u8]) {
    assert_eq!(cells.len(), CELLS);
    let low_bytes = _mm256_broadcastsi128_si256(_mm_setr_epi8(0, 4, 8, 12, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0));
    let bytes = _mm256_shuffle_epi8(lanes, low_bytes);
    let bytes = _mm_unpacklo_epi32(_mm256_castsi256_si128(bytes), _mm256_extracti128_si256::<1>(bytes));
    // SAFETY: `cells` holds 8 bytes.
    unsafe { _mm_storel_epi64(cells.as_mut_ptr().cast(), bytes) };
}

/// Cells whose four pixels exist, of an image of 5 to 8 channels: eight channels are blended, and what is too much is
/// overwritten by the next cell. In chunks of four, 5 channels took twice the time of 8.
///
/// # Safety
/// The CPU has AVX2.
#[target_feature(enable = "avx2")]
pub(in crate::kernels) fn bilinear_u8_few<const CHANNELS: usize>(
    source: &Source<'_, u8>,
    taps: &[Tap],
    cells: &mut [u8],
) {
    assert!((5..=8).contains(&CHANNELS));
    let scalar = scalar::bilinear::<u8, &[Tap], CHANNELS, false>;
    let plane = Plane::new(source).filter(|_| taps.len() >= CELLS);
    let Some(plane) = plane else { return scalar(source, taps, cells) };
    let prepare = |_, group: &Group| {
        let weights = Weights::new(group.fractions);
        (group.offsets, (lanes(weights.top), lanes(weights.bottom)))
    };
    let rest = |range: Range<usize>, cells: &mut [u8]| scalar(source, &taps[range], cells);
    // 8 bytes from the right pixel
    let limit = plane.limit(CHANNELS + 8);
    Run::<_, 0, 8> { plane: &plane, limit, taps, cells }.for_each_group(
        prepare,
        |at, weights, cells| blend_few::<CHANNELS>(&plane, at, weights, cells),
        rest,
    );
}

/// Eight cells of 5 to 8 channels, of weights for the top and for the bottom row.
#[inline]
#[target_feature(enable = "avx2")]
fn blend_few<const CHANNELS: usize>(
    plane: &Plane<'_>,
    at: &Cells<'_>,
    (top_weights, bottom_weights): &([u32; CELLS], [u32; CELLS]),
    cells: &mut [u8],
) {
    assert_eq!(cells.len(), CELLS * CHANNELS);
    let sums = |cell: usize| {
        let (top, bottom) = rows_at(plane, at.position(cell));
        // SAFETY: the caller checked every position against `Plane::limit(CHANNELS + 8)`: 8 bytes exist from either pixel
        // on, there and one row below.
        let load = |at: *const u8| unsafe { _mm_loadl_epi64(at.cast()) };
        let pair =
            |left: *const u8| _mm256_cvtepu8_epi16(_mm_unpacklo_epi8(load(left.wrapping_add(CHANNELS)), load(left)));
        let weights = Weights {
            top: _mm256_set1_epi32(top_weights[cell] as i32),
            bottom: _mm256_set1_epi32(bottom_weights[cell] as i32),
        };
        weights.sums(pair(top), pair(bottom))
    };
    let order = _mm256_broadcastsi128_si256(_mm_setr_epi8(0, 4, 8, 12, 2, 6, 10, 14, -1, -1, -1, -1, -1, -1, -1, -1));
    let out = cells.as_mut_ptr();
    for cell in (0..CELLS).step_by(2) {
        // of a half, the first four channels of this cell and of the next, then the last four
        let halves = _mm256_shuffle_epi8(round_pairs(sums(cell), sums(cell + 1)), order);
        let (first, last) = (_mm256_castsi256_si128(halves), _mm256_extracti128_si256::<1>(halves));
        let both = _mm_unpacklo_epi32(first, last);
        let next = out.wrapping_add((cell + 1) * CHANNELS);
        // SAFETY: `cells` has room for the excess, because another pixel follows that has at least 5 bytes; it is written
        // later.
        unsafe { _mm_storel_epi64(out.add(cell * CHANNELS).cast(), both) };
        if cell + 2 < CELLS {
            // SAFETY: as above.
            unsafe { _mm_storel_epi64(next.cast(), _mm_unpackhi_epi64(both, both)) };
        } else {
            let mut last = [0; 8];
            // SAFETY: 8 bytes.
            unsafe { _mm_storel_epi64(last.as_mut_ptr().cast(), _mm_unpackhi_epi64(both, both)) };
            cells[(CELLS - 1) * CHANNELS..].copy_from_slice(&last[..CHANNELS]);
        }
    }
}

/// Cells whose four pixels exist, of an image of nine channels or more.
///
/// # Safety
/// The CPU has AVX2.
#[target_feature(enable = "avx2")]
pub(in crate::kernels) fn bilinear_u8_any(source: &Source<'_, u8>, taps: &[Tap], cells: &mut [u8]) {
    let channels = source.channels();
    let scalar = scalar::bilinear::<u8, &[Tap], 0, false>;
    let plane = Plane::new(source).filter(|_| taps.len() >= CELLS && channels > 8);
    let Some(plane) = plane else { return scalar(source, taps, cells) };
    let prepare = |_, group: &Group| {
        let weights = Weights::new(group.fractions);
        (group.offsets, (lanes(weights.top), lanes(weights.bottom)))
    };
    let fill = |at: &Cells<'_>, (top_weights, bottom_weights): &([u32; CELLS], [u32; CELLS]), cells: &mut [u8]| {
        for (cell, out) in cells.chunks_exact_mut(channels).enumerate() {
            let ((top, bottom), out) = (rows_at(&plane, at.position(cell)), out.as_mut_ptr());
            let weights = Weights {
                top: _mm256_set1_epi32(top_weights[cell] as i32),
                bottom: _mm256_set1_epi32(bottom_weights[cell] as i32),
            };
            let round = |sums| _mm256_srli_epi32::<15>(_mm256_add_epi32(sums, _mm256_set1_epi32(1 << 14)));
            let pack = |rounded| {
                let (low, high) = (_mm256_castsi256_si128(rounded), _mm256_extracti128_si256::<1>(rounded));
                let words = _mm_packus_epi32(low, high);
                _mm_packus_epi16(words, words)
            };
            let eight = |first: usize| {
                // SAFETY: `first + 8 <= channels`, and a tap of the table has two pixels of so many bytes in this row
                // and in the one below; the cell has one.
                let load = |at: *const u8| unsafe { _mm_loadl_epi64(at.add(first).cast()) };
                let pair = |left: *const u8| {
                    _mm256_cvtepu8_epi16(_mm_unpacklo_epi8(load(left.wrapping_add(channels)), load(left)))
                };
                let bytes = pack(round(weights.sums(pair(top), pair(bottom))));
                // SAFETY: as above.
                unsafe { _mm_storel_epi64(out.add(first).cast(), bytes) };
            };
            let four = |first: usize| {
                // SAFETY: as above, with `first + 4 <= channels`.
                let load = |at: *const u8| unsafe { _mm_loadu_si32(at.add(first)) };
                let pair = |left: *const u8| {
                    let bytes = _mm_unpacklo_epi8(load(left.wrapping_add(channels)), load(left));
                    _mm256_castsi128_si256(_mm_cvtepu8_epi16(bytes))
                };
                let bytes = pack(round(weights.sums(pair(top), pair(bottom))));
                // SAFETY: as above.
                unsafe { _mm_storeu_si32(out.add(first), bytes) };
            };
            for_each_chunk(channels, eight, four);
        }
    };
    let rest = |range: Range<usize>, cells: &mut [u8]| scalar(source, &taps[range], cells);
    Run::<_, 0, 8> { plane: &plane, limit: i32::MAX, taps, cells }.for_each_group(prepare, fill, rest);
}
