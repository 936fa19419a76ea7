//! The instruction sets that this build has kernels for.

use std::sync::OnceLock;

/// An instruction set that is unknown or that this CPU or build lacks.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("instruction set: expected one of {available}, got {got:?}; unset IPM_RS_ISA to use the best")]
pub struct IsaError {
    /// What this CPU and build offer.
    pub available: String,
    /// The value that came.
    pub got: String,
}

/// An instruction set with kernels of its own. All give the same answers to the last bit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Isa {
    /// Plain Rust: the definition of every kernel.
    Scalar,
    /// AVX2: Haswell, Zen and later.
    Avx2,
    /// AVX-512 F, BW, VL, VBMI and VNNI: Ice Lake, Zen 4 and later.
    Avx512,
    /// NEON: every aarch64.
    Neon,
}

impl Isa {
    /// Its name in `IPM_RS_ISA`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Scalar => "scalar",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
            Self::Neon => "neon",
        }
    }

    /// Those that this build has and this CPU can run, best last.
    pub fn available() -> &'static [Self] {
        static AVAILABLE: OnceLock<Vec<Isa>> = OnceLock::new();
        let all = [Self::Scalar, Self::Avx2, Self::Avx512, Self::Neon];
        AVAILABLE.get_or_init(|| all.into_iter().filter(|isa| isa.is_supported()).collect())
    }

    /// Whether this CPU can run it.
    fn is_supported(self) -> bool {
        match self {
            Self::Scalar => true,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => is_x86_feature_detected!("avx2"),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => {
                is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512bw")
                    && is_x86_feature_detected!("avx512vl")
                    && is_x86_feature_detected!("avx512vbmi")
                    && is_x86_feature_detected!("avx512vnni")
            }
            #[cfg(not(target_arch = "x86_64"))]
            Self::Avx2 | Self::Avx512 => false,
            #[cfg(target_arch = "aarch64")]
            Self::Neon => cfg!(target_endian = "little") && std::arch::is_aarch64_feature_detected!("neon"),
            #[cfg(not(target_arch = "aarch64"))]
            Self::Neon => false,
        }
    }

    /// The one in use: that of the environment variable `IPM_RS_ISA`, else the best available. Read once.
    ///
    /// # Errors
    /// [`IsaError`] where the variable names none that is available.
    pub fn active() -> Result<Self, IsaError> {
        static ACTIVE: OnceLock<Result<Isa, IsaError>> = OnceLock::new();
        let choose = || match std::env::var_os("IPM_RS_ISA") {
            Some(name) if !name.is_empty() => Self::parse(&name.to_string_lossy()),
            _ => Ok(Self::available()[Self::available().len() - 1]),
        };
        ACTIVE.get_or_init(choose).clone()
    }

    /// This instruction set, if the CPU can run it.
    ///
    /// # Errors
    /// [`IsaError`].
    pub fn checked(self) -> Result<Self, IsaError> {
        Self::parse(self.name())
    }

    /// This instruction set if the CPU can run it, else scalar: for what callers may name where nothing can fail.
    pub(crate) fn or_scalar(self) -> Self {
        if Self::available().contains(&self) { self } else { Self::Scalar }
    }

    fn parse(name: &str) -> Result<Self, IsaError> {
        let found = Self::available().iter().find(|isa| isa.name() == name.trim().to_ascii_lowercase());
        found.copied().ok_or_else(|| IsaError {
            available: Self::available().iter().map(|isa| isa.name()).collect::<Vec<_>>().join(", "),
            got: name.to_owned(),
        })
    }
}

