//! The loops that building a table spends its time in: coordinates of a row, and their taps.
//!
//! They are written without branches and with float64 alone (no conversions to integers, no floor, which the baseline
//! build lacks), so that the compiler turns one body into vectors for each instruction set. Every operation is exact or
//! correctly rounded and nothing is fused, so all give the same table to the last bit. Taps alone have a form by hand.

mod aligned;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod bent;
mod heights;
mod projective;
mod quantise;
mod split;
mod unpack;
mod widen;

pub(crate) use aligned::Row;
pub(crate) use bent::{BentRow, Offsets};
pub(crate) use heights::HeightsRow;
pub(crate) use projective::ProjectiveRow;
pub(crate) use quantise::{Kinds, Sampled, quantise_one};
pub(crate) use split::{Fraction, split};
pub(crate) use unpack::unpack;
pub(crate) use widen::widen;

/// Compiles a function once for each instruction set, and calls the one that `isa` names: its body for scalar (and for
/// those that the compiler always has, as NEON), for AVX2 and for AVX-512.
macro_rules! for_each_isa {
    ($isa:expr, ($scalar:expr, $avx2:expr, $avx512:expr)($($name:ident: $type:ty),* $(,)?)) => {{
        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx2")]
        fn avx2($($name: $type),*) {
            $avx2($($name),*)
        }
        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
        fn avx512($($name: $type),*) {
            $avx512($($name),*)
        }
        match $isa {
            #[cfg(target_arch = "x86_64")]
            // SAFETY: an `Isa` other than scalar is only made where `Isa::is_supported` found what it needs.
            crate::cpu::Isa::Avx2 => unsafe { avx2($($name),*) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: as above.
            crate::cpu::Isa::Avx512 => unsafe { avx512($($name),*) },
            _ => $scalar($($name),*),
        }
    }};
}
pub(crate) use for_each_isa;
