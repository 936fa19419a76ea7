//! Borrowed images: data, size, channels and row stride, checked once.

use std::marker::PhantomData;

use crate::error::{Error, Result};
use crate::view::F16;

/// A number that an image may consist of.
pub trait Sample: Copy + Default + Send + Sync + sealed::Plain {}

pub(crate) mod sealed {
    /// Plain memory: kernels move samples as bytes.
    ///
    /// # Safety
    /// Implementors have no padding, and every bit pattern is a value.
    pub unsafe trait Plain {}
}

macro_rules! samples {
    ($($number:ty),*) => {$(
        // SAFETY: a primitive number, or one that is `repr(transparent)` over such.
        unsafe impl sealed::Plain for $number {}
        impl Sample for $number {}
    )*};
}
samples!(u8, u16, u32, u64, i8, i16, i32, i64, F16, f32, f64);

/// The bytes of samples.
pub(crate) fn as_bytes<T: Sample>(samples: &[T]) -> &[u8] {
    // SAFETY: plain memory of so many bytes, which lives as long as the samples.
    unsafe { std::slice::from_raw_parts(samples.as_ptr().cast(), size_of_val(samples)) }
}

/// The bytes of samples, writable.
pub(crate) fn as_bytes_mut<T: Sample>(samples: &mut [T]) -> &mut [u8] {
    // SAFETY: as in `as_bytes`; any bytes are samples.
    unsafe { std::slice::from_raw_parts_mut(samples.as_mut_ptr().cast(), size_of_val(samples)) }
}

/// A read-only image of interleaved samples: (height, width, channels) with any row stride, also zero or negative.
#[derive(Debug, Clone, Copy)]
pub struct ImageView<'a, T> {
    data: &'a [T],
    width: usize,
    height: usize,
    channels: usize,
    /// Index of the first sample of row 0.
    origin: usize,
    /// Samples from one row to the next.
    row_stride: isize,
}

impl<'a, T> ImageView<'a, T> {
    /// A contiguous image.
    ///
    /// # Errors
    /// [`Error::EmptyImage`] and [`Error::ImageBuffer`].
    pub fn new(data: &'a [T], (width, height): (usize, usize), channels: usize) -> Result<Self> {
        let row_stride = isize::try_from(width.saturating_mul(channels)).unwrap_or(isize::MAX);
        Self::with_row_stride(data, (width, height), channels, 0, row_stride)
    }

    /// An image whose row y begins at `data[origin + y * row_stride]`.
    ///
    /// # Errors
    /// [`Error::EmptyImage`] and [`Error::ImageBuffer`].
    pub fn with_row_stride(
        data: &'a [T],
        (width, height): (usize, usize),
        channels: usize,
        origin: usize,
        row_stride: isize,
    ) -> Result<Self> {
        check_not_empty("image", width, height, channels)?;
        if rows_fit(data.len(), width.saturating_mul(channels), height, origin, row_stride) {
            return Ok(Self { data, width, height, channels, origin, row_stride });
        }
        Err(Error::ImageBuffer { what: "image", width, height, channels, row_stride, length: data.len() })
    }

    /// Columns.
    #[inline(always)]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Samples per pixel.
    #[inline(always)]
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// The samples between which all rows lie.
    #[inline(always)]
    pub(crate) fn data(&self) -> &'a [T] {
        self.data
    }

    /// Index of the first sample of row y.
    #[inline]
    pub(crate) fn row_start(&self, y: usize) -> usize {
        self.origin.wrapping_add_signed((y as isize).wrapping_mul(self.row_stride))
    }

    /// Whether pixel i of row y is sample `(y * width + i) * channels` of `data`.
    #[inline(always)]
    pub(crate) fn is_contiguous(&self) -> bool {
        self.origin == 0 && self.row_stride == (self.width * self.channels) as isize
    }

    /// The samples of the pixel at column x, row y.
    ///
    /// # Panics
    /// Where the pixel is not inside the image.
    #[inline]
    pub fn pixel(&self, x: usize, y: usize) -> &'a [T] {
        assert!(x < self.width && y < self.height, "pixel ({x}, {y}) of a {} x {} image", self.width, self.height);
        let start = self.row_start(y) + x * self.channels;
        &self.data[start..start + self.channels]
    }
}

/// A writable image of interleaved samples: (height, width, channels) with any row stride under which rows do not
/// overlap. Whatever lies between the rows is never touched.
#[derive(Debug)]
pub struct ImageViewMut<'a, T> {
    rows: RowsMut<'a, T>,
    width: usize,
    channels: usize,
}

