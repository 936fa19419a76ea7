//! Which samples an image's dtype means to the core, for each way to interpolate. The types of samples are in
//! `view/number.rs`.

use numpy::{PyArrayDescr, PyArrayDescrMethods};
use pyo3::prelude::*;

use super::error::classes::DtypeError;
use crate::Interpolation;

/// What `interpolation=` names: a way to take values from pixels, or the most frequent id.
#[derive(Debug, Clone, Copy)]
pub(super) enum Taken {
    By(Interpolation),
    Mode,
}

/// Samples that are blended, each in its own arithmetic.
#[derive(Debug, Clone, Copy)]
pub(super) enum Blended {
    U8,
    I8,
    U16,
    I16,
    F16,
    F32,
    F64,
}

/// Samples as a warp takes them.
#[derive(Debug, Clone, Copy)]
pub(super) enum Samples {
    /// All that sum pixels.
    Blended(Blended),
    /// Nearest moves bytes, so many to a sample.
    Moved(usize),
    /// Ids of so many bytes, with a sign or without.
    Ids { bytes: usize, signed: bool },
}

impl Taken {
    pub(super) const ALL: [Self; 6] = {
        let [nearest, bilinear, cubic, lanczos4, area] = Interpolation::ALL;
        [Self::By(nearest), Self::By(bilinear), Self::By(cubic), Self::By(lanczos4), Self::By(area), Self::Mode]
    };

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::By(interpolation) => interpolation.name(),
            Self::Mode => "mode",
        }
    }
}

impl Samples {
    /// What a dtype is to an interpolation.
    ///
    /// # Errors
    /// `DtypeError` where it does not take the dtype.
    pub(super) fn of(dtype: &Bound<'_, PyArrayDescr>, taken: Taken) -> PyResult<Self> {
        let (kind, bytes) = (dtype.kind(), dtype.itemsize());
        match taken {
            Taken::By(Interpolation::Nearest) => match (kind, bytes) {
                (b'b' | b'i' | b'u' | b'f', 1 | 2 | 4 | 8) => Ok(Self::Moved(bytes)),
                _ => Err(DtypeError::new_err(format!(
                    "image: expected a bool, integer or float dtype of 1, 2, 4 or 8 bytes, got {dtype}"
                ))),
            },
            Taken::By(interpolation) => {
                blended(kind, bytes).map(Self::Blended).ok_or_else(|| not_blended(dtype, interpolation))
            }
            Taken::Mode => match (kind, bytes) {
                (b'b' | b'i' | b'u', 1 | 2 | 4 | 8) => Ok(Self::Ids { bytes, signed: kind == b'i' }),
                _ => Err(DtypeError::new_err(format!(
                    "image: expected integer or bool ids for interpolation=\"mode\", got {dtype}; use interpolation=\"area\" for pictures"
                ))),
            },
        }
    }
}

fn blended(kind: u8, bytes: usize) -> Option<Blended> {
    Some(match (kind, bytes) {
        (b'u', 1) => Blended::U8,
        (b'i', 1) => Blended::I8,
        (b'u', 2) => Blended::U16,
        (b'i', 2) => Blended::I16,
        (b'f', 2) => Blended::F16,
        (b'f', 4) => Blended::F32,
        (b'f', 8) => Blended::F64,
        _ => return None,
    })
}

/// Why what sums pixels does not take a dtype, and what does.
fn not_blended(dtype: &Bound<'_, PyArrayDescr>, interpolation: Interpolation) -> PyErr {
    let for_ids = if interpolation == Interpolation::Area { "mode" } else { "nearest" };
    let mend = match dtype.kind() {
        b'b' | b'i' | b'u' => format!(
            "bool and integers of 32 and 64 bits are ids as a rule, and ids are not blended: use interpolation=\"{for_ids}\" for labels, or image.astype(numpy.float64) for quantities"
        ),
        b'c' => "warp image.real and image.imag".to_owned(),
        // the bfloat16 of ml_dtypes is among those that NumPy does not know
        b'V' => "use image.astype(numpy.float32)".to_owned(),
        _ => "use image.astype(numpy.float64)".to_owned(),
    };
    DtypeError::new_err(format!(
        "image: expected uint8, int8, uint16, int16, float16, float32 or float64 for interpolation=\"{}\", got {dtype}; {mend}",
        interpolation.name()
    ))
}

/// Calls a generic function for the sample type of a [`Blended`]: `for_blended!(kind, job.blended())`.
macro_rules! for_blended {
    ($kind:expr, $object:ident.$call:ident($($argument:expr),*)) => {
        match $kind {
            $crate::python::dtype::Blended::U8 => $object.$call::<u8>($($argument),*),
            $crate::python::dtype::Blended::I8 => $object.$call::<i8>($($argument),*),
            $crate::python::dtype::Blended::U16 => $object.$call::<u16>($($argument),*),
            $crate::python::dtype::Blended::I16 => $object.$call::<i16>($($argument),*),
            $crate::python::dtype::Blended::F16 => $object.$call::<$crate::F16>($($argument),*),
            $crate::python::dtype::Blended::F32 => $object.$call::<f32>($($argument),*),
            $crate::python::dtype::Blended::F64 => $object.$call::<f64>($($argument),*),
        }
    };
}
pub(super) use for_blended;

/// The same for samples that nearest moves: an unsigned integer of so many bytes.
macro_rules! for_moved {
    ($bytes:expr, $object:ident.$call:ident($($argument:expr),*)) => {
        match $bytes {
            1 => $object.$call::<u8>($($argument),*),
            2 => $object.$call::<u16>($($argument),*),
            4 => $object.$call::<u32>($($argument),*),
            _ => $object.$call::<u64>($($argument),*),
        }
    };
}
pub(super) use for_moved;
