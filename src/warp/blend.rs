//! The samples that every interpolation takes.

use super::area::Area;
use super::direct::WarpDirect;
use crate::kernels::sealed::Blend;
use crate::kernels::wide::Wide;
use crate::view::F16;

/// A sample that can be blended: integers of 8 and 16 bits, and floats.
pub trait Bilinear: Blend + Wide + Area + WarpDirect {}

impl Bilinear for u8 {}
impl Bilinear for u16 {}
impl Bilinear for i8 {}
impl Bilinear for i16 {}
impl Bilinear for F16 {}
impl Bilinear for f32 {}
impl Bilinear for f64 {}