impl<'a, T> ImageViewMut<'a, T> {
    /// A contiguous image.
    ///
    /// # Errors
    /// [`Error::EmptyImage`] and [`Error::ImageBuffer`].
    pub fn new(data: &'a mut [T], (width, height): (usize, usize), channels: usize) -> Result<Self> {
        let row_length = width.saturating_mul(channels);
        let row_stride = isize::try_from(row_length).unwrap_or(isize::MAX);
        let length = data.len();
        match Self::with_row_stride(data, (width, height), channels, 0, row_stride) {
            Ok(_) if row_length * height != length => {
                Err(Error::ImageBuffer { what: "out", width, height, channels, row_stride, length })
            }
            checked => checked,
        }
    }

    /// An image whose row y begins at `data[origin + y * row_stride]`.
    ///
    /// # Errors
    /// [`Error::EmptyImage`], and [`Error::ImageBuffer`] where rows leave the buffer or overlap.
    pub fn with_row_stride(
        data: &'a mut [T],
        (width, height): (usize, usize),
        channels: usize,
        origin: usize,
        row_stride: isize,
    ) -> Result<Self> {
        check_not_empty("out", width, height, channels)?;
        let fits = rows_fit(data.len(), width.saturating_mul(channels), height, origin, row_stride);
        if !fits || (height > 1 && row_stride.unsigned_abs() < width * channels) {
            return Err(Error::ImageBuffer { what: "out", width, height, channels, row_stride, length: data.len() });
        }
        // SAFETY: `rows_fit` found every row inside `data`, borrowed for 'a, and the stride keeps them apart.
        Ok(unsafe { Self::from_raw(data.as_mut_ptr().wrapping_add(origin), (width, height), channels, row_stride) })
    }

    /// An image whose row y begins `y * row_stride` samples after `start`.
    ///
    /// # Safety
    /// For 'a every row is valid for reads and writes of `width * channels` aligned samples, by nobody else, and no two
    /// rows overlap. Nothing is asked of what lies between rows.
    pub(crate) unsafe fn from_raw(
        start: *mut T,
        (width, height): (usize, usize),
        channels: usize,
        row_stride: isize,
    ) -> Self {
        let rows = RowsMut { next: start, rows: height, row_length: width * channels, row_stride, data: PhantomData };
        Self { rows, width, channels }
    }

    /// (rows, columns, channels).
    pub(crate) fn shape(&self) -> (usize, usize, usize) {
        (self.rows.rows, self.width, self.channels)
    }

    /// All rows.
    pub(crate) fn rows(&mut self) -> RowsMut<'_, T> {
        RowsMut { data: PhantomData, ..self.rows }
    }

    /// The rows in bands: (first row, its rows).
    pub(crate) fn bands(&mut self, rows_per_band: usize) -> impl Iterator<Item = (usize, RowsMut<'_, T>)> {
        let mut rest = self.rows();
        (0..rest.rows.div_ceil(rows_per_band)).map(move |band| (band * rows_per_band, rest.split_off(rows_per_band)))
    }
}

/// Rows of a writable image, each a slice of its own.
#[derive(Debug)]
pub(crate) struct RowsMut<'a, T> {
    /// First sample of the next row.
    next: *mut T,
    /// How many rows there still are.
    rows: usize,
    row_length: usize,
    row_stride: isize,
    data: PhantomData<&'a mut [T]>,
}

// SAFETY: as the `&mut [T]` of its rows, which nobody else has.
unsafe impl<T: Send> Send for RowsMut<'_, T> {}
// SAFETY: a shared reference gives no access to the rows.
unsafe impl<T: Sync> Sync for RowsMut<'_, T> {}

impl<'a, T> RowsMut<'a, T> {
    /// Takes the next `rows` rows away, or as many as there are.
    fn split_off(&mut self, rows: usize) -> RowsMut<'a, T> {
        let rows = rows.min(self.rows);
        let front = RowsMut { rows, ..*self };
        self.next = self.next.wrapping_offset(self.row_stride.wrapping_mul(rows as isize));
        self.rows -= rows;
        front
    }

    /// How many rows there still are.
    pub(crate) fn remaining(&self) -> usize {
        self.rows
    }

    /// The samples of the next `rows` rows, or of as many as there are, if nothing lies between them.
    pub(crate) fn flat(&mut self, rows: usize) -> Option<&mut [T]> {
        let samples = rows.min(self.rows) * self.row_length;
        if self.row_stride != self.row_length as isize {
            return None;
        }
        // SAFETY: without gaps the rows that `ImageViewMut::from_raw` was promised are one piece of memory; none of
        // them has been handed out, and none can be while the slice borrows all of them.
        Some(unsafe { std::slice::from_raw_parts_mut(self.next, samples) })
    }
}

