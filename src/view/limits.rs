//! How large images and outputs may be.

use crate::error::{Error, Result, ViewError};

/// Most cells that one grid, and so one table, may have: 2^28, a table of at most 3 GiB.
pub const MAX_CELLS: usize = 1 << 28;

/// Whether these are more than [`MAX_CELLS`]; floats, because what is asked for may fit no integer.
pub(crate) fn are_too_many(rows: f64, columns: f64) -> bool {
    rows * columns > MAX_CELLS as f64 || (rows * columns).is_nan()
}

/// Refuses an image with no pixels, and one whose pixels with a frame of one pixel around do not fit 32 bits: tables
/// address them so.
pub(crate) fn check_image_size(what: &'static str, width: u64, height: u64) -> Result<(u32, u32)> {
    let framed = (width.saturating_add(2)).saturating_mul(height.saturating_add(2));
    match (u32::try_from(width), u32::try_from(height)) {
        (Ok(w @ 1..), Ok(h @ 1..)) if framed <= u64::from(u32::MAX) => Ok((w, h)),
        _ => Err(Error::View(ViewError::ImageSize { what, width, height })),
    }
}
