//! Kernels for CPUs with AVX2 (Haswell, Zen and later): eight cells at a time.
//!
//! A vector is two halves of 128 bits, and shuffles stay inside a half. Cells are therefore dealt out so that nothing
//! has to cross: the low half works on cells 0 to 3, the high half on cells 4 to 7.

mod boxes;
mod bytes;
mod copy;
mod floats;
mod nearest;
mod pairs;
mod probes;

pub(super) use boxes::boxes_u8;
pub(super) use bytes::{bilinear_u8, bilinear_u8_any, bilinear_u8_few};
pub(super) use copy::copy;
pub(super) use floats::{bilinear_f32, bilinear_f32_any, bilinear_f32_planes, bilinear_u16, bilinear_u16_any};
pub(super) use nearest::nearest;
pub(super) use pairs::{bilinear_f32_pairs, bilinear_u8_pairs, bilinear_u16_pairs};
pub(super) use probes::probes_u8;

use std::arch::x86_64::*;
use std::mem::MaybeUninit;
use std::ops::Range;

use super::plane::Plane;
use crate::table::Tap;

/// Cells of a group.
const CELLS: usize = 8;

/// Where the eight cells of a group sample.
struct Cells<'a> {
    /// Byte positions of their pixels.
    positions: &'a [u32; CELLS],
    taps: &'a [Tap; CELLS],
}

impl Cells<'_> {
    /// The position of one cell, loaded by itself: volatile, or the compiler takes it out of a vector with two shuffles.
    #[inline(always)]
    fn position(&self, cell: usize) -> usize {
        // SAFETY: a reference is good to read.
        unsafe { std::ptr::read_volatile(&self.positions[cell]) as usize }
    }

    /// The positions of some cells without waiting for a store of `positions` just before, for pixels of `PIXEL` bytes:
    /// where rows are back to back they are worked out anew from the taps (one channel of float32: 27 cycles a group
    /// became 15).
    #[inline]
    #[target_feature(enable = "avx2")]
    fn early_positions<const PIXEL: usize, const COUNT: usize>(
        &self,
        plane: &Plane<'_>,
        cells: [usize; COUNT],
    ) -> [usize; COUNT] {
        let mut positions = [0; COUNT];
        // loops, not `map`: what is called from code without AVX2 is not inlined there
        if plane.strided.is_none() {
            for (position, cell) in positions.iter_mut().zip(cells) {
                // SAFETY: a reference is good to read.
                *position = unsafe { std::ptr::read_volatile(&self.taps[cell].offset) as usize } * PIXEL;
            }
        } else {
            for (position, cell) in positions.iter_mut().zip(cells) {
                *position = self.position(cell);
            }
        }
        positions
    }

    /// The windows of [`distances_within`]: the lowest position of either half.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn lowest<const PIXEL: usize>(&self, plane: &Plane<'_>) -> (usize, usize) {
        let [first, last, other_first, other_last] = self.early_positions::<PIXEL, 4>(plane, [0, 3, 4, 7]);
        (first.min(last), other_first.min(other_last))
    }
}

/// All cells of a group.
const ALL: [usize; CELLS] = [0, 1, 2, 3, 4, 5, 6, 7];

/// A run of at least eight cells, whose pixels have `PIXEL` bytes (0: any), worked on in blocks of `GROUPS` groups.
struct Run<'a, T, const PIXEL: usize, const GROUPS: usize> {
    plane: &'a Plane<'a>,
    /// The last position from which pixels may be loaded as the kernel does it.
    limit: i32,
    taps: &'a [Tap],
    cells: &'a mut [T],
}

