//! Which instruction set has a kernel for what. Nothing else calls the kernels of an instruction set, and they work on
//! images of any row stride; where there is none, the scalar kernel serves.

use super::RowKernel;
use crate::cpu::Isa;
use crate::image::Sample;

/// A kernel of an instruction set as an ordinary function.
#[cfg(any(target_arch = "x86_64", target_arch = "aarch64"))]
macro_rules! kernel {
    ($kernel:expr) => {
        Some(|source, taps, cells| {
            // SAFETY: an `Isa` other than scalar is only made where `Isa::is_supported` found what its kernels need.
            unsafe { $kernel(source, taps, cells) }
        })
    };
}

/// Nearest, for pixels of so many bytes.
pub(super) fn nearest<T: Sample>(isa: Isa, pixel_bytes: usize) -> Option<RowKernel<T>> {
    match (isa, pixel_bytes) {
        #[cfg(target_arch = "x86_64")]
        (Isa::Avx512, 1) => kernel!(super::avx512::nearest::<T, 1>),
        #[cfg(target_arch = "x86_64")]
        (Isa::Avx512, 2) => kernel!(super::avx512::nearest::<T, 2>),
        #[cfg(target_arch = "x86_64")]
        (Isa::Avx512, 3) => kernel!(super::avx512::nearest::<T, 3>),
        #[cfg(target_arch = "x86_64")]
        (Isa::Avx512, 4) => kernel!(super::avx512::nearest::<T, 4>),
        #[cfg(target_arch = "x86_64")]
        (Isa::Avx512, 6) => kernel!(super::avx512::nearest::<T, 6>),
        #[cfg(target_arch = "x86_64")]
        (Isa::Avx512, 8) => kernel!(super::avx512::nearest::<T, 8>),
        #[cfg(target_arch = "x86_64")]
        (Isa::Avx512, 12) => kernel!(super::avx512::nearest::<T, 12>),
        #[cfg(target_arch = "x86_64")]
        (Isa::Avx512, 16) => kernel!(super::avx512::nearest::<T, 16>),
        #[cfg(target_arch = "aarch64")]
        (Isa::Neon, 1) => kernel!(super::neon::nearest::<T, 1>),
        #[cfg(target_arch = "aarch64")]
        (Isa::Neon, 2) => kernel!(super::neon::nearest::<T, 2>),
        #[cfg(target_arch = "aarch64")]
        (Isa::Neon, 3) => kernel!(super::neon::nearest::<T, 3>),
        #[cfg(target_arch = "aarch64")]
        (Isa::Neon, 4) => kernel!(super::neon::nearest::<T, 4>),
        #[cfg(target_arch = "aarch64")]
        (Isa::Neon, 8) => kernel!(super::neon::nearest::<T, 8>),
        _ => None,
    }
}

/// Bilinear of 8-bit images.
pub(super) fn bilinear_u8(isa: Isa, channels: usize) -> Option<RowKernel<u8>> {
    match (isa, channels) {
        #[cfg(target_arch = "x86_64")]
        (Isa::Avx512, 1) => kernel!(super::avx512::bilinear_u8::<1>),
        #[cfg(target_arch = "x86_64")]
        (Isa::Avx512, 2) => kernel!(super::avx512::bilinear_u8::<2>),
        #[cfg(target_arch = "x86_64")]
        (Isa::Avx512, 3) => kernel!(super::avx512::bilinear_u8::<3>),
        #[cfg(target_arch = "x86_64")]
        (Isa::Avx512, 4) => kernel!(super::avx512::bilinear_u8::<4>),
        #[cfg(target_arch = "x86_64")]
        (Isa::Avx512, _) => kernel!(super::avx512::bilinear_u8_any),
        #[cfg(target_arch = "aarch64")]
        (Isa::Neon, 1) => kernel!(super::neon::bilinear_u8::<1>),
        #[cfg(target_arch = "aarch64")]
        (Isa::Neon, 3) => kernel!(super::neon::bilinear_u8::<3>),
        #[cfg(target_arch = "aarch64")]
        (Isa::Neon, 4) => kernel!(super::neon::bilinear_u8::<4>),
        _ => None,
    }
}

/// Bilinear of 16-bit images.
pub(super) fn bilinear_u16(isa: Isa, channels: usize) -> Option<RowKernel<u16>> {
    match (isa, channels) {
        #[cfg(target_arch = "x86_64")]
        (Isa::Avx512, 1) => kernel!(super::avx512::bilinear_float::<u16, 1>),
        #[cfg(target_arch = "x86_64")]
        (Isa::Avx512, 3) => kernel!(super::avx512::bilinear_float::<u16, 3>),
        #[cfg(target_arch = "x86_64")]
        (Isa::Avx512, 4) => kernel!(super::avx512::bilinear_float::<u16, 4>),
        #[cfg(target_arch = "x86_64")]
        (Isa::Avx512, _) => kernel!(super::avx512::bilinear_float_any::<u16>),
        #[cfg(target_arch = "aarch64")]
        (Isa::Neon, 1) => kernel!(super::neon::bilinear_float::<u16, 1>),
        #[cfg(target_arch = "aarch64")]
        (Isa::Neon, 3) => kernel!(super::neon::bilinear_float::<u16, 3>),
        #[cfg(target_arch = "aarch64")]
        (Isa::Neon, 4) => kernel!(super::neon::bilinear_float::<u16, 4>),
        _ => None,
    }
}

/// Bilinear of float images.
pub(super) fn bilinear_f32(isa: Isa, channels: usize) -> Option<RowKernel<f32>> {
    match (isa, channels) {
        #[cfg(target_arch = "x86_64")]
        (Isa::Avx512, 1) => kernel!(super::avx512::bilinear_float::<f32, 1>),
        #[cfg(target_arch = "x86_64")]
        (Isa::Avx512, 3) => kernel!(super::avx512::bilinear_float::<f32, 3>),
        #[cfg(target_arch = "x86_64")]
        (Isa::Avx512, 4) => kernel!(super::avx512::bilinear_float::<f32, 4>),
        #[cfg(target_arch = "x86_64")]
        (Isa::Avx512, _) => kernel!(super::avx512::bilinear_float_any::<f32>),
        #[cfg(target_arch = "aarch64")]
        (Isa::Neon, 1) => kernel!(super::neon::bilinear_float::<f32, 1>),
        #[cfg(target_arch = "aarch64")]
        (Isa::Neon, 3) => kernel!(super::neon::bilinear_float::<f32, 3>),
        #[cfg(target_arch = "aarch64")]
        (Isa::Neon, 4) => kernel!(super::neon::bilinear_float::<f32, 4>),
        _ => None,
    }
}
