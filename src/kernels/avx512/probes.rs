//! Averages of probes into 8-bit images of 3 and 4 channels: sixteen footprints at a time, whose probes are found, blended
//! and summed up in registers.
//!
//! Sums are 16-bit numbers, four to a footprint: vector 0 holds footprints 4 i and 4 i + 1 in its i-th 128 bits, vector 1
//! holds 4 i + 2 and 4 i + 3. So they come from [`gather`] by packing, and so bytes are packed in their order.

use std::arch::x86_64::*;
use std::ops::Range;

use super::all_within;
use super::bytes::{Reach, Weights, gather, load_widest, load_window, near, planar, wide, widest};
use crate::kernels::plane::Plane;
use crate::kernels::{Probes, Source, scalar};
use crate::table::Tap;
use crate::table::block::Block;
use crate::table::block::{Basis, LANES};

/// Footprints whose probes' pixels exist, of an image of 3 or 4 channels.
///
/// # Safety
/// The CPU has AVX-512 F, BW, VL, VBMI and VNNI.
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
pub(in crate::kernels) fn probes_u8<const CHANNELS: usize>(
    source: &Source<'_, u8>,
    probes: &Probes<'_>,
    cells: &mut [u8],
) {
    let plane = Plane::new(source);
    let reach = plane.as_ref().map(Reach::new);
    let width = source.image.width();
    let (basis, finish) = (BasisPairs::new(probes.size.basis()), Finish::new(probes));
    let columns = probes.size.columns();
    let (mut taps, mut rest, mut lanes) = (probes.taps, cells, probes.skip..columns);
    for block in probes.blocks {
        lanes.end = columns.min(lanes.start + taps.len());
        let (own, cells);
        (own, taps) = taps.split_at(lanes.len());
        (cells, rest) = rest.split_at_mut(lanes.len() * CHANNELS);
        let group = match own.first_chunk() {
            Some(own) => Group::load(probes, &basis, block, own, width),
            // of other lanes than those that are asked for the nearest of these
            None => {
                let own = std::array::from_fn(|lane| own[lane.clamp(lanes.start, lanes.end - 1) - lanes.start]);
                Group::load(probes, &basis, block, &own, width)
            }
        };
        let sums = match (&plane, reach) {
            (Some(plane), Some(reach)) => sum::<CHANNELS>(plane, reach, probes, &group, &lanes),
            _ => None,
        };
        match sums {
            Some(sums) => store::<CHANNELS>(finish.bytes(sums), lanes.start, cells),
            None => scalar::probes::<CHANNELS, LANES>(source, probes, lanes.start, cells, |along, down| {
                let numbers = |lanes: __m512i| {
                    // SAFETY: sixteen lanes are 64 bytes, of which any are numbers.
                    unsafe { std::mem::transmute::<__m512i, [u32; LANES]>(lanes) }
                };
                let (offsets, fractions) = group.probe(probes, _mm512_set1_epi32(together(&along, &down)));
                (numbers(offsets), numbers(fractions))
            }),
        }
        lanes.start = 0;
    }
}

/// Sixteen footprints: those of a row of a block.
struct Group {
    /// Columns and rows of the middles, less the origin.
    centre: [__m512i; 2],
    /// Of x and y: the side along in the low and the side down in the high half of each lane.
    sides: [__m512i; 2],
    width: __m512i,
}