impl<T, const PIXEL: usize, const GROUPS: usize> Run<'_, T, PIXEL, GROUPS> {
    /// Fills the run, group by group. `prepare` gets a group and its first cell, and gives the offsets of its pixels and
    /// what else blending takes; `fill` gets their positions, all within the limit, and that; `rest` fills blocks that are
    /// not within the limit.
    ///
    /// In a block all positions and weights are worked out first, then all pixels fetched: from a tap to its blend is a
    /// long way, and a CPU that sees two hundred instructions ahead waits for it. Blocks of 64 cells took 10 % off three
    /// channels of bytes, 15 % off nearest, and added as much to one channel, which is a short way.
    ///
    /// The last group reaches back to be whole, so some cells are filled twice.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn for_each_group<W: Copy>(
        self,
        prepare: impl Fn(usize, &Group) -> (__m256i, W),
        mut fill: impl FnMut(&Cells<'_>, &W, &mut [T]),
        mut rest: impl FnMut(Range<usize>, &mut [T]),
    ) {
        let Self { plane, limit, taps, cells } = self;
        let samples = if PIXEL == 0 { cells.len() / taps.len() } else { PIXEL / size_of::<T>() };
        assert!(taps.len() >= CELLS && cells.len() == taps.len() * samples);
        let last = taps.len() - CELLS;
        // SAFETY: `first` is at most `last`, so the taps of a whole group follow.
        let group_of = |first: usize| unsafe { &*taps.as_ptr().add(first).cast::<[Tap; CELLS]>() };
        let mut positions = [[0; CELLS]; GROUPS];
        let mut weights = [const { MaybeUninit::uninit() }; GROUPS];
        for block in (0..taps.len()).step_by(CELLS * GROUPS) {
            let groups = (taps.len() - block).div_ceil(CELLS).min(GROUPS);
            let mut highest = _mm256_setzero_si256();
            for (group, (positions, weights)) in positions.iter_mut().zip(&mut weights).enumerate().take(groups) {
                let first = (block + CELLS * group).min(last);
                let (offsets, prepared) = prepare(first, &Group::load(group_of(first)));
                let found = self::positions::<PIXEL>(plane, offsets);
                highest = _mm256_max_epi32(highest, found);
                weights.write(prepared);
                *positions = lanes(found);
            }
            if !all_at_most(highest, limit) {
                let range = block.min(last)..(block + CELLS * GROUPS).min(taps.len());
                rest(range.clone(), &mut cells[range.start * samples..range.end * samples]);
                continue;
            }
            for (group, (positions, weights)) in positions.iter().zip(&weights).enumerate().take(groups) {
                let at = (block + CELLS * group).min(last);
                // `at` is at most `last`, so a whole group of cells follows
                let cells = &mut cells[at * samples..(at + CELLS) * samples];
                // SAFETY: written for this group of this block.
                fill(&Cells { positions, taps: group_of(at) }, unsafe { weights.assume_init_ref() }, cells);
            }
        }
    }
}

/// Calls `eight` and `four` with first channels so that all channels (at least four) are met. Where the last ones are
/// fewer, the call reaches back to be whole.
#[inline]
#[target_feature(enable = "avx2")]
fn for_each_chunk(channels: usize, mut eight: impl FnMut(usize), mut four: impl FnMut(usize)) {
    let whole = channels - channels % 8;
    for first in (0..whole).step_by(8) {
        eight(first);
    }
    match channels - whole {
        0 => {}
        1..=4 => four(channels - 4),
        _ if whole > 0 => eight(channels - 8),
        _ => {
            four(0);
            four(channels - 4);
        }
    }
}

/// The taps of eight cells, offsets and fractions apart.
struct Group {
    /// Offset of each top-left pixel.
    offsets: __m256i,
    /// x in the low and y in the high half of each lane, steps included.
    fractions: __m256i,
}

impl Group {
    #[inline]
    #[target_feature(enable = "avx2")]
    fn load(taps: &[Tap; CELLS]) -> Self {
        let at = taps.as_ptr().cast::<__m128i>();
        // SAFETY: eight taps of 8 bytes are four vectors of 16; the loads need no alignment.
        let (even, odd) = unsafe { (load_halves(at, at.add(2)), load_halves(at.add(1), at.add(3))) };
        let (even, odd) = (_mm256_castsi256_ps(even), _mm256_castsi256_ps(odd));
        Self {
            offsets: _mm256_castps_si256(_mm256_shuffle_ps::<0b10_00_10_00>(even, odd)),
            fractions: _mm256_castps_si256(_mm256_shuffle_ps::<0b11_01_11_01>(even, odd)),
        }
    }

