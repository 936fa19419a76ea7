//! Kernels for CPUs with AVX-512 F, BW, VL, VBMI and VNNI (Ice Lake, Zen 4 and later): sixteen cells at a time.

mod boxes;
mod bytes;
mod floats;
mod nearest;
mod pairs;
mod probes;
mod taps;

pub(super) use boxes::boxes_u8;
pub(super) use bytes::{bilinear_u8, bilinear_u8_any};
pub(super) use floats::{bilinear_float, bilinear_float_any};
pub(super) use nearest::nearest;
pub(super) use pairs::bilinear_float_pairs;
pub(super) use probes::probes_u8;
pub(super) use taps::taps_of_row;

use std::arch::x86_64::*;

use super::Source;
use super::plane::Plane;
use crate::table::Tap;
use crate::view::{ImageView, Sample, as_bytes};

/// The taps of sixteen cells, offsets and fractions apart.
struct Group {
    /// Offset of each top-left pixel.
    offsets: __m512i,
    /// x in the low and y in the high half of each lane, steps included.
    fractions: __m512i,
}

impl Group {
    #[inline]
    #[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
    fn load(taps: &[Tap; 16]) -> Self {
        let even = _mm512_setr_epi32(0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30);
        let odd = _mm512_or_si512(even, _mm512_set1_epi32(1));
        let at = taps.as_ptr().cast::<__m512i>();
        // SAFETY: sixteen taps of 8 bytes are two vectors of 64; the loads need no alignment.
        let (first, second) = unsafe { (_mm512_loadu_si512(at), _mm512_loadu_si512(at.add(1))) };
        Self {
            offsets: _mm512_permutex2var_epi32(first, even, second),
            fractions: _mm512_permutex2var_epi32(first, odd, second),
        }
    }
}

/// How many cells ahead of use large pixels are fetched; 8 and 24 measured the same.
const AHEAD: usize = 12;

/// The pixels of an image of any channels, with what finding them takes at hand.
#[derive(Clone, Copy)]
struct Pixels<'a, T> {
    image: &'a ImageView<'a, T>,
    data: &'a [T],
    channels: usize,
    width: usize,
    contiguous: bool,
}

impl<'a, T: Sample> Pixels<'a, T> {
    fn new(source: &Source<'a, T>) -> Self {
        let image = source.image;
        let contiguous = image.is_contiguous();
        Self { image, data: image.data(), channels: image.channels(), width: image.width(), contiguous }
    }

    /// So many pixels from the one at `y * width + x` on.
    #[inline(always)]
    fn get(&self, offset: usize, count: usize) -> &'a [T] {
        let start = if self.contiguous {
            offset * self.channels
        } else {
            self.image.row_start(offset / self.width) + offset % self.width * self.channels
        };
        &self.data[start..start + count * self.channels]
    }

    /// Whether a pixel is so large that the CPU's own prefetching is late.
    fn is_wide(&self) -> bool {
        self.channels * size_of::<T>() >= 32
    }

    /// Fetches the four pixels of a tap ahead of time: 16 float channels took 4.9 ms with it and 7.6 without.
    #[inline]
    #[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
    fn prefetch(&self, tap: &Tap) {
        for row in [tap.offset as usize, tap.offset as usize + self.width] {
            let pixels = as_bytes(self.get(row, 2));
            for line in pixels.chunks(64) {
                _mm_prefetch::<_MM_HINT_T0>(line.as_ptr().cast());
            }
            _mm_prefetch::<_MM_HINT_T0>(pixels[pixels.len() - 1..].as_ptr().cast());
        }
    }

    /// The four pixels of a tap: top left, top right, bottom left, bottom right.
    #[inline(always)]
    fn of(&self, tap: &Tap) -> [&'a [T]; 4] {
        let offset = tap.offset as usize;
        let (left_top, right_top) = self.get(offset, 2).split_at(self.channels);
        let (left_bottom, right_bottom) = self.get(offset + self.width, 2).split_at(self.channels);
        [left_top, right_top, left_bottom, right_bottom]
    }
}

