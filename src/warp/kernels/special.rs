//! Which instruction set has a kernel for what. Nothing else calls the kernels of an instruction set, and they work on
//! images of any row stride; where there is none, the scalar kernel serves.

use super::RowKernel;
use crate::cpu::Isa;
use crate::image::Sample;

/// A kernel of an instruction set as an ordinary function.
#[cfg(target_arch = "x86_64")]
macro_rules! kernel {
    ($kernel:expr) => {
        Some(|source, taps, cells| {
            // SAFETY: an `Isa` other than scalar is only made where `Isa::is_supported` found what its kernels need.
            unsafe { $kernel(source, taps, cells) }
        })
    };
}

/// Nearest, for pixels of so many bytes.
pub(super) fn nearest<T: Sample>(_isa: Isa, _pixel_bytes: usize) -> Option<RowKernel<T>> {
    None
}

/// Bilinear of 8-bit images.
pub(super) fn bilinear_u8(isa: Isa, channels: usize) -> Option<RowKernel<u8>> {
    match (isa, channels) {
        #[cfg(target_arch = "x86_64")]
        (Isa::Avx512, 1) => kernel!(super::avx512::bilinear_u8::<1>),
        #[cfg(target_arch = "x86_64")]
        (Isa::Avx512, 3) => kernel!(super::avx512::bilinear_u8::<3>),
        #[cfg(target_arch = "x86_64")]
        (Isa::Avx512, 4) => kernel!(super::avx512::bilinear_u8::<4>),
        _ => None,
    }
}

/// Bilinear of 16-bit images.
pub(super) fn bilinear_u16(_isa: Isa, _channels: usize) -> Option<RowKernel<u16>> {
    None
}

/// Bilinear of float images.
pub(super) fn bilinear_f32(_isa: Isa, _channels: usize) -> Option<RowKernel<f32>> {
    None
}
