//! The numbers that images, depth and points consist of: one family of traits, all of plain memory.

use super::F16;

/// A number that an image may consist of.
///
/// Kernels move samples as bytes and read bytes as samples, which is why they are plain memory: no padding, and every bit
/// pattern is a value.
pub trait Sample: Default + Send + Sync + sealed::Plain {}

mod sealed {
    /// Nobody else makes samples.
    pub trait Plain: bytemuck::Pod {}
}

macro_rules! samples {
    ($($number:ty),*) => {$(
        impl sealed::Plain for $number {}
        impl Sample for $number {}
    )*};
}
samples!(u8, u16, u32, u64, i8, i16, i32, i64, F16, f32, f64);

/// The bytes of samples.
pub(crate) fn as_bytes<T: Sample>(samples: &[T]) -> &[u8] {
    bytemuck::must_cast_slice(samples)
}

/// The bytes of samples, writable.
pub(crate) fn as_bytes_mut<T: Sample>(samples: &mut [T]) -> &mut [u8] {
    bytemuck::must_cast_slice_mut(samples)
}

/// A number that a depth image may consist of: `u16`, `f32` and `f64`.
pub trait DepthSample: Sample {
    /// The number in float64, which holds each of these types exactly.
    fn to_f64(self) -> f64;
}

macro_rules! depths {
    ($($number:ty),*) => {$(
        impl DepthSample for $number {
            #[inline(always)]
            fn to_f64(self) -> f64 {
                f64::from(self)
            }
        }
    )*};
}
depths!(u16, f32, f64);

/// A number that points and layers may consist of: `f32` and `f64`.
pub trait PointSample: DepthSample + PartialOrd {
    /// What a point that is none, or an empty cell, holds.
    const NAN: Self;
    /// The nearest number: rounded once.
    fn from_f64(value: f64) -> Self;
}

impl PointSample for f32 {
    const NAN: Self = f32::NAN;
    #[inline(always)]
    fn from_f64(value: f64) -> Self {
        value as f32
    }
}

impl PointSample for f64 {
    const NAN: Self = f64::NAN;
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
