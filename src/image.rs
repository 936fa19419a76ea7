//! Borrowed images: data, size, channels and row stride, checked once.

use crate::error::{Error, Result};

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
        // SAFETY: a primitive number.
        unsafe impl sealed::Plain for $number {}
        impl Sample for $number {}
    )*};
}
samples!(u8, u16, u32, u64, i8, i16, i32, i64, f32, f64);

/// The bytes of samples.
pub(crate) fn as_bytes<T: Sample>(samples: &[T]) -> &[u8] {
    // SAFETY: plain memory of so many bytes, which lives as long as the samples.
    unsafe { std::slice::from_raw_parts(samples.as_ptr().cast(), size_of_val(samples)) }
}

/// The bytes of samples, writable.
#[cfg(feature = "python")]
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
        let view = Self { data, width, height, channels, origin, row_stride };
        let fits = |row: usize| {
            let begin =
                isize::try_from(row).ok()?.checked_mul(row_stride)?.checked_add(isize::try_from(origin).ok()?)?;
            let end = usize::try_from(begin).ok()?.checked_add(width.checked_mul(channels)?)?;
            Some(end <= data.len())
        };
        // rows lie on a line, so the first and the last bound all others
        if fits(0) == Some(true) && fits(height - 1) == Some(true) {
            return Ok(view);
        }
        Err(Error::ImageBuffer { what: "image", width, height, channels, row_stride, length: data.len() })
    }

    /// Columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Samples per pixel.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// The samples between which all rows lie.
    pub(crate) fn data(&self) -> &'a [T] {
        self.data
    }

    /// Index of the first sample of row y.
    #[inline]
    pub(crate) fn row_start(&self, y: usize) -> usize {
        self.origin.wrapping_add_signed((y as isize).wrapping_mul(self.row_stride))
    }

    /// Whether pixel i of row y is sample `(y * width + i) * channels` of `data`.
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

/// A writable image: its rows, each a slice of its own, so that whatever lies between them is never touched.
#[derive(Debug)]
pub struct ImageViewMut<'a, T> {
    rows: Vec<&'a mut [T]>,
    width: usize,
    channels: usize,
}

impl<'a, T> ImageViewMut<'a, T> {
    /// A contiguous image.
    ///
    /// # Errors
    /// [`Error::EmptyImage`] and [`Error::ImageBuffer`].
    pub fn new(data: &'a mut [T], (width, height): (usize, usize), channels: usize) -> Result<Self> {
        check_not_empty("out", width, height, channels)?;
        let length = data.len();
        let row_length = width.saturating_mul(channels);
        if row_length.checked_mul(height) != Some(length) {
            let row_stride = isize::try_from(row_length).unwrap_or(isize::MAX);
            return Err(Error::ImageBuffer { what: "out", width, height, channels, row_stride, length });
        }
        Self::from_rows(data.chunks_exact_mut(row_length).collect(), width, channels)
    }

    /// An image of rows that lie anywhere, each of `width * channels` samples.
    ///
    /// # Errors
    /// [`Error::EmptyImage`], and [`Error::ImageBuffer`] where a row has another length.
    pub fn from_rows(rows: Vec<&'a mut [T]>, width: usize, channels: usize) -> Result<Self> {
        let height = rows.len();
        check_not_empty("out", width, height, channels)?;
        let row_length = width.saturating_mul(channels);
        match rows.iter().find(|row| row.len() != row_length) {
            None => Ok(Self { rows, width, channels }),
            Some(row) => Err(Error::ImageBuffer {
                what: "out",
                width,
                height,
                channels,
                row_stride: isize::try_from(row_length).unwrap_or(isize::MAX),
                length: row.len(),
            }),
        }
    }

    /// (rows, columns, channels).
    pub(crate) fn shape(&self) -> (usize, usize, usize) {
        (self.rows.len(), self.width, self.channels)
    }

    /// The rows in bands: (first row, its rows).
    pub(crate) fn bands(&mut self, rows_per_band: usize) -> impl Iterator<Item = (usize, &mut [&'a mut [T]])> {
        self.rows.chunks_mut(rows_per_band).enumerate().map(move |(band, rows)| (band * rows_per_band, rows))
    }
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
        let rows = data.chunks_mut(7).collect();
        assert!(matches!(ImageViewMut::from_rows(rows, 7, 1), Err(Error::ImageBuffer { length: 3, .. })));
    }

    #[test]
    fn bands_cover_every_row_once() {
        let mut data = [0u8; 5 * 7];
        let mut image = ImageViewMut::new(&mut data, (7, 5), 1).unwrap();
        for (first, rows) in image.bands(2) {
            for (row, samples) in (first..).zip(rows) {
                samples.fill(row as u8 + 1);
            }
        }
        for (index, &value) in data.iter().enumerate() {
            assert_eq!(usize::from(value), index / 7 + 1);
        }
    }
}
