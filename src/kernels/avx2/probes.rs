//! Averages of probes into 8-bit images of 3 and 4 channels: eight footprints at a time, whose probes are found, blended and
//! summed up in registers. To write the taps of each probe to memory, blend them with the kernel of bilinear and add them up
//! took twice as many instructions (5 x 2.5 cm cells).

use std::arch::x86_64::*;

use super::bytes::{LOADED, Weights, colour_sums, store_colour};
use super::{CELLS, Cells, Group, all_at_most, lanes, positions, vector};
use crate::kernels::plane::Plane;
use crate::kernels::{Probes, Source, scalar};
use crate::table::Tap;
use crate::table::block::{Basis, Block, LANES};

/// Footprints whose probes' pixels exist, of an image of 3 or 4 channels.
///
/// # Safety
/// The CPU has AVX2.
#[target_feature(enable = "avx2")]
pub(in crate::kernels) fn probes_u8<const CHANNELS: usize>(
    source: &Source<'_, u8>,
    probes: &Probes<'_>,
    cells: &mut [u8],
) {
    let plane = Plane::new(source);
    let limit = plane.as_ref().map_or(-1, |plane| plane.limit(LOADED));
    let (basis, finish) = (BasisPairs::new(probes.size.basis()), Finish::new(probes));
    let (width, columns) = (source.image.width(), probes.size.columns());
    let (mut taps, mut rest, mut first) = (probes.taps, cells, probes.skip);
    for block in probes.blocks {
        let count = (columns - first).min(taps.len());
        let (own, cells);
        (own, taps) = taps.split_at(count);
        (cells, rest) = rest.split_at_mut(count * CHANNELS);
        let sides = basis.sides(probes, block);
        let eights = own.chunks(CELLS).zip(cells.chunks_mut(CELLS * CHANNELS));
        for (lane, (own, cells)) in (first..).step_by(CELLS).zip(eights) {
            let group = match own.first_chunk() {
                Some(own) => {
                    let eight = |side: &[u32; LANES]| *side[lane..].first_chunk().expect("eight are left");
                    Footprints::new(probes, block, sides.each_ref().map(eight), own, width)
                }
                // the last footprint fills the lanes that are too many
                None => {
                    let nearest = |index: usize| index.min(own.len() - 1);
                    let eight = |side: &[u32; LANES]| std::array::from_fn(|index| side[lane + nearest(index)]);
                    let own = std::array::from_fn(|index| own[nearest(index)]);
                    Footprints::new(probes, block, sides.each_ref().map(eight), &own, width)
                }
            };
            let sums = plane.as_ref().and_then(|plane| group.sum::<CHANNELS>(plane, limit, probes));
            let Some(sums) = sums else {
                scalar::probes::<CHANNELS, CELLS>(source, probes, 0, cells, |along, down| {
                    let (offsets, fractions) = group.probe(probes, along, down);
                    (lanes(offsets), lanes(fractions))
                });
                continue;
            };
            if cells.len() == CELLS * CHANNELS {
                store_colour::<CHANNELS>(finish.averages(sums), cells);
            } else {
                let mut all = [0; 4 * CELLS];
                store_colour::<CHANNELS>(finish.averages(sums), &mut all[..CELLS * CHANNELS]);
                cells.copy_from_slice(&all[..cells.len()]);
            }
        }
        first = 0;
    }
}

/// What evaluates [`Block::side`]: two polynomials of the basis side by side in each lane, for each half of the lanes.
struct BasisPairs {
    low: [__m256i; 2],
    high: [__m256i; 2],
}

impl BasisPairs {
    #[inline]
    #[target_feature(enable = "avx2")]
    fn new(basis: &Basis) -> Self {
        let pairs = |degree: usize, half: usize| {
            let eight = |degree: usize| {
                let (halves, _) = basis[degree].as_chunks::<CELLS>();
                // SAFETY: eight numbers of 2 bytes.
                _mm256_cvtepu16_epi32(unsafe { _mm_loadu_si128(halves[half].as_ptr().cast()) })
            };
            _mm256_or_si256(eight(degree), _mm256_slli_epi32::<16>(eight(degree + 1)))
        };
        Self { low: [pairs(0, 0), pairs(0, 1)], high: [pairs(2, 0), pairs(2, 1)] }
    }

