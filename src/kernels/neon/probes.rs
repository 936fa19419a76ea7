//! Averages of probes into 8-bit images of 3 and 4 channels: eight footprints at a time, whose probes are found, blended and
//! summed up in registers, as with AVX2.

use std::arch::aarch64::*;

use super::Four;
use super::bytes::{Weights, blend, store_four, store_three};
use crate::kernels::plane::Plane;
use crate::kernels::{Probes, Source, scalar};
use crate::table::Tap;
use crate::table::block::Block;

/// Footprints that are filled at once.
const CELLS: usize = 8;

/// A number for each of eight footprints.
type Eight = [int32x4_t; 2];

/// Footprints whose probes' pixels exist, of an image of 3 or 4 channels.
///
/// # Safety
/// The CPU has NEON.
#[target_feature(enable = "neon")]
pub(in crate::kernels) fn probes_u8<const CHANNELS: usize>(
    source: &Source<'_, u8>,
    probes: &Probes<'_>,
    cells: &mut [u8],
) {
    let plane = Plane::new(source);
    let (basis, finish) = (probes.size.basis(), Finish::new(probes));
    let (width, columns) = (source.image.width(), probes.size.columns());
    let (mut taps, mut rest, mut first) = (probes.taps, cells, probes.skip);
    for block in probes.blocks {
        let count = (columns - first).min(taps.len());
        let (own, cells);
        (own, taps) = taps.split_at(count);
        (cells, rest) = rest.split_at_mut(count * CHANNELS);
        let sides: [_; 4] = std::array::from_fn(|side| block.side(side, probes.half_rows, basis));
        let eights = own.chunks(CELLS).zip(cells.chunks_mut(CELLS * CHANNELS));
        for (lane, (own, cells)) in (first..).step_by(CELLS).zip(eights) {
            // the last footprint fills the lanes that are too many
            let nearest = |index: usize| index.min(own.len() - 1);
            let eight = |side: &[i16; 16]| std::array::from_fn(|index| side[lane + nearest(index)]);
            let own: [Tap; CELLS] = std::array::from_fn(|index| own[nearest(index)]);
            let group = Footprints::new(probes, block, sides.each_ref().map(eight), &own, width);
            let sums = plane.as_ref().and_then(|plane| group.sum::<CHANNELS>(plane, probes));
            let Some(sums) = sums else {
                scalar::probes::<CHANNELS, CELLS>(source, probes, 0, cells, |along, down| {
                    let (offsets, fractions) = group.probe(probes, along, down);
                    (unsigned(offsets), unsigned(fractions))
                });
                continue;
            };
            let averages = finish.averages(sums);
            let mut all = [0; 4 * CELLS];
            let all = &mut all[..CELLS * CHANNELS];
            let is_whole = cells.len() == all.len();
            let to = if is_whole { &mut *cells } else { &mut *all };
            if CHANNELS == 4 {
                store_four(averages, to)
            } else {
                store_three(averages, to)
            }
            if !is_whole {
                cells.copy_from_slice(&all[..cells.len()]);
            }
        }
        first = 0;
    }
}

/// Eight footprints.
struct Footprints {
    /// Columns and rows of the middles, less the origin.
    centre: [Eight; 2],
    /// Of x and y the side along, then of x and y the side down.
    sides: [int16x8_t; 4],
    width: int32x4_t,
}

impl Footprints {
    /// Footprints of a row of a block, of these sides and cells.
    #[inline]
    #[target_feature(enable = "neon")]
    fn new(probes: &Probes<'_>, block: &Block, sides: [[i16; CELLS]; 4], taps: &[Tap; CELLS], width: usize) -> Self {
        let (halves, _) = taps.as_chunks::<4>();
        let taps = [Four::load(&halves[0]), Four::load(&halves[1])];
        // the row is the whole part of (offset + 0.5) / width, see `Strided::inverse_width`
        let inverse = vdupq_n_f64(1.0 / f64::from(probes.source_width));
        let row_of = |two: uint32x2_t| {
            let middle = vaddq_f64(vcvtq_f64_u64(vmovl_u32(two)), vdupq_n_f64(0.5));
            vmovn_u64(vcvtq_u64_f64(vmulq_f64(middle, inverse)))
        };
        let mut centre = [[vdupq_n_s32(0); 2]; 2];
        for (half, four) in taps.iter().enumerate() {
            let row = vcombine_u32(row_of(vget_low_u32(four.offsets)), row_of(vget_high_u32(four.offsets)));
            let column = vmlsq_n_u32(four.offsets, row, probes.source_width);
            // 15 bits of fraction, as 10
            let fraction = |fraction: uint32x4_t| vandq_u32(fraction, vdupq_n_u32(0x3ff));
            let x = vorrq_u32(vshlq_n_u32::<10>(column), fraction(vshrq_n_u32::<5>(four.fractions)));
            let y = vorrq_u32(vshlq_n_u32::<10>(row), fraction(vshrq_n_u32::<21>(four.fractions)));
            for (axis, at) in [x, y].into_iter().enumerate() {
                let origin = probes.origin[axis] - i32::from(block.offset[axis]);
                centre[axis][half] = vsubq_s32(vreinterpretq_s32_u32(at), vdupq_n_s32(origin));
            }
        }
        // SAFETY: eight numbers of 2 bytes.
        let sides = sides.each_ref().map(|side| unsafe { vld1q_s16(side.as_ptr()) });
        Self { centre, sides, width: vdupq_n_s32(width as i32) }
    }

