//! The arithmetic of each dtype.
//!
//! No `map` of arrays and no sums of iterators: in code compiled for an instruction set the compiler leaves these as calls,
//! six times as slow.

use super::{PlanesKernel, ProbesKernel, RowKernel, special};
use crate::isa::Isa;
use crate::table::ONE;
use crate::view::F16;
use crate::view::Sample;

pub(crate) mod sealed {
    use super::{Isa, PlanesKernel, ProbesKernel, RowKernel, Sample};

    /// The arithmetic of one dtype; see the module's contract.
    pub trait Blend: Sample {
        /// What is worked out once for all channels of a cell.
        type Weights: Copy;

        /// From the Q15 fractions along x and y, both below 2^15.
        fn weights(fx: u32, fy: u32) -> Self::Weights;

        /// The kernel of an instruction set for images of so many channels, if it has one.
        #[expect(private_interfaces, reason = "sealed: nobody outside can call it")]
        fn special(isa: Isa, channels: usize) -> Option<RowKernel<Self>>;

        /// The kernel that averages probes, likewise: faster than a kernel for each and a sum.
        #[expect(private_interfaces, reason = "sealed: nobody outside can call it")]
        fn probes(_isa: Isa, _channels: usize) -> Option<ProbesKernel<Self>> {
            None
        }

        /// The kernel of an instruction set for several images of one channel, if that is faster than one after the other.
        #[expect(private_interfaces, reason = "sealed: nobody outside can call it")]
        fn planes(_isa: Isa) -> Option<PlanesKernel<Self>> {
            None
        }

        /// Four samples (top left, top right, bottom left, bottom right) to one.
        fn blend(weights: Self::Weights, taps: [Self; 4]) -> Self;
    }
}

impl sealed::Blend for u8 {
    #[expect(private_interfaces, reason = "sealed: nobody outside can call it")]
    fn special(isa: Isa, channels: usize) -> Option<RowKernel<u8>> {
        special::bilinear_u8(isa, channels)
    }

    #[expect(private_interfaces, reason = "sealed: nobody outside can call it")]
    fn probes(isa: Isa, channels: usize) -> Option<ProbesKernel<u8>> {
        special::probes_u8(isa, channels)
    }

    /// Q15, they sum to 32768.
    type Weights = [u32; 4];

    #[inline(always)]
    fn weights(fx: u32, fy: u32) -> [u32; 4] {
        let both = (fx * fy + (ONE >> 1)) >> 15;
        [ONE + both - fx - fy, fx - both, fy - both, both]
    }

    #[inline(always)]
    fn blend(weights: [u32; 4], taps: [u8; 4]) -> u8 {
        let [a, b, c, d] = [u32::from(taps[0]), u32::from(taps[1]), u32::from(taps[2]), u32::from(taps[3])];
        let sum = weights[0] * a + weights[1] * b + weights[2] * c + weights[3] * d;
        ((sum + (ONE >> 1)) >> 15) as u8
    }
}

impl sealed::Blend for u16 {
    #[expect(private_interfaces, reason = "sealed: nobody outside can call it")]
    fn special(isa: Isa, channels: usize) -> Option<RowKernel<u16>> {
        special::bilinear_u16(isa, channels)
    }

    type Weights = (f32, f32);

    #[inline(always)]
    fn weights(fx: u32, fy: u32) -> (f32, f32) {
        f32::weights(fx, fy)
    }

    #[inline(always)]
    fn blend(weights: (f32, f32), taps: [u16; 4]) -> u16 {
        let [a, b, c, d] = taps;
        let rounded = f32::blend(weights, [a.into(), b.into(), c.into(), d.into()]) + 0.5;
        // SAFETY: a number between the pixels, which are integers of 16 bits, but for a rounding or two. The checks of `as`
        // cost as much as the blend.
        unsafe { rounded.to_int_unchecked::<i32>() as u16 }
    }
}

impl sealed::Blend for f32 {
    #[expect(private_interfaces, reason = "sealed: nobody outside can call it")]
    fn special(isa: Isa, channels: usize) -> Option<RowKernel<f32>> {
        special::bilinear_f32(isa, channels)
    }

    #[expect(private_interfaces, reason = "sealed: nobody outside can call it")]
    fn planes(isa: Isa) -> Option<PlanesKernel<f32>> {
        special::planes_f32(isa)
    }

    type Weights = (f32, f32);

    #[inline(always)]
    fn weights(fx: u32, fy: u32) -> (f32, f32) {
        // exact: 15 bits and a power of two
        (fx as f32 * (1.0 / ONE as f32), fy as f32 * (1.0 / ONE as f32))
    }

    #[inline(always)]
    fn blend((fx, fy): (f32, f32), taps: [f32; 4]) -> f32 {
        let top = taps[0] + (taps[1] - taps[0]) * fx;
        let bottom = taps[2] + (taps[3] - taps[2]) * fx;
        top + (bottom - top) * fy
    }
}

impl sealed::Blend for F16 {
    #[expect(private_interfaces, reason = "sealed: nobody outside can call it")]
    fn special(isa: Isa, channels: usize) -> Option<RowKernel<F16>> {
        special::compiled(isa, channels)
    }

    type Weights = (f32, f32);

    #[inline(always)]
    fn weights(fx: u32, fy: u32) -> (f32, f32) {
        f32::weights(fx, fy)
    }