impl Group {
    /// The footprints of a row of a block, whose cells have these taps.
    #[inline]
    #[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
    fn load(probes: &Probes<'_>, basis: &BasisPairs, block: &Block, taps: &[Tap; LANES], width: usize) -> Self {
        let taps = super::Group::load(taps);
        // the row is the whole part of (offset + 0.5) / width, see `Strided::inverse_width`
        let inverse = _mm512_set1_pd(1.0 / f64::from(probes.source_width));
        let row_of = |eight: __m256i| {
            let middle = _mm512_add_pd(_mm512_cvtepu32_pd(eight), _mm512_set1_pd(0.5));
            _mm512_cvttpd_epi32(_mm512_mul_pd(middle, inverse))
        };
        let row = _mm512_inserti64x4::<1>(
            _mm512_castsi256_si512(row_of(_mm512_castsi512_si256(taps.offsets))),
            row_of(_mm512_extracti64x4_epi64::<1>(taps.offsets)),
        );
        let rows = _mm512_mullo_epi32(row, _mm512_set1_epi32(probes.source_width as i32));
        let column = _mm512_sub_epi32(taps.offsets, rows);
        // 15 bits of fraction, as 10
        let fraction = |fraction: __m512i| _mm512_and_si512(fraction, _mm512_set1_epi32(0x3ff));
        let x = _mm512_or_si512(_mm512_slli_epi32::<10>(column), fraction(_mm512_srli_epi32::<5>(taps.fractions)));
        let y = _mm512_or_si512(_mm512_slli_epi32::<10>(row), fraction(_mm512_srli_epi32::<21>(taps.fractions)));
        let origin = |axis: usize| _mm512_set1_epi32(probes.origin[axis] - i32::from(block.offset[axis]));
        let centre = [_mm512_sub_epi32(x, origin(0)), _mm512_sub_epi32(y, origin(1))];
        let mut sides = [_mm512_setzero_si512(); 2];
        // more than half of the cells of 10 cm have one probe, which is in the middle
        let [has_along, has_down] = probes.offsets.map(|offsets| offsets.len() > 1);
        if has_along | has_down {
            let coefficients = basis.coefficients(block, probes.half_rows);
            for (axis, side) in sides.iter_mut().enumerate() {
                if has_along {
                    *side = _mm512_and_si512(basis.side(coefficients, axis), _mm512_set1_epi32(0xffff));
                }
                if has_down {
                    *side = _mm512_or_si512(*side, _mm512_slli_epi32::<16>(basis.side(coefficients, 2 + axis)));
                }
            }
        }
        Self { centre, sides, width: _mm512_set1_epi32(width as i32) }
    }

    /// Four of the footprints, in each 128 bits.
    #[inline]
    #[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
    fn four(&self, first: usize) -> Self {
        let four = _mm512_broadcast_i32x4(_mm_setr_epi32(0, 1, 2, 3));
        let four = _mm512_add_epi32(four, _mm512_set1_epi32(first as i32));
        let of_four = |lanes: __m512i| _mm512_permutexvar_epi32(four, lanes);
        let ([x, y], [x_sides, y_sides]) = (self.centre, self.sides);
        Self { centre: [of_four(x), of_four(y)], sides: [of_four(x_sides), of_four(y_sides)], width: self.width }
    }

    /// Where a probe looks, as a tap says it: offsets, and fractions of x in the low and of y in the high half of each lane.
    /// `offsets` are [`together`] in each lane.
    #[inline]
    #[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
    fn probe(&self, probes: &Probes<'_>, offsets: __m512i) -> (__m512i, __m512i) {
        let shift = _mm_cvtsi32_si128(probes.shift as i32);
        let at = |axis: usize| {
            let way = _mm512_sra_epi32(_mm512_madd_epi16(self.sides[axis], offsets), shift);
            let step = _mm_cvtsi32_si128(probes.steps[axis] as i32);
            _mm512_sra_epi32(_mm512_add_epi32(self.centre[axis], way), step)
        };
        let (column, row) = (at(0), at(1));
        let whole = |at| _mm512_srai_epi32::<10>(at);
        let offset = _mm512_add_epi32(_mm512_mullo_epi32(whole(row), self.width), whole(column));
        // 10 bits of fraction, as 15
        let x = _mm512_and_si512(_mm512_slli_epi32::<5>(column), _mm512_set1_epi32(0x7fe0));
        let y = _mm512_and_si512(_mm512_slli_epi32::<21>(row), _mm512_set1_epi32(0x7fe0_0000));
        (offset, _mm512_or_si512(x, y))
    }
}

/// A probe's offsets along and down, in the low and the high half.
#[inline(always)]
fn together(&along: &i16, &down: &i16) -> i32 {
    i32::from(along as u16) | i32::from(down) << 16
}

/// What evaluates [`Block::side`]: two polynomials of the basis side by side in each lane.
struct BasisPairs {
    low: __m512i,
    high: __m512i,
}

