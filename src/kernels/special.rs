//! Which instruction set has a kernel for what. Nothing else calls the kernels of an instruction set, and they work on
//! images of any row stride; where there is none, the scalar kernel serves.

#[cfg(target_arch = "aarch64")]
use super::neon;
use super::places::{ExactBlend, Float, Places};
use super::{CopyKernel, ExactKernel, PlanesKernel, ProbesKernel, RowKernel, Source, scalar, sealed::Blend};
#[cfg(target_arch = "x86_64")]
use super::{avx2, avx512};
use crate::isa::{self, Body, Isa, by_isa};
use crate::view::Sample;

/// A kernel of an instruction set as an ordinary function.
macro_rules! kernel {
    ($kernel:expr) => {
        Some(|source, taps, cells| {
            // SAFETY: an `Isa` other than scalar comes here only from `active`, `checked`, `available` or `or_scalar`,
            // which found that the CPU has what its kernels need.
            unsafe { $kernel(source, taps, cells) }
        })
    };
}

/// Nearest, for pixels of so many bytes.
pub(super) fn nearest<T: Sample>(isa: Isa, pixel_bytes: usize) -> Option<RowKernel<T>> {
    by_isa!(
        isa,
        Scalar => None,
        Avx2 => match pixel_bytes {
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
        Avx512 => match pixel_bytes {
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
        Neon => match pixel_bytes {
            1 => kernel!(neon::nearest::<T, 1>),
            2 => kernel!(neon::nearest::<T, 2>),
            3 => kernel!(neon::nearest::<T, 3>),
            4 => kernel!(neon::nearest::<T, 4>),
            8 => kernel!(neon::nearest::<T, 8>),
            _ => None,
        },
    )
}

/// Nearest where the nearest pixels are known, for pixels of so many bytes. AVX2 alone has it (decision 0001); with AVX-512 it
/// was not tried.
#[cfg_attr(not(target_arch = "x86_64"), expect(unused_variables, reason = "only x86-64 has such kernels"))]
pub(super) fn copy<T: Sample>(isa: Isa, pixel_bytes: usize) -> Option<CopyKernel<T>> {
    by_isa!(
        isa,
        Scalar => None,
        Avx2 => match pixel_bytes {
            1 => kernel!(avx2::copy::<T, 1>),
            2 => kernel!(avx2::copy::<T, 2>),
            3 => kernel!(avx2::copy::<T, 3>),
            6 => kernel!(avx2::copy::<T, 6>),
            12 => kernel!(avx2::copy::<T, 12>),
            _ => kernel!(avx2::copy::<T, 0>),
        },
        Avx512 => None,
        Neon => None,
    )
}

/// Bilinear of 8-bit images.
pub(super) fn bilinear_u8(isa: Isa, channels: usize) -> Option<RowKernel<u8>> {
    by_isa!(
        isa,
        Scalar => None,
        Avx2 => match channels {
            1 => kernel!(avx2::bilinear_u8::<1>),
            2 => kernel!(avx2::bilinear_u8_pairs),
            3 => kernel!(avx2::bilinear_u8::<3>),
            4 => kernel!(avx2::bilinear_u8::<4>),
            5 => kernel!(avx2::bilinear_u8_few::<5>),
            6 => kernel!(avx2::bilinear_u8_few::<6>),
            7 => kernel!(avx2::bilinear_u8_few::<7>),
            8 => kernel!(avx2::bilinear_u8_few::<8>),
            _ => kernel!(avx2::bilinear_u8_any),
        },
        Avx512 => match channels {
            1 => kernel!(avx512::bilinear_u8::<1>),
            2 => kernel!(avx512::bilinear_u8::<2>),
            3 => kernel!(avx512::bilinear_u8::<3>),
            4 => kernel!(avx512::bilinear_u8::<4>),
            _ => kernel!(avx512::bilinear_u8_any),
        },
        Neon => match channels {
            1 => kernel!(neon::bilinear_u8::<1>),
            2 => kernel!(neon::bilinear_u8::<2>),
            3 => kernel!(neon::bilinear_u8::<3>),
            4 => kernel!(neon::bilinear_u8::<4>),
            _ => None,
        },
    )
}

/// Averages of probes into 8-bit images.
pub(super) fn probes_u8(isa: Isa, channels: usize) -> Option<ProbesKernel<u8>> {
    by_isa!(
        isa,
        Scalar => None,
        Avx2 => match channels {
            3 => kernel!(avx2::probes_u8::<3>),
            4 => kernel!(avx2::probes_u8::<4>),
            _ => None,
        },
        Avx512 => match channels {
            3 => kernel!(avx512::probes_u8::<3>),
            4 => kernel!(avx512::probes_u8::<4>),
            _ => None,
        },
        Neon => match channels {
            3 => kernel!(neon::probes_u8::<3>),
            4 => kernel!(neon::probes_u8::<4>),
            _ => None,
        },
    )
}

/// Bilinear of 16-bit images.
pub(super) fn bilinear_u16(isa: Isa, channels: usize) -> Option<RowKernel<u16>> {
    by_isa!(
        isa,
        Scalar => None,
        Avx2 => match channels {
            1 => kernel!(avx2::bilinear_u16::<1>),
            2 => kernel!(avx2::bilinear_u16_pairs),
            3 => kernel!(avx2::bilinear_u16::<3>),
            4 => kernel!(avx2::bilinear_u16::<4>),
            5.. => kernel!(avx2::bilinear_u16_any),
            _ => None,
        },
        Avx512 => match channels {
            1 => kernel!(avx512::bilinear_float::<u16, _, 1>),
            2 => kernel!(avx512::bilinear_float_pairs::<u16, _>),
            3 => kernel!(avx512::bilinear_float::<u16, _, 3>),
            4 => kernel!(avx512::bilinear_float::<u16, _, 4>),
            _ => kernel!(avx512::bilinear_float_any::<u16, _>),
        },
        Neon => match channels {
            1 => kernel!(neon::bilinear_float::<u16, _, 1>),
            2 => kernel!(neon::bilinear_float::<u16, _, 2>),
            3 => kernel!(neon::bilinear_float::<u16, _, 3>),
            4 => kernel!(neon::bilinear_float::<u16, _, 4>),
            _ => None,
        },
    )
}

/// The kernel of float images, for taps of either kind.
macro_rules! kernel_f32 {
    ($isa:expr, $channels:expr) => {
        by_isa!(
            $isa,
            Scalar => None,
            Avx2 => match $channels {
                1 => kernel!(avx2::bilinear_f32::<_, 1>),
                2 => kernel!(avx2::bilinear_f32_pairs::<_>),
                3 => kernel!(avx2::bilinear_f32::<_, 3>),
                4 => kernel!(avx2::bilinear_f32::<_, 4>),
                5.. => kernel!(avx2::bilinear_f32_any::<_>),
                _ => None,
            },
            Avx512 => match $channels {
                1 => kernel!(avx512::bilinear_float::<f32, _, 1>),
                2 => kernel!(avx512::bilinear_float_pairs::<f32, _>),
                3 => kernel!(avx512::bilinear_float::<f32, _, 3>),
                4 => kernel!(avx512::bilinear_float::<f32, _, 4>),
                _ => kernel!(avx512::bilinear_float_any::<f32, _>),
            },
            Neon => match $channels {
                1 => kernel!(neon::bilinear_float::<f32, _, 1>),
                2 => kernel!(neon::bilinear_float::<f32, _, 2>),
                3 => kernel!(neon::bilinear_float::<f32, _, 3>),
                4 => kernel!(neon::bilinear_float::<f32, _, 4>),
                _ => None,
            },
        )
    };
}

/// Bilinear of float images.
pub(super) fn bilinear_f32(isa: Isa, channels: usize) -> Option<RowKernel<f32>> {
    kernel_f32!(isa, channels)
}

/// Bilinear of several float images of one channel. AVX2 alone has it.
pub(super) fn planes_f32(isa: Isa) -> Option<PlanesKernel<f32>> {
    by_isa!(
        isa,
        Scalar => None,
        Avx2 => kernel!(avx2::bilinear_f32_planes),
        Avx512 => None,
        Neon => None,
    )
}

/// Bilinear of float32 with exact fractions.
pub(super) fn exact_f32(isa: Isa, channels: usize) -> Option<ExactKernel<f32, f32>> {
    kernel_f32!(isa, channels)
}

/// The scalar kernel in the vectors of an instruction set, for taps of either kind.
macro_rules! kernel_compiled {
    ($isa:expr, $channels:expr) => {
        by_isa!(
            $isa,
            Scalar => None,
            Avx2 => kernel_compiled_for!(Avx2, $channels),
            Avx512 => kernel_compiled_for!(Avx512, $channels),
            Neon => kernel_compiled_for!(Neon, $channels),
        )
    };
}

/// [`kernel_compiled`] for one instruction set.
#[cfg(any(target_arch = "x86_64", target_arch = "aarch64"))]
macro_rules! kernel_compiled_for {
    ($isa:ident, $channels:expr) => {
        match $channels {
            1 => Some(|source, places, cells| isa::run(Isa::$isa, Row::<_, _, 1> { source, places, cells })),
            2 => Some(|source, places, cells| isa::run(Isa::$isa, Row::<_, _, 2> { source, places, cells })),
            3 => Some(|source, places, cells| isa::run(Isa::$isa, Row::<_, _, 3> { source, places, cells })),
            4 => Some(|source, places, cells| isa::run(Isa::$isa, Row::<_, _, 4> { source, places, cells })),
            _ => Some(|source, places, cells| isa::run(Isa::$isa, Row::<_, _, 0> { source, places, cells })),
        }
    };
}

/// Bilinear of samples that have no kernels by hand.
pub(super) fn compiled<T: Blend>(isa: Isa, channels: usize) -> Option<RowKernel<T>> {
    kernel_compiled!(isa, channels)
}

/// Bilinear with exact fractions, of samples that have no kernels by hand.
pub(super) fn compiled_exact<F: Float, T: ExactBlend<F>>(isa: Isa, channels: usize) -> Option<ExactKernel<T, F>> {
    kernel_compiled!(isa, channels)
}

/// The scalar kernel's work on neighbouring cells.
struct Row<'a, T, P, const CHANNELS: usize> {
    source: &'a Source<'a, T>,
    places: P,
    cells: &'a mut [T],
}

impl<T: Blend, P: Places<T>, const CHANNELS: usize> Body for Row<'_, T, P, CHANNELS> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { source, places, cells } = self;
        if source.image.is_contiguous() {
            scalar::blend_cells::<T, P, CHANNELS, true>(source, places, cells);
        } else {
            scalar::blend_cells::<T, P, CHANNELS, false>(source, places, cells);
        }
    }
}
