//! Borrowed images: data, size, channels and row stride, checked once.

use std::marker::PhantomData;

use super::strided::{Strided, lies_within};
use crate::error::{Error, Result, ViewError};

/// A read-only image of interleaved samples: (height, width, channels) with any row stride, also zero or negative.
#[derive(Debug, Clone, Copy)]
pub struct ImageView<'a, T> {
    /// A row of samples for each row of pixels.
    samples: Strided<'a, T>,
    width: usize,
    channels: usize,
}

impl<'a, T> ImageView<'a, T> {
    /// A contiguous image.
    ///
    /// # Errors
    /// [`ViewError::EmptyImage`] and [`ViewError::ImageBuffer`].
    pub fn new(data: &'a [T], (width, height): (usize, usize), channels: usize) -> Result<Self> {
        let row_stride = isize::try_from(width.saturating_mul(channels)).unwrap_or(isize::MAX);
        Self::with_row_stride(data, (width, height), channels, 0, row_stride)
    }

    /// An image whose row y begins at `data[origin + y * row_stride]`.
    ///
    /// # Errors
    /// [`ViewError::EmptyImage`] and [`ViewError::ImageBuffer`].
    pub fn with_row_stride(
        data: &'a [T],
        (width, height): (usize, usize),
        channels: usize,
        origin: usize,
        row_stride: isize,
    ) -> Result<Self> {
        check_not_empty("image", width, height, channels)?;
        let shape = (height, width.saturating_mul(channels));
        let samples = Strided::with_strides(data, shape, origin, (row_stride, 1)).map_err(|_| {
            Error::View(ViewError::ImageBuffer {
                what: "image",
                width,
                height,
                channels,
                row_stride,
                length: data.len(),
            })
        })?;
        Ok(Self { samples, width, channels })
    }

    /// Columns.
    #[inline(always)]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.samples.rows()
    }

    /// Samples per pixel.
    #[inline(always)]
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// The samples between which all rows lie.
    #[inline(always)]
    pub(crate) fn data(&self) -> &'a [T] {
        self.samples.data()
    }

    /// Index of the first sample of row y.
    #[inline]
    pub(crate) fn row_start(&self, y: usize) -> usize {
        self.samples.row_start(y)
    }

    /// Whether pixel i of row y is sample `(y * width + i) * channels` of `data`.
    #[inline(always)]
    pub(crate) fn is_contiguous(&self) -> bool {
        self.row_start(0) == 0 && self.samples.row_stride() == (self.width * self.channels) as isize
    }

    /// The samples of the pixel at column x, row y.
    ///
    /// # Panics
    /// Where the pixel is not inside the image.
    #[inline]
    pub fn pixel(&self, x: usize, y: usize) -> &'a [T] {
        let (width, height) = (self.width, self.height());
        assert!(x < width && y < height, "pixel ({x}, {y}) of a {width} x {height} image");
        let start = self.row_start(y) + x * self.channels;
        &self.data()[start..start + self.channels]
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
    /// [`ViewError::EmptyImage`] and [`ViewError::ImageBuffer`].
    pub fn new(data: &'a mut [T], (width, height): (usize, usize), channels: usize) -> Result<Self> {
        let row_length = width.saturating_mul(channels);
        let row_stride = isize::try_from(row_length).unwrap_or(isize::MAX);
        let length = data.len();
        match Self::with_row_stride(data, (width, height), channels, 0, row_stride) {
            Ok(_) if row_length * height != length => {
                Err(Error::View(ViewError::ImageBuffer { what: "out", width, height, channels, row_stride, length }))
            }
            checked => checked,
        }
    }

    /// An image whose row y begins at `data[origin + y * row_stride]`.
    ///
    /// # Errors
    /// [`ViewError::EmptyImage`], and [`ViewError::ImageBuffer`] where rows leave the buffer or overlap.
    pub fn with_row_stride(
        data: &'a mut [T],
        (width, height): (usize, usize),
        channels: usize,
        origin: usize,
        row_stride: isize,
    ) -> Result<Self> {
        check_not_empty("out", width, height, channels)?;
        let shape = (height, width.saturating_mul(channels));
        let fits = lies_within(data.len(), shape, origin, (row_stride, 1));
        if !fits || (height > 1 && row_stride.unsigned_abs() < width * channels) {
            return Err(Error::View(ViewError::ImageBuffer {
                what: "out",
                width,
                height,
                channels,
                row_stride,
                length: data.len(),
            }));
        }
        // SAFETY: `lies_within` found every row inside `data`, borrowed for 'a, and the stride keeps them apart.
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

fn check_not_empty(what: &'static str, width: usize, height: usize, channels: usize) -> Result<()> {
    if width == 0 || height == 0 || channels == 0 {
        return Err(Error::View(ViewError::EmptyImage { what, width, height, channels }));
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
            assert!(matches!(got, Err(Error::View(ViewError::ImageBuffer { .. }))), "{size:?} {origin} {stride}");
        }
        assert!(matches!(ImageView::new(&data, (0, 4), 1), Err(Error::View(ViewError::EmptyImage { .. }))));
        let mut data = [0u8; 24];
        assert!(ImageViewMut::new(&mut data, (3, 4), 2).is_ok());
        assert!(matches!(ImageViewMut::new(&mut data, (3, 5), 2), Err(Error::View(ViewError::ImageBuffer { .. }))));
        assert!(matches!(ImageViewMut::new(&mut data, (0, 5), 2), Err(Error::View(ViewError::EmptyImage { .. }))));
        assert!(matches!(ImageViewMut::new(&mut data, (3, 3), 2), Err(Error::View(ViewError::ImageBuffer { .. }))));
        for (origin, stride) in [(0, 7), (1, 6), (0, 5), (0, 0), (0, -6), (17, -6), (0, isize::MAX), (0, isize::MIN)] {
            let got = ImageViewMut::with_row_stride(&mut data, (3, 4), 2, origin, stride);
            assert!(matches!(got, Err(Error::View(ViewError::ImageBuffer { .. }))), "{origin} {stride}");
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