    #[inline(always)]
    fn blend(weights: (f32, f32), taps: [F16; 4]) -> F16 {
        let [a, b, c, d] = taps;
        F16::from_f32(f32::blend(weights, [a.to_f32(), b.to_f32(), c.to_f32(), d.to_f32()]))
    }
}

impl sealed::Blend for f64 {
    #[expect(private_interfaces, reason = "sealed: nobody outside can call it")]
    fn special(isa: Isa, channels: usize) -> Option<RowKernel<f64>> {
        special::compiled(isa, channels)
    }

    type Weights = (f64, f64);

    #[inline(always)]
    fn weights(fx: u32, fy: u32) -> (f64, f64) {
        (f64::from(fx) / f64::from(ONE), f64::from(fy) / f64::from(ONE))
    }

    #[inline(always)]
    fn blend((fx, fy): (f64, f64), taps: [f64; 4]) -> f64 {
        let top = taps[0] + (taps[1] - taps[0]) * fx;
        let bottom = taps[2] + (taps[3] - taps[2]) * fx;
        top + (bottom - top) * fy
    }
}

/// A signed integer is blended as the unsigned one that is larger by half the range: flipping the top bit adds it.
macro_rules! blend_signed {
    ($signed:ty, $unsigned:ty) => {
        impl sealed::Blend for $signed {
            #[expect(private_interfaces, reason = "sealed: nobody outside can call it")]
            fn special(isa: Isa, channels: usize) -> Option<RowKernel<$signed>> {
                special::compiled(isa, channels)
            }

            type Weights = <$unsigned as sealed::Blend>::Weights;

            #[inline(always)]
            fn weights(fx: u32, fy: u32) -> Self::Weights {
                <$unsigned>::weights(fx, fy)
            }

            #[inline(always)]
            fn blend(weights: Self::Weights, taps: [$signed; 4]) -> $signed {
                let [a, b, c, d] = taps;
                let flip = |tap: $signed| (tap ^ <$signed>::MIN) as $unsigned;
                <$unsigned>::blend(weights, [flip(a), flip(b), flip(c), flip(d)]) as $signed ^ <$signed>::MIN
            }
        }
    };
}
blend_signed!(i8, u8);
blend_signed!(i16, u16);

#[cfg(test)]
mod tests {
    use super::sealed::Blend;
    use super::*;

    #[test]
    fn u8_weights_sum_to_one_and_ties_round_up() {
        for fx in (0..ONE).step_by(97) {
            for fy in (0..ONE).step_by(89) {
                assert_eq!(u8::weights(fx, fy).iter().sum::<u32>(), ONE);
            }
        }
        assert_eq!(u8::blend(u8::weights(ONE / 2, 0), [100, 101, 0, 0]), 101);
    }

    #[test]
    fn errors_stay_within_the_contract() {
        let exact = |taps: [f64; 4], x: f64, y: f64| {
            let top = taps[0] + (taps[1] - taps[0]) * x;
            top + (taps[2] + (taps[3] - taps[2]) * x - top) * y
        };
        // the worst a table does to a coordinate is half a Q15 step either way
        let corners8 = [[0u8, 255, 255, 0], [255, 0, 0, 255], [0, 255, 0, 255], [255, 255, 0, 0], [17, 203, 99, 4]];
        let corners16 = corners8.map(|taps| taps.map(|tap| u16::from(tap) * 257));
        let (mut worst8, mut worst16): (f64, f64) = (0.0, 0.0);
        for fx in (0..ONE).step_by(331) {
            for fy in (0..ONE).step_by(337) {
                for (dx, dy) in [(0.0, 0.0), (0.5, 0.5), (-0.5, 0.5), (0.5, -0.5), (-0.5, -0.5)] {
                    let (x, y) = ((f64::from(fx) + dx) / 32768.0, (f64::from(fy) + dy) / 32768.0);
                    for taps in corners8 {
                        let got = f64::from(u8::blend(u8::weights(fx, fy), taps));
                        worst8 = worst8.max((got - exact(taps.map(f64::from), x, y)).abs());
                    }
                    for taps in corners16 {
                        let got = f64::from(u16::blend(u16::weights(fx, fy), taps));
                        worst16 = worst16.max((got - exact(taps.map(f64::from), x, y)).abs());
                    }
                    for taps in corners16.map(|taps| taps.map(f32::from)) {
                        let got = f64::from(f32::blend(f32::weights(fx, fy), taps));
                        assert!((got - exact(taps.map(f64::from), x, y)).abs() <= 65535.0 / 16384.0);
                    }
                }
            }
        }
        assert!(worst8 < 0.52, "{worst8}");
        assert!(worst16 < 3.0, "{worst16}");
    }

    #[test]
    fn constants_stay_constant() {
        for fx in (0..ONE).step_by(251) {
            for fy in (0..ONE).step_by(257) {
                for value in [0u8, 1, 128, 255] {
                    assert_eq!(u8::blend(u8::weights(fx, fy), [value; 4]), value);
                    let wide = u16::from(value) * 257;
                    assert_eq!(u16::blend(u16::weights(fx, fy), [wide; 4]), wide);
                    let real = f32::from(value) * 1.1;
                    assert_eq!(f32::blend(f32::weights(fx, fy), [real; 4]), real);
                }
            }
        }
    }
}
