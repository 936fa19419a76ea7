//! Which instruction set has a kernel for what. Nothing else calls the kernels of an instruction set, and they work on
//! images of any row stride; where there is none, the scalar kernel serves.

#[cfg(target_arch = "aarch64")]
use super::neon;
use super::{ProbesKernel, RowKernel};
#[cfg(target_arch = "x86_64")]
use super::{avx2, avx512};
use crate::cpu::Isa;
use crate::image::Sample;

/// A kernel of an instruction set as an ordinary function.
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
    match isa {
        #[cfg(target_arch = "x86_64")]
        Isa::Avx2 => match pixel_bytes {
            1 => kernel!(avx2::nearest::<T, 1>),
            2 => kernel!(avx2::nearest::<T, 2>),
            3 => kernel!(avx2::nearest::<T, 3>),
            4 => kernel!(avx2::nearest::<T, 4>),
            6 => kernel!(avx2::nearest::<T, 6>),
            8 => kernel!(avx2::nearest::<T, 8>),
            12 => kernel!(avx2::nearest::<T, 12>),
            16 => kernel!(avx2::nearest::<T, 16>),
            _ => kernel!(avx2::nearest::<T, 0>),
        },
        #[cfg(target_arch = "x86_64")]
        Isa::Avx512 => match pixel_bytes {
            1 => kernel!(avx512::nearest::<T, 1>),
            2 => kernel!(avx512::nearest::<T, 2>),
            3 => kernel!(avx512::nearest::<T, 3>),
            4 => kernel!(avx512::nearest::<T, 4>),
            6 => kernel!(avx512::nearest::<T, 6>),
            8 => kernel!(avx512::nearest::<T, 8>),
            12 => kernel!(avx512::nearest::<T, 12>),
            16 => kernel!(avx512::nearest::<T, 16>),
            _ => None,
        },
        #[cfg(target_arch = "aarch64")]
        Isa::Neon => match pixel_bytes {
            1 => kernel!(neon::nearest::<T, 1>),
            2 => kernel!(neon::nearest::<T, 2>),
            3 => kernel!(neon::nearest::<T, 3>),
            4 => kernel!(neon::nearest::<T, 4>),
            8 => kernel!(neon::nearest::<T, 8>),
            _ => None,
        },
        _ => None,
    }
}

/// Bilinear of 8-bit images.
pub(super) fn bilinear_u8(isa: Isa, channels: usize) -> Option<RowKernel<u8>> {
    match isa {
        #[cfg(target_arch = "x86_64")]
        Isa::Avx2 => match channels {
            1 => kernel!(avx2::bilinear_u8::<1>),
            3 => kernel!(avx2::bilinear_u8::<3>),
            4 => kernel!(avx2::bilinear_u8::<4>),
            5.. => kernel!(avx2::bilinear_u8_any),
            _ => None,
        },
        #[cfg(target_arch = "x86_64")]
        Isa::Avx512 => match channels {
            1 => kernel!(avx512::bilinear_u8::<1>),
            2 => kernel!(avx512::bilinear_u8::<2>),
            3 => kernel!(avx512::bilinear_u8::<3>),
            4 => kernel!(avx512::bilinear_u8::<4>),
            _ => kernel!(avx512::bilinear_u8_any),
        },
        #[cfg(target_arch = "aarch64")]
        Isa::Neon => match channels {
            1 => kernel!(neon::bilinear_u8::<1>),
            3 => kernel!(neon::bilinear_u8::<3>),
            4 => kernel!(neon::bilinear_u8::<4>),
            _ => None,
        },
        _ => None,
    }
}

/// Averages of probes into 8-bit images.
pub(super) fn probes_u8(isa: Isa, channels: usize) -> Option<ProbesKernel<u8>> {
    match (isa, channels) {
        #[cfg(target_arch = "x86_64")]
        (Isa::Avx512, 3) => kernel!(avx512::probes_u8::<3>),
        #[cfg(target_arch = "x86_64")]
        (Isa::Avx512, 4) => kernel!(avx512::probes_u8::<4>),
        _ => None,
    }
}

/// Bilinear of 16-bit images.
pub(super) fn bilinear_u16(isa: Isa, channels: usize) -> Option<RowKernel<u16>> {
    match isa {
        #[cfg(target_arch = "x86_64")]
        Isa::Avx2 => match channels {
            1 => kernel!(avx2::bilinear_u16::<1>),
            3 => kernel!(avx2::bilinear_u16::<3>),
            4 => kernel!(avx2::bilinear_u16::<4>),
            5.. => kernel!(avx2::bilinear_u16_any),
            _ => None,
        },
        #[cfg(target_arch = "x86_64")]
        Isa::Avx512 => match channels {
            1 => kernel!(avx512::bilinear_float::<u16, 1>),
            2 => kernel!(avx512::bilinear_float_pairs::<u16>),
            3 => kernel!(avx512::bilinear_float::<u16, 3>),
            4 => kernel!(avx512::bilinear_float::<u16, 4>),
            _ => kernel!(avx512::bilinear_float_any::<u16>),
        },
        #[cfg(target_arch = "aarch64")]
        Isa::Neon => match channels {
            1 => kernel!(neon::bilinear_float::<u16, 1>),
            3 => kernel!(neon::bilinear_float::<u16, 3>),
            4 => kernel!(neon::bilinear_float::<u16, 4>),
            _ => None,
        },
        _ => None,
    }
}

/// Bilinear of float images.
pub(super) fn bilinear_f32(isa: Isa, channels: usize) -> Option<RowKernel<f32>> {
    match isa {
        #[cfg(target_arch = "x86_64")]
        Isa::Avx2 => match channels {
            1 => kernel!(avx2::bilinear_f32::<1>),
            3 => kernel!(avx2::bilinear_f32::<3>),
            4 => kernel!(avx2::bilinear_f32::<4>),
            5.. => kernel!(avx2::bilinear_f32_any),
            _ => None,
        },
        #[cfg(target_arch = "x86_64")]
        Isa::Avx512 => match channels {
            1 => kernel!(avx512::bilinear_float::<f32, 1>),
            2 => kernel!(avx512::bilinear_float_pairs::<f32>),
            3 => kernel!(avx512::bilinear_float::<f32, 3>),
            4 => kernel!(avx512::bilinear_float::<f32, 4>),
            _ => kernel!(avx512::bilinear_float_any::<f32>),
        },
        #[cfg(target_arch = "aarch64")]
        Isa::Neon => match channels {
            1 => kernel!(neon::bilinear_float::<f32, 1>),
            3 => kernel!(neon::bilinear_float::<f32, 3>),
            4 => kernel!(neon::bilinear_float::<f32, 4>),
            _ => None,
        },
        _ => None,
    }
}