/// The CPU's instruction sets that matter to a warp, whether or not this build has kernels for them.
pub fn cpu_features() -> Vec<&'static str> {
    #[cfg(target_arch = "x86_64")]
    let found = [
        ("sse4.1", is_x86_feature_detected!("sse4.1")),
        ("avx2", is_x86_feature_detected!("avx2")),
        ("fma", is_x86_feature_detected!("fma")),
        ("avx512f", is_x86_feature_detected!("avx512f")),
        ("avx512bw", is_x86_feature_detected!("avx512bw")),
        ("avx512vl", is_x86_feature_detected!("avx512vl")),
        ("avx512vbmi", is_x86_feature_detected!("avx512vbmi")),
        ("avx512vnni", is_x86_feature_detected!("avx512vnni")),
    ];
    #[cfg(target_arch = "aarch64")]
    let found = [("neon", std::arch::is_aarch64_feature_detected!("neon"))];
    #[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
    let found: [(&str, bool); 0] = [];
    found.into_iter().filter_map(|(name, present)| present.then_some(name)).collect()
}

/// What an instruction set has in a place: every one must be named, and those that this build's architecture lacks have
/// what scalar has.
macro_rules! by_isa {
    ($isa:expr, Scalar => $scalar:expr, Avx2 => $avx2:expr, Avx512 => $avx512:expr, Neon => $neon:expr $(,)?) => {
        match $isa {
            $crate::isa::Isa::Scalar => $scalar,
            #[cfg(target_arch = "x86_64")]
            $crate::isa::Isa::Avx2 => $avx2,
            #[cfg(target_arch = "x86_64")]
            $crate::isa::Isa::Avx512 => $avx512,
            #[cfg(not(target_arch = "x86_64"))]
            $crate::isa::Isa::Avx2 | $crate::isa::Isa::Avx512 => $scalar,
            #[cfg(target_arch = "aarch64")]
            $crate::isa::Isa::Neon => $neon,
            #[cfg(not(target_arch = "aarch64"))]
            $crate::isa::Isa::Neon => $scalar,
        }
    };
}
pub(crate) use by_isa;

/// A loop of plain Rust, compiled once for each instruction set (decision 0005).
///
/// `run` must be `#[inline(always)]`, or it is compiled for the baseline alone.
pub(crate) trait Body {
    /// What it returns.
    type Output;

    /// The loop.
    fn run(self) -> Self::Output;
}

/// Runs the loop in the vectors of `isa`.
pub(crate) fn run<B: Body>(isa: Isa, body: B) -> B::Output {
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
    by_isa!(
        isa,
        Scalar => body.run(),
        // SAFETY: an `Isa` other than scalar comes here only from `active`, `checked`, `available` or `or_scalar`,
        // which found that the CPU has what it needs.
        Avx2 => unsafe { avx2(body) },
        // SAFETY: as above.
        Avx512 => unsafe { avx512(body) },
        // the compiler always has it
        Neon => body.run(),
    )
}

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
        $crate::isa::by_isa!(
            $isa,
            Scalar => $scalar($($name),*),
            // SAFETY: an `Isa` other than scalar comes here only from `active`, `checked`, `available` or `or_scalar`,
            // which found that the CPU has what it needs.
            Avx2 => unsafe { avx2($($name),*) },
            // SAFETY: as above.
            Avx512 => unsafe { avx512($($name),*) },
            Neon => $scalar($($name),*),
        )
    }};
}
pub(crate) use for_each_isa;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_cpu_lacks_is_the_plain_one() {
        for isa in [Isa::Scalar, Isa::Avx2, Isa::Avx512, Isa::Neon] {
            let expected = if isa.checked().is_ok() { isa } else { Isa::Scalar };
            assert_eq!(isa.or_scalar(), expected);
        }
        // no CPU has both
        assert!([Isa::Avx2, Isa::Neon].iter().any(|isa| isa.or_scalar() == Isa::Scalar));
    }

    #[test]
    fn every_available_name_is_understood_and_no_other() {
        for &isa in Isa::available() {
            assert_eq!(Isa::parse(isa.name()), Ok(isa));
        }
        assert!(matches!(Isa::parse("mmx"), Err(IsaError { .. })));
        assert!(matches!(Isa::parse(""), Err(IsaError { .. })));
    }
}