    /// Offset of each nearest pixel.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn nearest(&self, width: __m256i) -> __m256i {
        let step_x = _mm256_srli_epi32::<31>(_mm256_slli_epi32::<16>(self.fractions));
        let step_y = _mm256_and_si256(_mm256_srai_epi32::<31>(self.fractions), width);
        _mm256_add_epi32(self.offsets, _mm256_add_epi32(step_x, step_y))
    }

    /// The fractions along x and along y as float32, exact.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn weights(&self) -> (__m256, __m256) {
        let unit = _mm256_set1_ps(1.0 / 32768.0);
        let q15 = _mm256_and_si256(self.fractions, _mm256_set1_epi16(0x7fff));
        let x = _mm256_and_si256(q15, _mm256_set1_epi32(0xffff));
        let y = _mm256_srli_epi32::<16>(q15);
        (_mm256_mul_ps(_mm256_cvtepi32_ps(x), unit), _mm256_mul_ps(_mm256_cvtepi32_ps(y), unit))
    }
}

/// Byte position of each pixel.
#[inline]
#[target_feature(enable = "avx2")]
fn positions<const PIXEL: usize>(plane: &Plane<'_>, offsets: __m256i) -> __m256i {
    let contiguous = match PIXEL {
        1 => offsets,
        2 => _mm256_slli_epi32::<1>(offsets),
        3 => _mm256_add_epi32(_mm256_slli_epi32::<1>(offsets), offsets),
        4 => _mm256_slli_epi32::<2>(offsets),
        6 => {
            let twice = _mm256_slli_epi32::<1>(offsets);
            _mm256_add_epi32(_mm256_slli_epi32::<1>(twice), twice)
        }
        8 => _mm256_slli_epi32::<3>(offsets),
        12 => {
            let four = _mm256_slli_epi32::<2>(offsets);
            _mm256_add_epi32(_mm256_slli_epi32::<1>(four), four)
        }
        16 => _mm256_slli_epi32::<4>(offsets),
        _ => _mm256_mullo_epi32(offsets, _mm256_set1_epi32(plane.pixel as i32)),
    };
    let Some(strided) = plane.strided else { return contiguous };
    let row = |four: __m128i| {
        // there is no conversion of unsigned numbers: put into the mantissa of 2^52 they are 2^52 + offset
        const TWO_52: i64 = 0x4330_0000_0000_0000;
        let shifted = _mm256_or_si256(_mm256_cvtepu32_epi64(four), _mm256_set1_epi64x(TWO_52));
        let half_less = _mm256_set1_pd(4_503_599_627_370_495.5); // 2^52 - 0.5
        let middle = _mm256_sub_pd(_mm256_castsi256_pd(shifted), half_less);
        _mm256_cvttpd_epi32(_mm256_mul_pd(middle, _mm256_set1_pd(strided.inverse_width)))
    };
    let rows = _mm256_set_m128i(row(_mm256_extracti128_si256::<1>(offsets)), row(_mm256_castsi256_si128(offsets)));
    let extra = _mm256_mullo_epi32(rows, _mm256_set1_epi32(strided.row_extra));
    _mm256_add_epi32(_mm256_add_epi32(contiguous, extra), _mm256_set1_epi32(strided.origin))
}

/// Where the pixel of a cell begins, and the one a row below.
#[inline(always)]
fn rows_at(plane: &Plane<'_>, position: usize) -> (*const u8, *const u8) {
    let (top, bottom) = (plane.start(), plane.start().wrapping_offset(plane.row_stride));
    (top.wrapping_add(position), bottom.wrapping_add(position))
}

