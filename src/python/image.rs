//! Images as NumPy arrays: their layout checked by hand, their memory borrowed without a copy.

use std::ops::Range;

use numpy::{
    PyArrayDescr, PyArrayDescrMethods, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyReadwriteArrayDyn,
    PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::prelude::*;

use super::convert::{tuple_text, type_name};
use super::error::classes::{ArgumentTypeError, DtypeError, ImageError};
use crate::{ImageView, ImageViewMut, Interpolation, Sample};

/// An array that is an image: (H, W) or (H, W, C), aligned, native, its samples adjacent within a row.
pub(super) struct ImageArray<'py> {
    array: Bound<'py, PyUntypedArray>,
    dtype: Bound<'py, PyArrayDescr>,
    width: usize,
    height: usize,
    channels: usize,
    /// Bytes from one row to the next.
    row_stride: isize,
}

impl<'py> ImageArray<'py> {
    /// Checks everything but the dtype's kind; `name` is the argument's.
    pub(super) fn new(name: &str, object: &Bound<'py, PyAny>) -> PyResult<Self> {
        let Ok(array) = object.cast::<PyUntypedArray>() else {
            let message =
                format!("{name}: expected a NumPy array, got {}; use numpy.asarray({name})", type_name(object));
            return Err(ArgumentTypeError::new_err(message));
        };
        let dtype = array.dtype();
        if dtype.is_native_byteorder() == Some(false) {
            let mend = match name {
                "out" => "use numpy.empty(shape, image.dtype)".to_owned(),
                _ => format!("use {name}.astype({name}.dtype.newbyteorder(\"=\"))"),
            };
            let message = format!("{name}: expected this machine's byte order, got {dtype}; {mend}");
            return Err(DtypeError::new_err(message));
        }
        let shape = array.shape();
        let (height, width, channels) = match *shape {
            [height, width] => (height, width, 1),
            [height, width, channels] => (height, width, channels),
            _ => {
                let got = tuple_text(shape);
                return Err(ImageError::new_err(format!("{name}: expected shape (H, W) or (H, W, C), got {got}")));
            }
        };
        if shape.contains(&0) {
            let got = tuple_text(shape);
            return Err(ImageError::new_err(format!("{name}: expected at least one pixel, got shape {got}")));
        }
        let sample = dtype.itemsize() as isize;
        if sample == 0 {
            let message = format!("{name}: expected a bool, integer or float dtype, got {dtype} of no bytes");
            return Err(DtypeError::new_err(message));
        }
        let strides = array.strides();
        // an axis of length 1 is never stepped along, so NumPy lets its stride be anything
        let steps = |axis: usize, expected: isize| shape[axis] == 1 || strides[axis] == expected;
        let adjacent = steps(1, sample * channels as isize) && (shape.len() == 2 || steps(2, sample));
        let row_stride = if height == 1 { sample * (width * channels) as isize } else { strides[0] };
        if !adjacent || !array.is_aligned() || row_stride % sample != 0 {
            let message = format!(
                "{name}: expected samples adjacent and aligned within each row (any row stride), got shape {} with strides {:?}; use numpy.ascontiguousarray({name})",
                tuple_text(shape),
                strides
            );
            return Err(ImageError::new_err(message));
        }
        Ok(Self { array: array.clone(), dtype, width, height, channels, row_stride })
    }

    /// A new array for the result of warping this image: (rows, columns) or (rows, columns, C), not initialised.
    pub(super) fn new_output(&self, rows: usize, columns: usize) -> PyResult<Self> {
        let numpy = self.array.py().import("numpy")?;
        let array = match self.array.ndim() {
            2 => numpy.call_method1("empty", ((rows, columns), &self.dtype)),
            _ => numpy.call_method1("empty", ((rows, columns, self.channels), &self.dtype)),
        }?;
        Self::new("out", &array)
    }

    /// Checks that `object` can take the result of warping this image.
    pub(super) fn check_output(&self, object: &Bound<'py, PyAny>, rows: usize, columns: usize) -> PyResult<Self> {
        let expected = [rows, columns, self.channels];
        let expected = &expected[..self.array.ndim()];
        if let Ok(array) = object.cast::<PyUntypedArray>()
            && array.shape() != expected
        {
            let (expected, got) = (tuple_text(expected), tuple_text(array.shape()));
            return Err(ImageError::new_err(format!("out: expected shape {expected}, got {got}")));
        }
        let out = Self::new("out", object)?;
        if !out.dtype.is_equiv_to(&self.dtype) {
            let message = format!("out: expected dtype {}, that of the image, got {}", self.dtype, out.dtype);
            return Err(DtypeError::new_err(message));
        }
        if (out.row_stride.unsigned_abs()) < out.row_bytes() && out.height > 1 {
            return Err(ImageError::new_err(format!(
                "out: expected rows that do not overlap, got strides {:?}; use numpy.empty({}, image.dtype)",
                out.array.strides(),
                tuple_text(expected)
            )));
        }
        let (read, written) = (self.span(), out.span());
        if read.start < written.end && written.start < read.end {
            return Err(ImageError::new_err(
                "out: expected memory of its own, got memory that image spans too; pass out=None or another array",
            ));
        }
        Ok(out)
    }

