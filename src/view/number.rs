//! The numbers of points, values and layers.

use crate::view::buffer::Zeroable;

/// Numbers of points and layers: f32 and f64.
#[expect(private_bounds, reason = "nobody else makes numbers")]
pub trait Real: Zeroable + PartialOrd {
    /// What an empty cell holds.
    const NAN: Self;
    /// The same number in float64.
    fn to_f64(self) -> f64;
    /// The nearest number.
    fn from_f64(value: f64) -> Self;
}

impl Real for f32 {
    const NAN: Self = f32::NAN;
    #[inline(always)]
    fn to_f64(self) -> f64 {
        f64::from(self)
    }
    #[inline(always)]
    fn from_f64(value: f64) -> Self {
        value as f32
    }
}

impl Real for f64 {
    const NAN: Self = f64::NAN;
    #[inline(always)]
    fn to_f64(self) -> f64 {
        self
    }
    #[inline(always)]
    fn from_f64(value: f64) -> Self {
        value
    }
}

/// A number that can stand in a layer of `T`.
pub trait Cast<T>: Copy + Sync {
    /// The number in a layer: the same wherever `T` can hold it (64-bit integers beyond 2^53 are rounded).
    fn cast(self) -> T;
}

macro_rules! casts {
    ($($layer:ident: $($number:ident)*;)*) => {$($(
        impl Cast<$layer> for $number {
            #[inline(always)]
            fn cast(self) -> $layer {
                self as $layer
            }
        }
    )*)*};
}
casts! {
    f32: f32 u8 i8 u16 i16;
    f64: f64 f32 u8 i8 u16 i16 u32 i32 u64 i64;
}