impl<'a, T> Iterator for RowsMut<'a, T> {
    type Item = &'a mut [T];

    #[inline]
    fn next(&mut self) -> Option<&'a mut [T]> {
        if self.rows == 0 {
            return None;
        }
        let row = self.split_off(1).next;
        // SAFETY: a row of the image as `ImageViewMut::from_raw` was promised it; taken away, it is handed out once.
        Some(unsafe { std::slice::from_raw_parts_mut(row, self.row_length) })
    }
}

/// Whether rows at `origin + y * row_stride` lie within a buffer.
fn rows_fit(length: usize, row_length: usize, height: usize, origin: usize, row_stride: isize) -> bool {
    let fits = |row: usize| {
        let begin = isize::try_from(row).ok()?.checked_mul(row_stride)?.checked_add(isize::try_from(origin).ok()?)?;
        Some(usize::try_from(begin).ok()?.checked_add(row_length)? <= length)
    };
    // rows lie on a line, so the first and the last bound all others
    fits(0) == Some(true) && fits(height - 1) == Some(true)
}

fn check_not_empty(what: &'static str, width: usize, height: usize, channels: usize) -> Result<()> {
    if width == 0 || height == 0 || channels == 0 {
        return Err(Error::EmptyImage { what, width, height, channels });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_may_run_backwards_repeat_or_skip() {
        let data: Vec<u8> = (0..24).collect();
        let flipped = ImageView::with_row_stride(&data, (3, 4), 2, 18, -6).unwrap();
        assert_eq!((flipped.pixel(0, 0), flipped.pixel(2, 3)), (&data[18..20], &data[4..6]));
        let repeated = ImageView::with_row_stride(&data, (3, 100), 2, 6, 0).unwrap();
        assert_eq!(repeated.pixel(1, 99), &data[8..10]);
        let skipped = ImageView::with_row_stride(&data, (3, 2), 2, 0, 12).unwrap();
        assert_eq!(skipped.pixel(0, 1), &data[12..14]);
    }

    #[test]
    fn refuses_rows_outside_the_buffer() {
        let data = [0u8; 24];
        for (size, channels, origin, stride) in [
            ((3, 5), 2, 0, 6),
            ((3, 4), 2, 1, 6),
            ((3, 4), 2, 0, -6),
            ((usize::MAX, 2), 2, 0, 6),
            ((3, 4), 2, 0, isize::MAX),
        ] {
            let got = ImageView::with_row_stride(&data, size, channels, origin, stride);
            assert!(matches!(got, Err(Error::ImageBuffer { .. })), "{size:?} {origin} {stride}");
        }
        assert!(matches!(ImageView::new(&data, (0, 4), 1), Err(Error::EmptyImage { .. })));
        let mut data = [0u8; 24];
        assert!(ImageViewMut::new(&mut data, (3, 4), 2).is_ok());
        assert!(matches!(ImageViewMut::new(&mut data, (3, 5), 2), Err(Error::ImageBuffer { .. })));
        assert!(matches!(ImageViewMut::new(&mut data, (0, 5), 2), Err(Error::EmptyImage { .. })));
        assert!(matches!(ImageViewMut::new(&mut data, (3, 3), 2), Err(Error::ImageBuffer { .. })));
        for (origin, stride) in [(0, 7), (1, 6), (0, 5), (0, 0), (0, -6), (17, -6), (0, isize::MAX), (0, isize::MIN)] {
            let got = ImageViewMut::with_row_stride(&mut data, (3, 4), 2, origin, stride);
            assert!(matches!(got, Err(Error::ImageBuffer { .. })), "{origin} {stride}");
        }
    }

    #[test]
    fn bands_cover_every_row_once_and_nothing_between() {
        for (origin, stride) in [(0, 7), (0, 9), (38, -9), (36, -9)] {
            let mut data = [0u8; 5 * 9];
            let mut image = ImageViewMut::with_row_stride(&mut data, (7, 5), 1, origin, stride).unwrap();
            for (first, rows) in image.bands(2) {
                for (row, samples) in (first..).zip(rows) {
                    samples.fill(row as u8 + 1);
                }
            }
            for row in 0..5 {
                let start = origin.wrapping_add_signed(row * stride);
                assert_eq!(data[start..start + 7], [row as u8 + 1; 7]);
                data[start..start + 7].fill(0);
            }
            assert_eq!(data, [0; 5 * 9]);
        }
    }
}