    /// Bytes of a sample, if this interpolation takes the dtype: unsigned integers of 1 or 2 bytes and floats of 4 for
    /// bilinear, bool, integers and floats of 1, 2, 4 or 8 for nearest.
    pub(super) fn sample_bytes(&self, interpolation: Interpolation) -> PyResult<usize> {
        let dtype = &self.dtype;
        match (interpolation, dtype.kind(), dtype.itemsize()) {
            (Interpolation::Bilinear, b'u', bytes @ (1 | 2)) | (Interpolation::Bilinear, b'f', bytes @ 4) => Ok(bytes),
            (Interpolation::Nearest, b'b' | b'i' | b'u' | b'f', bytes @ (1 | 2 | 4 | 8)) => Ok(bytes),
            (Interpolation::Bilinear, ..) => Err(DtypeError::new_err(format!(
                "image: expected uint8, uint16 or float32, got {dtype}; use interpolation=\"nearest\" for labels, or image.astype(numpy.float32)"
            ))),
            (Interpolation::Nearest, ..) => Err(DtypeError::new_err(format!(
                "image: expected a bool, integer or float dtype of 1, 2, 4 or 8 bytes, got {dtype}"
            ))),
        }
    }

    pub(super) fn dtype(&self) -> &Bound<'py, PyArrayDescr> {
        &self.dtype
    }

    pub(super) fn into_array(self) -> Bound<'py, PyUntypedArray> {
        self.array
    }

    fn row_bytes(&self) -> usize {
        self.width * self.channels * self.dtype.itemsize()
    }

    /// Address of row 0's first byte.
    fn address(&self) -> *mut u8 {
        self.bytes().data()
    }

    /// The array under another element type: only for its data pointer and borrow flags, which do not look at it.
    fn bytes(&self) -> &Bound<'py, PyArrayDyn<u8>> {
        // SAFETY: `PyArrayDyn<T>` is a transparent NumPy array whatever T is, and no element is read as T.
        unsafe { self.array.cast_unchecked() }
    }

    /// The addresses between which all rows lie.
    fn span(&self) -> Range<usize> {
        let first = self.address().addr();
        let last = first.wrapping_add_signed(self.row_stride * (self.height as isize - 1));
        first.min(last)..first.max(last) + self.row_bytes()
    }

    /// Borrows the array for reading.
    pub(super) fn read(&self) -> PyResult<Reading<'_, 'py>> {
        let borrow = self.bytes().try_readonly().map_err(|_| in_use("image"))?;
        Ok(Reading { image: self, _borrow: borrow })
    }

    /// Borrows the array for writing.
    pub(super) fn write(&self) -> PyResult<Writing<'_, 'py>> {
        let borrow = self.bytes().try_readwrite().map_err(|error| match error {
            numpy::BorrowError::NotWriteable => {
                ImageError::new_err("out: expected a writable array, got a read-only one; pass out=None or a copy")
            }
            _ => in_use("out"),
        })?;
        Ok(Writing { image: self, _borrow: borrow })
    }
}

fn in_use(name: &str) -> PyErr {
    ImageError::new_err(format!(
        "{name}: another call is writing to or reading from this memory; use one array a thread"
    ))
}

/// An image whose array is borrowed for reading.
pub(super) struct Reading<'a, 'py> {
    image: &'a ImageArray<'py>,
    _borrow: PyReadonlyArrayDyn<'py, u8>,
}

impl Reading<'_, '_> {
    /// The image's samples, `T` being of the size of its dtype.
    pub(super) fn view<T: Sample>(&self) -> crate::Result<ImageView<'_, T>> {
        let image = self.image;
        let span = image.span();
        let sample = size_of::<T>();
        assert_eq!(sample, image.dtype.itemsize(), "chosen by the dtype");
        let before = image.address().addr() - span.start;
        // SAFETY: `span` is the memory of the array's own rows, checked to be aligned and adjacent, and the borrow keeps
        // writers that use rust-numpy away; a `Sample` takes any bits. Padding between rows may belong to others, is
        // never read, and nothing of ours writes to it: `check_output` refuses outputs within the span.
        let data = unsafe {
            std::slice::from_raw_parts(image.address().wrapping_sub(before).cast::<T>(), span.len() / sample)
        };
        let row_stride = image.row_stride / sample as isize;
        ImageView::with_row_stride(data, (image.width, image.height), image.channels, before / sample, row_stride)
    }
}

/// An image whose array is borrowed for writing.
pub(super) struct Writing<'a, 'py> {
    image: &'a ImageArray<'py>,
    _borrow: PyReadwriteArrayDyn<'py, u8>,
}

impl Writing<'_, '_> {
    /// The image's rows, `T` being of the size of its dtype.
    pub(super) fn view<T: Sample>(&mut self) -> crate::Result<ImageViewMut<'_, T>> {
        let image = self.image;
        assert_eq!(size_of::<T>(), image.dtype.itemsize(), "chosen by the dtype");
        let samples = image.width * image.channels;
        let row = |y: usize| {
            let start = image.address().wrapping_offset(image.row_stride * y as isize).cast::<T>();
            // SAFETY: row y of the array, checked to be aligned, adjacent, writable and apart from the other rows; the
            // borrow, held by `self`, keeps every other user of rust-numpy away.
            unsafe { std::slice::from_raw_parts_mut(start, samples) }
        };
        ImageViewMut::from_rows((0..image.height).map(row).collect(), image.width, image.channels)
    }
}