/// The lanes as an array.
#[inline]
#[target_feature(enable = "avx2")]
fn lanes(vector: __m256i) -> [u32; CELLS] {
    let mut lanes = [0; CELLS];
    // SAFETY: eight lanes are 32 bytes.
    unsafe { _mm256_storeu_si256(lanes.as_mut_ptr().cast(), vector) };
    lanes
}

/// The array as a vector.
#[inline]
#[target_feature(enable = "avx2")]
fn vector(lanes: &[u32; CELLS]) -> __m256i {
    // SAFETY: eight lanes are 32 bytes.
    unsafe { _mm256_loadu_si256(lanes.as_ptr().cast()) }
}

/// Two halves of a vector from two places.
///
/// # Safety
/// 16 bytes can be read at both.
#[inline]
#[target_feature(enable = "avx2")]
unsafe fn load_halves(low: *const __m128i, high: *const __m128i) -> __m256i {
    // SAFETY: the caller's promise; the loads need no alignment.
    let (low, high) = unsafe { (_mm_loadu_si128(low), _mm_loadu_si128(high)) };
    _mm256_inserti128_si256::<1>(_mm256_castsi128_si256(low), high)
}

/// The same vector, of which the compiler must believe that every byte matters: it otherwise narrows the loads to the
/// bytes that are used and puts them together with two to three times the instructions.
#[inline]
#[target_feature(enable = "avx2")]
fn opaque(mut vector: __m256i) -> __m256i {
    // SAFETY: no instruction at all.
    unsafe { std::arch::asm!("/* {0} */", inout(ymm_reg) vector, options(pure, nomem, nostack, preserves_flags)) };
    vector
}

/// How far each position is from the lowest of its half, if all are at most `reach` away: then a window that begins at
/// the lowest of the four holds them all.
#[inline]
#[target_feature(enable = "avx2")]
fn distances_within(positions: __m256i, reach: i32) -> Option<__m256i> {
    // cells run along a row, so the lowest of a half is its first or, where the view is mirrored, its last
    let first = _mm256_shuffle_epi32::<0b00_00_00_00>(positions);
    let last = _mm256_shuffle_epi32::<0b11_11_11_11>(positions);
    let distances = _mm256_sub_epi32(positions, _mm256_min_epi32(first, last));
    let negative = _mm256_or_si256(distances, _mm256_sub_epi32(_mm256_set1_epi32(reach), distances));
    (_mm256_movemask_ps(_mm256_castsi256_ps(negative)) == 0).then_some(distances)
}

/// Whether every lane is at most `limit`.
#[inline]
#[target_feature(enable = "avx2")]
fn all_at_most(values: __m256i, limit: i32) -> bool {
    _mm256_movemask_ps(_mm256_castsi256_ps(_mm256_cmpgt_epi32(values, _mm256_set1_epi32(limit)))) == 0
}

#[cfg(test)]
mod tests {
    use crate::warp::Bilinear;
    use crate::{ImageView, Interpolation, Isa, Lut, WarpOptions};

    /// Numbers, the same every time.
    struct Random(u64);

    impl Random {
        fn next(&mut self) -> u64 {
            self.0 ^= self.0 << 13;
            self.0 ^= self.0 >> 7;
            self.0 ^= self.0 << 17;
            self.0 >> 11
        }

        fn below(&mut self, limit: usize) -> usize {
            (self.next() % limit as u64) as usize
        }

        fn unit(&mut self) -> f64 {
            (self.next() & 0xfff_ffff) as f64 / f64::from(1 << 28)
        }
    }

