//! The numbers that depth and points come in.

use crate::view::Sample;

/// A number that a depth image may consist of: `u16`, `f32` and `f64`.
pub trait DepthSample: Sample + sealed::Real {}

/// A number that points may consist of: `f32` and `f64`.
pub trait PointSample: DepthSample + sealed::Coordinate {}

mod sealed {
    pub trait Real {
        /// Exact.
        fn to_f64(self) -> f64;
    }

    pub trait Coordinate {
        /// Rounded once.
        fn from_f64(value: f64) -> Self;
    }
}

pub(crate) use sealed::{Coordinate, Real};

macro_rules! depths {
    ($($number:ty),*) => {$(
        impl DepthSample for $number {}
        impl Real for $number {
            #[inline(always)]
            fn to_f64(self) -> f64 {
                f64::from(self)
            }
        }
    )*};
}
depths!(u16, f32, f64);

impl PointSample for f32 {}
impl Coordinate for f32 {
    #[inline(always)]
    fn from_f64(value: f64) -> Self {
        value as f32
    }
}

impl PointSample for f64 {}
impl Coordinate for f64 {
    #[inline(always)]
    fn from_f64(value: f64) -> Self {
        value
    }
}