    /// Where a probe looks, as a tap says it: offsets, and fractions of x in the low and of y in the high half of each lane.
    #[inline]
    #[target_feature(enable = "neon")]
    fn probe(&self, probes: &Probes<'_>, along: i16, down: i16) -> (Eight, Eight) {
        // a shift to the right is one to the left by less than nothing
        let shift = vdupq_n_s32(-(probes.shift as i32));
        let at = |axis: usize| {
            let (a, d) = (self.sides[axis], self.sides[2 + axis]);
            let low = vmlal_n_s16(vmull_n_s16(vget_low_s16(a), along), vget_low_s16(d), down);
            let high = vmlal_high_n_s16(vmull_high_n_s16(a, along), d, down);
            let step = vdupq_n_s32(-(probes.steps[axis] as i32));
            let [low_centre, high_centre] = self.centre[axis];
            [
                vshlq_s32(vaddq_s32(low_centre, vshlq_s32(low, shift)), step),
                vshlq_s32(vaddq_s32(high_centre, vshlq_s32(high, shift)), step),
            ]
        };
        let (column, row) = (at(0), at(1));
        let offset = |half: usize| vmlaq_s32(vshrq_n_s32::<10>(column[half]), vshrq_n_s32::<10>(row[half]), self.width);
        // 10 bits of fraction, as 15
        let fraction = |half: usize| {
            let x = vandq_s32(vshlq_n_s32::<5>(column[half]), vdupq_n_s32(0x7fe0));
            let y = vandq_s32(vshlq_n_s32::<21>(row[half]), vdupq_n_s32(0x7fe0_0000));
            vorrq_s32(x, y)
        };
        ([offset(0), offset(1)], [fraction(0), fraction(1)])
    }

    /// The sums of all probes, four lanes a footprint; `None` where a load would leave the image.
    #[inline]
    #[target_feature(enable = "neon")]
    fn sum<const CHANNELS: usize>(&self, plane: &Plane<'_>, probes: &Probes<'_>) -> Option<[uint16x8_t; 4]> {
        let last = plane.limit(8) as isize;
        let mut sums = [vdupq_n_u16(0); 4];
        for &down in probes.offsets[1] {
            for &along in probes.offsets[0] {
                let (offsets, fractions) = self.probe(probes, along, down);
                let positions = unsigned(offsets).map(|offset| plane.position::<CHANNELS>(offset));
                // with 3 channels, beyond the two pixels of a row lie two bytes that the image may not have
                if CHANNELS == 3 && positions.iter().any(|&position| position as isize > last) {
                    return None;
                }
                let rows = positions.map(|position| plane.row_and_below(position));
                let [low, high] = fractions.map(|half| vreinterpretq_u32_s32(half));
                let uint8x16x2_t(first, second) = blend::<CHANNELS>(rows, &Weights::new(low, high));
                sums = [
                    vaddw_u8(sums[0], vget_low_u8(first)),
                    vaddw_high_u8(sums[1], first),
                    vaddw_u8(sums[2], vget_low_u8(second)),
                    vaddw_high_u8(sums[3], second),
                ];
            }
        }
        Some(sums)
    }
}

/// Eight lanes as numbers without a sign.
#[inline]
#[target_feature(enable = "neon")]
fn unsigned(eight: Eight) -> [u32; CELLS] {
    let mut lanes = [0; CELLS];
    for (lanes, four) in lanes.as_chunks_mut::<4>().0.iter_mut().zip(eight) {
        // SAFETY: four lanes.
        unsafe { vst1q_u32(lanes.as_mut_ptr(), vreinterpretq_u32_s32(four)) };
    }
    lanes
}

/// How sums become averages; see [`Average::finish`](crate::kernels::average::Average::finish).
struct Finish {
    half: uint16x8_t,
    /// log2 of the number of probes, as a shift to the left, if it is a power of two.
    shift: Option<int16x8_t>,
    inverse: u32,
}

impl Finish {
    #[inline]
    #[target_feature(enable = "neon")]
    fn new(probes: &Probes<'_>) -> Self {
        let count = probes.count();
        Self {
            half: vdupq_n_u16((count / if probes.round_bias { 4 } else { 2 }) as u16),
            shift: count.is_power_of_two().then(|| vdupq_n_s16(-(count.ilog2() as i16))),
            inverse: (1u32 << 24).div_ceil(count),
        }
    }

    #[inline]
    #[target_feature(enable = "neon")]
    fn averages(&self, sums: [uint16x8_t; 4]) -> uint8x16x2_t {
        let average = |sum: uint16x8_t| {
            let sum = vaddq_u16(sum, self.half);
            if let Some(shift) = self.shift {
                return vmovn_u16(vshlq_u16(sum, shift));
            }
            let quotient = |sum: uint32x4_t| vmovn_u32(vshrq_n_u32::<24>(vmulq_n_u32(sum, self.inverse)));
            vmovn_u16(vcombine_u16(quotient(vmovl_u16(vget_low_u16(sum))), quotient(vmovl_high_u16(sum))))
        };
        let [a, b, c, d] = sums.map(average);
        uint8x16x2_t(vcombine_u8(a, b), vcombine_u8(c, d))
    }
}