    /// Rows of cells that run from and to the corners of the image, along a row of it in steps of 0 to 12 pixels either
    /// way, or that jump about.
    fn maps(random: &mut Random, (width, height): (usize, usize), columns: usize) -> (Vec<f64>, Vec<f64>) {
        let last = [(width - 1) as f64, (height - 1) as f64];
        let corners = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]];
        let (mut map_x, mut map_y) = (Vec::new(), Vec::new());
        for row in 0..60 {
            let from = *corners.get(row / 4).unwrap_or(&[random.unit(), random.unit()]);
            let to = *corners.get(row % 4).unwrap_or(&[random.unit(), random.unit()]);
            let step = (random.unit() - 0.5) * 24.0 / width as f64;
            for column in 0..columns {
                let share = column as f64 / columns as f64;
                let mut at = match row {
                    0..16 => [0, 1].map(|axis| from[axis] + (to[axis] - from[axis]) * share),
                    16..56 => [(from[0] + step * column as f64).rem_euclid(1.0), from[1]],
                    _ => [random.unit(), random.unit()],
                };
                at = [0, 1].map(|axis| at[axis].min(0.999_99) * last[axis]);
                if random.below(4) == 0 {
                    at = at.map(|at| (at * 2.0).floor() / 2.0); // ties, and weights of 32768
                }
                map_x.push(at[0]);
                map_y.push(at[1]);
            }
        }
        (map_x, map_y)
    }

    /// Warps images of so many channels, of several sizes and row strides, with both instruction sets.
    fn compare<T: Bilinear + PartialEq + std::fmt::Debug>(channels: usize, sample: impl Fn(u64) -> T) {
        if !Isa::available().contains(&Isa::Avx2) {
            return;
        }
        let mut random = Random(0x9e37_79b9_7f4a_7c15 + channels as u64);
        for columns in (1..=40).chain([64, 71, 129, 200]) {
            let (width, height) = [(2, 2), (5, 3), (49, 9), (300, 11)][random.below(4)];
            let row = width * channels;
            let gap = random.below(3);
            let data: Vec<T> = (0..height * (row + gap) + 7).map(|_| sample(random.next())).collect();
            let (map_x, map_y) = maps(&mut random, (width, height), columns);
            let lut = Lut::from_maps(&map_x, &map_y, columns, (width as u32, height as u32)).unwrap();
            let (size, stride) = ((width, height), (row + gap) as isize);
            let span = (height - 1) * (row + gap) + row;
            let images = [
                ImageView::new(&data[..height * row], size, channels),
                ImageView::with_row_stride(&data[..span], size, channels, 0, stride),
                ImageView::with_row_stride(&data[..span], size, channels, span - row, -stride),
                ImageView::with_row_stride(&data, size, channels, 3, stride),
                ImageView::with_row_stride(&data[..row], size, channels, 0, 0),
            ];
            for image in images.map(Result::unwrap) {
                for interpolation in [Interpolation::Nearest, Interpolation::Bilinear] {
                    let warp = |isa| {
                        let options =
                            WarpOptions { interpolation, isa: Some(isa), threads: Some(1), ..Default::default() };
                        lut.warp(&image, &options).unwrap()
                    };
                    let (expected, got) = (warp(Isa::Scalar), warp(Isa::Avx2));
                    let differs = expected.iter().zip(&got).position(|(expected, got)| expected != got);
                    assert_eq!(differs, None, "{interpolation:?} {width}x{height}x{channels}, {columns} columns");
                }
            }
        }
    }

    #[test]
    fn bytes_equal_scalar() {
        for channels in [1, 2, 3, 4, 5, 6, 7, 8, 9, 12, 13, 16, 19, 40] {
            compare(channels, |bits| if bits & 1 == 0 { (bits >> 8) as u8 } else { 255 * ((bits >> 1) & 1) as u8 });
        }
    }

    #[test]
    fn sixteen_bits_equal_scalar() {
        for channels in [1, 2, 3, 4, 5, 6, 7, 8, 9, 12, 13, 16, 19] {
            compare(channels, |bits| if bits & 1 == 0 { (bits >> 8) as u16 } else { 65535 * ((bits >> 1) & 1) as u16 });
        }
    }

    #[test]
    fn floats_equal_scalar() {
        for channels in [1, 2, 3, 4, 5, 6, 7, 8, 9, 12, 13, 16, 19] {
            compare(channels, |bits| (bits & 0xff_ffff) as f32 / 1e4 - 800.0);
        }
    }
}