    /// Of x and y: for each footprint of a row of a block the side along in the low, and the side down in the high half.
    /// Those with one probe are 0: more than half of the cells of 10 cm have but one.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn sides(&self, probes: &Probes<'_>, block: &Block) -> [[u32; LANES]; 2] {
        let mut sides = [[0; LANES]; 2];
        let [has_along, has_down] = probes.offsets.map(|offsets| offsets.len() > 1);
        if !has_along & !has_down {
            return sides;
        }
        // SAFETY: sixteen numbers of 2 bytes.
        let sixteen = |numbers: &[i16; 16]| unsafe { _mm256_loadu_si256(numbers.as_ptr().cast()) };
        let changes = _mm256_mullo_epi16(sixteen(&block.changes), _mm256_set1_epi16(probes.half_rows));
        let coefficients = _mm256_add_epi16(sixteen(&block.coefficients), changes);
        let side = |side: usize, half: usize| {
            let pair =
                |index: usize| _mm256_permutevar8x32_epi32(coefficients, _mm256_set1_epi32((2 * side + index) as i32));
            let low = _mm256_madd_epi16(pair(0), self.low[half]);
            let high = _mm256_madd_epi16(pair(1), self.high[half]);
            _mm256_srai_epi32::<7>(_mm256_add_epi32(low, high))
        };
        for (axis, sides) in sides.iter_mut().enumerate() {
            for (half, eight) in sides.as_chunks_mut::<CELLS>().0.iter_mut().enumerate() {
                let mut both = _mm256_setzero_si256();
                if has_along {
                    both = _mm256_and_si256(side(axis, half), _mm256_set1_epi32(0xffff));
                }
                if has_down {
                    both = _mm256_or_si256(both, _mm256_slli_epi32::<16>(side(2 + axis, half)));
                }
                *eight = lanes(both);
            }
        }
        sides
    }
}

/// Eight footprints.
struct Footprints {
    /// Columns and rows of the middles, less the origin.
    centre: [__m256i; 2],
    /// Of x and y: the side along in the low and the side down in the high half of each lane.
    sides: [__m256i; 2],
    width: __m256i,
}