impl Plane<'_> {
    /// Byte position of each top-left pixel.
    #[inline]
    #[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
    fn positions<const PIXEL: i32>(&self, offsets: __m512i) -> __m512i {
        let contiguous = match PIXEL {
            1 => offsets,
            2 => _mm512_slli_epi32::<1>(offsets),
            3 => _mm512_add_epi32(_mm512_slli_epi32::<1>(offsets), offsets),
            4 => _mm512_slli_epi32::<2>(offsets),
            8 => _mm512_slli_epi32::<3>(offsets),
            16 => _mm512_slli_epi32::<4>(offsets),
            _ => _mm512_mullo_epi32(offsets, _mm512_set1_epi32(self.pixel as i32)),
        };
        let Some(strided) = self.strided else { return contiguous };
        let row = |eight: __m256i| {
            let middle = _mm512_add_pd(_mm512_cvtepu32_pd(eight), _mm512_set1_pd(0.5));
            _mm512_cvttpd_epi32(_mm512_mul_pd(middle, _mm512_set1_pd(strided.inverse_width)))
        };
        let rows = _mm512_inserti64x4::<1>(
            _mm512_castsi256_si512(row(_mm512_castsi512_si256(offsets))),
            row(_mm512_extracti64x4_epi64::<1>(offsets)),
        );
        let extra = _mm512_mullo_epi32(rows, _mm512_set1_epi32(strided.row_extra));
        _mm512_add_epi32(_mm512_add_epi32(contiguous, extra), _mm512_set1_epi32(strided.origin))
    }
}

/// Where a window that may hold all sixteen begins, and how far each position is from there.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
fn window<const PIXEL: usize>(plane: &Plane<'_>, taps: &[Tap; 16], positions: __m512i) -> (usize, __m512i) {
    // cells run along a row, so the lowest is the first or, where the view is mirrored, the last
    let base = if plane.strided.is_none() {
        // from memory, not from the vector: the address is known ten cycles sooner
        scalar_offset(taps, 0).min(scalar_offset(taps, 15)) * PIXEL
    } else {
        let first = _mm512_castsi512_si128(positions);
        let last = _mm_shuffle_epi32::<0b11_11_11_11>(_mm512_extracti32x4_epi32::<3>(positions));
        _mm_cvtsi128_si32(_mm_min_epu32(first, last)) as u32 as usize
    };
    (base, _mm512_sub_epi32(positions, _mm512_set1_epi32(base as i32)))
}

/// The offset of one cell, loaded by itself: volatile, or the compiler takes it out of a vector with two shuffles.
#[inline(always)]
fn scalar_offset(taps: &[Tap; 16], cell: usize) -> usize {
    // SAFETY: a reference is good to read.
    unsafe { std::ptr::read_volatile(&taps[cell].offset) as usize }
}

/// Whether every lane of `values`, read as unsigned, is at most `limit`.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
fn all_within(values: __m512i, limit: i32) -> bool {
    _mm512_cmpgt_epu32_mask(values, _mm512_set1_epi32(limit)) == 0
}

/// The same vector, of which the compiler must believe that every byte matters. It otherwise narrows the loads to the 6
/// or 8 bytes that are used and puts them together with more instructions than that saves (0.88 instead of 0.77 ns a cell at 15 to 22 m).
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
fn opaque(mut vector: __m512i) -> __m512i {
    // SAFETY: no instruction at all.
    unsafe { std::arch::asm!("/* {0} */", inout(zmm_reg) vector, options(pure, nomem, nostack, preserves_flags)) };
    vector
}

/// The sixteen byte positions as numbers.
///
/// Where rows are back to back they are worked out anew from the taps: reading the lanes of a vector that was just
/// stored waits for the store (8 bits, 3 channels, three pixels from cell to cell: 1.02 ns instead of 0.80), and
/// extracting them takes two shuffles each.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
fn scalar_positions<const CHANNELS: usize>(plane: &Plane<'_>, taps: &[Tap; 16], positions: __m512i) -> [usize; 16] {
    if plane.strided.is_none() {
        return std::array::from_fn(|cell| scalar_offset(taps, cell) * CHANNELS);
    }
    let mut lanes = [0u32; 16];
    // SAFETY: sixteen lanes are 64 bytes.
    unsafe { _mm512_storeu_si512(lanes.as_mut_ptr().cast(), positions) };
    lanes.map(|lane| lane as usize)
}
