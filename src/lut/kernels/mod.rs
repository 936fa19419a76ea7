//! The two loops that building a table spends its time in: coordinates of a row, and their taps.
//!
//! They are written without branches and with float64 alone (no conversions to integers, no floor, which the baseline
//! build lacks), so that the compiler turns one body into vectors for each instruction set. Every operation is exact or
//! correctly rounded and nothing is fused, so all give the same table to the last bit.

mod projective;
mod quantise;

pub(crate) use projective::ProjectiveRow;
pub(crate) use quantise::{Kinds, quantise, quantise_one};

/// Compiles the body of a function once for each instruction set, and calls the one that `isa` names.
macro_rules! for_each_isa {
    ($isa:expr, $body:ident($($name:ident: $type:ty),* $(,)?)) => {{
        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx2")]
        fn avx2($($name: $type),*) {
            $body($($name),*)
        }
        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
        fn avx512($($name: $type),*) {
            $body($($name),*)
        }
        match $isa {
            #[cfg(target_arch = "x86_64")]
            // SAFETY: an `Isa` other than scalar is only made where `Isa::is_supported` found what it needs.
            crate::cpu::Isa::Avx2 => unsafe { avx2($($name),*) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: as above.
            crate::cpu::Isa::Avx512 => unsafe { avx512($($name),*) },
            _ => $body($($name),*),
        }
    }};
}
use for_each_isa;
