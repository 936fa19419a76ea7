//! Half-precision floats: IEEE 754 binary16, NumPy's `float16`.
//!
//! Arithmetic is done in float32, which holds every half exactly. The conversions are plain integer and float32
//! operations without branches, so that the compiler makes vectors of them for every instruction set and all agree to
//! the last bit, whether or not the CPU has instructions for halves.

/// A half-precision float: 1 sign bit, 5 bits of exponent, 10 of fraction.
#[derive(Debug, Clone, Copy, Default, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(transparent)]
pub struct F16(u16);

/// The exponent of float32 is biased by 127, that of a half by 15; fractions have 23 and 10 bits.
const REBIAS: u32 = (127 - 15) << 23;
const EXPONENT: u32 = 0x1f << 23;
const INFINITY: u32 = 0xff << 23;

impl F16 {
    /// The number that these bits are.
    pub const fn from_bits(bits: u16) -> Self {
        Self(bits)
    }

    /// Its bits.
    pub const fn to_bits(self) -> u16 {
        self.0
    }

    /// The same number.
    #[inline(always)]
    pub fn to_f32(self) -> f32 {
        let magnitude = u32::from(self.0 & 0x7fff) << 13;
        let exponent = magnitude & EXPONENT;
        let normal = magnitude + REBIAS;
        // read as fractions behind an exponent of their own, of which the leading one is taken away again
        let subnormal = (f32::from_bits(normal + (1 << 23)) - f32::from_bits(REBIAS + (1 << 23))).to_bits();
        let finite = if exponent == 0 { subnormal } else { normal };
        let bits = if exponent == EXPONENT { magnitude | INFINITY } else { finite };
        f32::from_bits(bits | u32::from(self.0 & 0x8000) << 16)
    }

    /// The nearest half, ties to even; from 65520 on it is infinity.
    #[inline(always)]
    pub fn from_f32(value: f32) -> Self {
        /// The least normal half, 2^-14.
        const LEAST_NORMAL: u32 = REBIAS + (1 << 23);
        /// 2^16: every half beyond the largest.
        const TOO_LARGE: u32 = (127 + 16) << 23;
        let bits = value.to_bits();
        let magnitude = bits & 0x7fff_ffff;
        // added to 0.5, whose last bit is 2^-24 as that of the least halves is, a number is rounded by the CPU
        let subnormal = (f32::from_bits(magnitude) + 0.5).to_bits().wrapping_sub(0.5f32.to_bits());
        let odd = magnitude >> 13 & 1;
        let normal = magnitude.wrapping_sub(REBIAS).wrapping_add(0xfff + odd) >> 13;
        let finite = if magnitude < LEAST_NORMAL { subnormal } else { normal };
        // a quiet NaN keeps what its payload has room for
        let nan = 0x7e00 | (magnitude >> 13 & 0x1ff);
        let special = if magnitude > INFINITY { nan } else { 0x7c00 };
        let half = if magnitude >= TOO_LARGE { special } else { finite };
        Self((half | bits >> 16 & 0x8000) as u16)
    }
}

impl From<F16> for f32 {
    fn from(half: F16) -> Self {
        half.to_f32()
    }
}

impl From<F16> for f64 {
    fn from(half: F16) -> Self {
        half.to_f32().into()
    }
}

/// As of floats: zeros of both signs are equal, NaN is equal to nothing.
impl PartialEq for F16 {
    fn eq(&self, other: &Self) -> bool {
        self.to_f32() == other.to_f32()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By the standard's definition.
    fn by_definition(bits: u16) -> f64 {
        let (exponent, fraction) = (i32::from(bits >> 10 & 0x1f), f64::from(bits & 0x3ff));
        let magnitude = match exponent {
            0 => fraction * 2f64.powi(-24),
            31 if fraction == 0.0 => f64::INFINITY,
            31 => f64::NAN,
            _ => (1024.0 + fraction) * 2f64.powi(exponent - 25),
        };
        if bits >> 15 == 1 { -magnitude } else { magnitude }
    }

    #[test]
    fn every_half_is_what_the_standard_says_and_comes_back() {
        for bits in 0..=u16::MAX {
            let (half, expected) = (F16::from_bits(bits), by_definition(bits));
            let (single, back) = (half.to_f32(), F16::from_f32(half.to_f32()).to_bits());
            if expected.is_nan() {
                assert!(single.is_nan() && F16::from_bits(back).to_f32().is_nan(), "{bits:#06x}");
                assert_eq!(back & !0x200, bits & !0x200, "a NaN's sign and payload: {bits:#06x}");
                continue;
            }
            assert_eq!(f64::from(single).to_bits(), expected.to_bits(), "{bits:#06x}");
            assert_eq!(back, bits);
        }
    }

    #[test]
    fn rounds_to_the_nearest_half_and_ties_to_even() {
        for bits in 0..0x7c00u16 {
            // the next half, or where it would be: beyond 65504 lies 65536
            let (low, high) = (by_definition(bits), if bits == 0x7bff { 65536.0 } else { by_definition(bits + 1) });
            let middle = ((low + high) / 2.0) as f32; // exact: one bit more than a half has
            let even = bits + (bits & 1);
            for sign in [0, 0x8000u16] {
                let signed = |value: f32| if sign == 0 { value } else { -value };
                let rounded = |value: f32| F16::from_f32(signed(value)).to_bits();
                assert_eq!(rounded(middle), even | sign, "{middle}");
                assert_eq!(rounded(middle.next_down()), bits | sign, "below {middle}");
                assert_eq!(rounded(middle.next_up()), (bits + 1) | sign, "above {middle}");
            }
        }
        for (value, bits) in [(0.0, 0), (-0.0, 0x8000), (1e-30, 0), (f32::MIN_POSITIVE / 4.0, 0), (-1e-8, 0x8000)] {
            assert_eq!(F16::from_f32(value).to_bits(), bits, "{value}");
        }
        for value in [65_520.0, 7e4, 1e30, f32::MAX, f32::INFINITY] {
            assert_eq!(F16::from_f32(value).to_bits(), 0x7c00, "{value}");
            assert_eq!(F16::from_f32(-value).to_bits(), 0xfc00, "{value}");
        }
    }
}
