//! An image as plain bytes, for kernels that load more than the four pixels of a tap at once.

use super::Source;
use crate::view::{Sample, as_bytes};

/// The bytes of an image and how to find a tap's pixels among them. Positions are byte indices below 2^31, so that they
/// fit the 32-bit lanes of every instruction set.
#[derive(Clone, Copy)]
pub(super) struct Plane<'a> {
    data: &'a [u8],
    /// Bytes of a pixel.
    pub(super) pixel: u32,
    /// Bytes from a row to the next one, negative where rows run backwards.
    pub(super) row_stride: isize,
    /// Where pixel i of row y is not byte `(y * width + i) * pixel`.
    pub(super) strided: Option<Strided>,
}

/// What finding a pixel takes where rows are not back to back: with `y = offset / width`,
/// the byte is `origin + offset * pixel + y * row_extra`.
#[derive(Clone, Copy)]
pub(super) struct Strided {
    /// 1 / width. `(offset + 0.5) * inverse_width` truncates to y for every 32-bit offset: it is at least 0.5 / width
    /// away from a whole number, and float64 is off by less than 2^-19 / width.
    pub(super) inverse_width: f64,
    pub(super) row_extra: i32,
    pub(super) origin: i32,
}

impl<'a> Plane<'a> {
    /// `None` where the image spans 2^31 bytes or more.
    pub(super) fn new<T: Sample>(source: &Source<'a, T>) -> Option<Self> {
        let image = source.image;
        let data = as_bytes(image.data());
        let pixel = image.channels() * size_of::<T>();
        let origin = image.row_start(0) * size_of::<T>();
        let row_stride = if image.height() > 1 {
            (image.row_start(1) as isize - image.row_start(0) as isize) * size_of::<T>() as isize
        } else {
            (image.width() * pixel) as isize
        };
        if data.len() > i32::MAX as usize {
            return None;
        }
        let strided = (!image.is_contiguous()).then(|| Strided {
            inverse_width: 1.0 / image.width() as f64,
            row_extra: (row_stride - (image.width() * pixel) as isize) as i32,
            origin: origin as i32,
        });
        Some(Self { data, pixel: pixel as u32, row_stride, strided })
    }

    /// Position 0.
    #[inline(always)]
    pub(super) fn start(&self) -> *const u8 {
        self.data.as_ptr()
    }

    /// How many bytes there are.
    #[cfg(target_arch = "x86_64")]
    pub(super) fn bytes(&self) -> usize {
        self.data.len()
    }

    /// The last position from which `bytes` may be loaded there and one row below; -1 where there is none.
    pub(super) fn limit(&self, bytes: usize) -> i32 {
        let last = self.data.len() as isize - bytes as isize - self.row_stride.max(0);
        last.max(-1) as i32
    }
}