impl Footprints {
    /// Footprints of a row of a block, of these sides and cells.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn new(probes: &Probes<'_>, block: &Block, sides: [[u32; CELLS]; 2], taps: &[Tap; CELLS], width: usize) -> Self {
        let taps = Group::load(taps);
        // the row is the whole part of (offset + 0.5) / width, see `Strided::inverse_width`
        let inverse = _mm256_set1_pd(1.0 / f64::from(probes.source_width));
        let row_of = |four: __m128i| {
            // there is no conversion of unsigned numbers: put into the mantissa of 2^52 they are 2^52 + offset
            const TWO_52: i64 = 0x4330_0000_0000_0000;
            let shifted = _mm256_or_si256(_mm256_cvtepu32_epi64(four), _mm256_set1_epi64x(TWO_52));
            let half_less = _mm256_set1_pd(4_503_599_627_370_495.5); // 2^52 - 0.5
            let middle = _mm256_sub_pd(_mm256_castsi256_pd(shifted), half_less);
            _mm256_cvttpd_epi32(_mm256_mul_pd(middle, inverse))
        };
        let (low, high) = (_mm256_castsi256_si128(taps.offsets), _mm256_extracti128_si256::<1>(taps.offsets));
        let row = _mm256_set_m128i(row_of(high), row_of(low));
        let rows = _mm256_mullo_epi32(row, _mm256_set1_epi32(probes.source_width as i32));
        let column = _mm256_sub_epi32(taps.offsets, rows);
        // 15 bits of fraction, as 10
        let fraction = |fraction: __m256i| _mm256_and_si256(fraction, _mm256_set1_epi32(0x3ff));
        let x = _mm256_or_si256(_mm256_slli_epi32::<10>(column), fraction(_mm256_srli_epi32::<5>(taps.fractions)));
        let y = _mm256_or_si256(_mm256_slli_epi32::<10>(row), fraction(_mm256_srli_epi32::<21>(taps.fractions)));
        let origin = |axis: usize| _mm256_set1_epi32(probes.origin[axis] - i32::from(block.offset[axis]));
        let centre = [_mm256_sub_epi32(x, origin(0)), _mm256_sub_epi32(y, origin(1))];
        Self { centre, sides: [vector(&sides[0]), vector(&sides[1])], width: _mm256_set1_epi32(width as i32) }
    }

    /// Where a probe looks, as a tap says it: offsets, and fractions of x in the low and of y in the high half of each lane.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn probe(&self, probes: &Probes<'_>, along: i16, down: i16) -> (__m256i, __m256i) {
        let offsets = _mm256_set1_epi32(i32::from(along as u16) | i32::from(down) << 16);
        let shift = _mm_cvtsi32_si128(probes.shift as i32);
        let at = |axis: usize| {
            let way = _mm256_sra_epi32(_mm256_madd_epi16(self.sides[axis], offsets), shift);
            let step = _mm_cvtsi32_si128(probes.steps[axis] as i32);
            _mm256_sra_epi32(_mm256_add_epi32(self.centre[axis], way), step)
        };
        let (column, row) = (at(0), at(1));
        let whole = |at| _mm256_srai_epi32::<10>(at);
        let offset = _mm256_add_epi32(_mm256_mullo_epi32(whole(row), self.width), whole(column));
        // 10 bits of fraction, as 15
        let x = _mm256_and_si256(_mm256_slli_epi32::<5>(column), _mm256_set1_epi32(0x7fe0));
        let y = _mm256_and_si256(_mm256_slli_epi32::<21>(row), _mm256_set1_epi32(0x7fe0_0000));
        (offset, _mm256_or_si256(x, y))
    }

    /// The sums of all probes, as [`store_colour`] takes them; `None` where a load would leave the image.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn sum<const CHANNELS: usize>(&self, plane: &Plane<'_>, limit: i32, probes: &Probes<'_>) -> Option<[__m256i; 2]> {
        let mut sums = [_mm256_setzero_si256(); 2];
        // positions are checked against the limit, not each tap: cells need none
        let taps = &[Tap::default(); CELLS];
        for &down in probes.offsets[1] {
            for &along in probes.offsets[0] {
                let (offsets, fractions) = self.probe(probes, along, down);
                let found = positions::<CHANNELS>(plane, offsets);
                if !all_at_most(found, limit) {
                    return None;
                }
                let cells = Cells { positions: &lanes(found), taps };
                let blends = colour_sums::<CHANNELS>(plane, &cells, &Weights::new(fractions));
                sums = [_mm256_add_epi16(sums[0], blends[0]), _mm256_add_epi16(sums[1], blends[1])];
            }
        }
        Some(sums)
    }
}

/// How sums become averages; see [`Average::finish`](crate::kernels::average::Average::finish).
struct Finish {
    half: __m256i,
    /// log2 of the number of probes, if it is a power of two.
    shift: Option<__m128i>,
    inverse: __m256i,
}

impl Finish {
    #[inline]
    #[target_feature(enable = "avx2")]
    fn new(probes: &Probes<'_>) -> Self {
        let count = probes.count();
        Self {
            half: _mm256_set1_epi16((count / if probes.round_bias { 4 } else { 2 }) as i16),
            shift: count.is_power_of_two().then(|| _mm_cvtsi32_si128(count.ilog2() as i32)),
            inverse: _mm256_set1_epi32((1u32 << 24).div_ceil(count) as i32),
        }
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    fn averages(&self, [first, second]: [__m256i; 2]) -> [__m256i; 2] {
        let average = |sum: __m256i| {
            let sum = _mm256_add_epi16(sum, self.half);
            if let Some(shift) = self.shift {
                return _mm256_srl_epi16(sum, shift);
            }
            let zero = _mm256_setzero_si256();
            let quotient = |sum| _mm256_srli_epi32::<24>(_mm256_mullo_epi32(sum, self.inverse));
            let (low, high) = (_mm256_unpacklo_epi16(sum, zero), _mm256_unpackhi_epi16(sum, zero));
            _mm256_packus_epi32(quotient(low), quotient(high))
        };
        [average(first), average(second)]
    }
}