impl BasisPairs {
    #[inline]
    #[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
    fn new(basis: &Basis) -> Self {
        let pairs = |degree: usize| {
            let [even, odd] = [degree, degree + 1].map(|degree| _mm512_cvtepu16_epi32(sixteen(&basis[degree])));
            _mm512_or_si512(even, _mm512_slli_epi32::<16>(odd))
        };
        Self { low: pairs(0), high: pairs(2) }
    }

    /// The coefficients of a row of a block, in the low half.
    #[inline]
    #[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
    fn coefficients(&self, block: &Block, half_rows: i16) -> __m512i {
        let changes = _mm256_mullo_epi16(sixteen(&block.changes), _mm256_set1_epi16(half_rows));
        _mm512_castsi256_si512(_mm256_add_epi16(sixteen(&block.coefficients), changes))
    }

    /// One of the four sides, a number to each lane.
    #[inline]
    #[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
    fn side(&self, coefficients: __m512i, side: usize) -> __m512i {
        let pair = |index: usize| _mm512_permutexvar_epi32(_mm512_set1_epi32(index as i32), coefficients);
        let low = _mm512_madd_epi16(pair(2 * side), self.low);
        let high = _mm512_madd_epi16(pair(2 * side + 1), self.high);
        _mm512_srai_epi32::<7>(_mm512_add_epi32(low, high))
    }
}

#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
fn sixteen(numbers: &[i16; LANES]) -> __m256i {
    // SAFETY: sixteen numbers of 2 bytes are 32 bytes.
    unsafe { _mm256_loadu_si256(numbers.as_ptr().cast()) }
}

/// The sums of all probes of these lanes; `None` where a load would leave the image.
///
/// The lanes of a vector are a probe of sixteen footprints or, where that takes no more vectors, four probes of four of
/// them: few lanes are asked for where a view ends, and probes of one footprint lie closer together.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
fn sum<const CHANNELS: usize>(
    plane: &Plane<'_>,
    reach: Reach,
    probes: &Probes<'_>,
    group: &Group,
    lanes: &Range<usize>,
) -> Option<[__m512i; 2]> {
    let count = probes.count() as usize;
    let fours = lanes.start / 4 * 4..lanes.end;
    let by_fours = count >= 4 && fours.len().div_ceil(4) * count.div_ceil(4) <= count;
    let (firsts, step) = if by_fours { (fours, 4) } else { (0..1, 1) };
    let each_to_a_part = _mm512_setr_epi32(0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3);
    let mut sums = [_mm512_setzero_si512(); 2];
    for first in firsts.step_by(4) {
        let four;
        let own = if by_fours {
            four = group.four(first);
            &four
        } else {
            group
        };
        let [along, down] = probes.offsets;
        let mut lattice = down.iter().flat_map(|down| along.iter().map(move |along| together(along, down)));
        let mut parts = [_mm512_setzero_si512(); 2];
        for done in (0..count).step_by(step) {
            // those that are too many are in the middle of the footprint
            let mut next = || lattice.next().unwrap_or(0);
            let offsets = if by_fours {
                let four = _mm_setr_epi32(next(), next(), next(), next());
                _mm512_permutexvar_epi32(each_to_a_part, _mm512_castsi128_si512(four))
            } else {
                _mm512_set1_epi32(next())
            };
            let (offsets, fractions) = own.probe(probes, offsets);
            let positions = match CHANNELS {
                3 => plane.positions::<3>(offsets),
                _ => plane.positions::<4>(offsets),
            };
            let mut lanes = [0u32; 16];
            // SAFETY: sixteen lanes are 64 bytes.
            unsafe { _mm512_storeu_si512(lanes.as_mut_ptr().cast(), positions) };
            // footprints run along a row, so the lowest is the first or, where the view is mirrored, the last
            let base = lanes[0].min(lanes[15]) as usize;
            let distances = _mm512_sub_epi32(positions, _mm512_set1_epi32(base as i32));
            let weights = Weights::new(fractions);
            let in_reach = |bytes: i32| all_within(distances, bytes - 2 * CHANNELS as i32);
            let blends = if in_reach(64) && base as isize <= reach.near {
                let rows = load_window::<1>(plane, base);
                pairs_of_planar(planar::<CHANNELS>(&weights, distances, |index| near(&rows, index)))
            } else if in_reach(128) && base as isize <= reach.wide {
                let rows = load_window::<2>(plane, base);
                pairs_of_planar(planar::<CHANNELS>(&weights, distances, |index| wide(&rows, index)))
            } else if in_reach(256) && base as isize <= reach.widest {
                let rows = load_widest(plane, base);
                pairs_of_planar(planar::<CHANNELS>(&weights, distances, |index| widest(&rows, index)))
            } else if reach.gathered < 0 || !all_within(positions, reach.gathered as i32) {
                return None;
            } else {
                let blends = gather::<CHANNELS>(plane, lanes.map(|lane| lane as usize), &weights);
                [_mm512_packus_epi32(blends[0], blends[1]), _mm512_packus_epi32(blends[2], blends[3])]
            };
            // of four probes, as many as there are left; each fills 8 of the 16-bit lanes
            let counted = if by_fours { u32::MAX >> (8 * 4usize.saturating_sub(count - done)) } else { u32::MAX };
            for (parts, blends) in parts.iter_mut().zip(blends) {
                *parts = _mm512_mask_add_epi16(*parts, counted, *parts, blends);
            }
        }
        if !by_fours {
            return Some(parts);
        }
        for (sums, parts) in sums.iter_mut().zip(parts) {
            let twos = _mm512_add_epi16(parts, _mm512_shuffle_i32x4::<0b10_11_00_01>(parts, parts));
            let all = _mm512_add_epi16(twos, _mm512_shuffle_i32x4::<0b01_00_11_10>(twos, twos));
            *sums = _mm512_mask_mov_epi32(*sums, 0xf << first, all);
        }
    }
    Some(sums)
}

