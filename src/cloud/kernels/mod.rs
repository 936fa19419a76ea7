//! The loops that a cloud spends its time in, as plain Rust without branches: the compiler makes vectors of them for
//! each instruction set (decision 0005). Nothing is fused or reordered, so all give the same answers to the last bit.

mod decode;
mod points;
mod project;

pub(super) use decode::{Decode, Encode};
pub(super) use points::{PinholeRays, PointsRow, Rotate, Unit};
pub(super) use project::ProjectPinhole;

use crate::cpu::Isa;

/// A loop, compiled once for each instruction set.
///
/// `run` must be `#[inline(always)]`, or it is compiled for the baseline alone.
pub(super) trait Body {
    /// What it returns.
    type Output;

    /// The loop.
    fn run(self) -> Self::Output;
}

/// Runs the loop in the vectors of `isa`.
pub(super) fn run<B: Body>(isa: Isa, body: B) -> B::Output {
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn avx2<B: Body>(body: B) -> B::Output {
        body.run()
    }
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
    fn avx512<B: Body>(body: B) -> B::Output {
        body.run()
    }
    match isa {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: an `Isa` other than scalar is only made where `Isa::is_supported` found what it needs.
        Isa::Avx2 => unsafe { avx2(body) },
        #[cfg(target_arch = "x86_64")]
        // SAFETY: as above.
        Isa::Avx512 => unsafe { avx512(body) },
        _ => body.run(),
    }
}