/// From a vector for each channel to the layout of sums.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
fn pairs_of_planar([r, g, b, a]: [__m512i; 4]) -> [__m512i; 2] {
    let rg = _mm512_or_si512(r, _mm512_slli_epi32::<16>(g));
    let ba = _mm512_or_si512(b, _mm512_slli_epi32::<16>(a));
    [_mm512_unpacklo_epi32(rg, ba), _mm512_unpackhi_epi32(rg, ba)]
}

/// How sums become averages; see [`Average::finish`](crate::kernels::average::Average::finish).
struct Finish {
    half: __m512i,
    /// log2 of the number of probes, if it is a power of two.
    shift: Option<__m128i>,
    inverse: __m512i,
}

impl Finish {
    #[inline]
    #[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
    fn new(probes: &Probes<'_>) -> Self {
        let count = probes.count();
        let half = count / if probes.round_bias { 4 } else { 2 };
        Self {
            half: _mm512_set1_epi16(half as i16),
            shift: count.is_power_of_two().then(|| _mm_cvtsi32_si128(count.ilog2() as i32)),
            inverse: _mm512_set1_epi32((1u32 << 24).div_ceil(count) as i32),
        }
    }

    /// Four bytes for each footprint.
    #[inline]
    #[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
    fn bytes(&self, sums: [__m512i; 2]) -> __m512i {
        let averages = sums.map(|sum| {
            let sum = _mm512_add_epi16(sum, self.half);
            if let Some(shift) = self.shift {
                return _mm512_srl_epi16(sum, shift);
            }
            let zero = _mm512_setzero_si512();
            let quotient = |sum| _mm512_srli_epi32::<24>(_mm512_mullo_epi32(sum, self.inverse));
            let (low, high) = (_mm512_unpacklo_epi16(sum, zero), _mm512_unpackhi_epi16(sum, zero));
            _mm512_packus_epi32(quotient(low), quotient(high))
        });
        _mm512_packus_epi16(averages[0], averages[1])
    }
}

/// Stores the cells of lanes from `first` on.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
fn store<const CHANNELS: usize>(sixteen: __m512i, first: usize, cells: &mut [u8]) {
    if cells.len() == LANES * CHANNELS {
        return super::bytes::store_cells::<CHANNELS>(sixteen, cells);
    }
    let mut all = [0; 64];
    super::bytes::store_cells::<CHANNELS>(sixteen, &mut all[..LANES * CHANNELS]);
    cells.copy_from_slice(&all[first * CHANNELS..][..cells.len()]);
}
