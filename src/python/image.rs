//! Images as arrays: their layout checked by hand, their memory borrowed without a copy.

use std::ops::Range;

use numpy::npyffi::{PY_ARRAY_API, npy_intp};
use numpy::{
    PyArrayDescr, PyArrayDescrMethods, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyReadwriteArrayDyn,
    PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::exceptions::PyMemoryError;
use pyo3::prelude::*;

use super::arrays;
use super::convert::tuple_text;
use super::error::classes::{DtypeError, ImageError, OutOfMemoryError};
use super::layout::Layout;
use super::shared;
use crate::view::buffer;
use crate::{ImageView, ImageViewMut, Sample};

/// How often an axis is stepped along, and by how many bytes; an axis that is not there is one of length 1.
#[derive(Clone, Copy)]
struct Steps {
    count: usize,
    stride: isize,
}

/// An array that holds an image, or several: aligned, native, its samples adjacent within each row.
///
/// Its memory is borrowed, never copied: what cannot be read where it lies is refused. The shape and the strides are
/// kept, so no Python code of an argument may run between `new` and the end of the call.
pub(super) struct ImageArray<'py> {
    array: Bound<'py, PyUntypedArray>,
    dtype: Bound<'py, PyArrayDescr>,
    layout: Layout,
    width: usize,
    /// Samples of a pixel that lie together: 1 for planes.
    samples: usize,
    rows: Steps,
    planes: Steps,
    batch: Steps,
}

impl<'py> ImageArray<'py> {
    /// Checks everything but the dtype's kind; `name` is the argument's.
    pub(super) fn new(name: &str, array: Bound<'py, PyUntypedArray>, layout: Layout) -> PyResult<Self> {
        let dtype = array.dtype();
        if dtype.is_native_byteorder() == Some(false) {
            let mend = match name {
                "out" => "use numpy.empty(shape, image.dtype)".to_owned(),
                _ => format!("use {name}.astype({name}.dtype.newbyteorder(\"=\"))"),
            };
            let message = format!("{name}: expected this machine's byte order, got {dtype}; {mend}");
            return Err(DtypeError::new_err(message));
        }
        let (shape, strides) = (array.shape(), array.strides());
        let Some(axes) = layout.axes(shape.len()) else {
            return Err(ImageError::new_err(format!(
                "{name}: expected shape {} for layout=\"{}\", got {}{}",
                layout.shape_text(),
                layout.name(),
                tuple_text(shape),
                layout.hint(shape.len())
            )));
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
        // an axis of length 1 is never stepped along, so NumPy lets its stride be anything
        let steps = |axis: Option<usize>| match axis {
            Some(axis) if shape[axis] != 1 => Steps { count: shape[axis], stride: strides[axis] },
            _ => Steps { count: 1, stride: 0 },
        };
        let adjacent = |steps: Steps, expected: isize| steps.count == 1 || steps.stride == expected;
        let (samples, columns) = (steps(axes.samples), steps(Some(axes.columns)));
        let (rows, planes, batch) = (steps(Some(axes.rows)), steps(axes.planes), steps(axes.batch));
        let whole = [rows, planes, batch].iter().all(|steps| steps.stride % sample == 0);
        let pixel = sample * samples.count as isize;
        if !array.is_aligned() {
            let message = format!(
                "{name}: expected aligned samples, got {dtype} at odd addresses, as in a packed record; use {name}.copy()"
            );
            return Err(ImageError::new_err(message));
        }
        if !adjacent(samples, sample) || !adjacent(columns, pixel) || !whole {
            let message = format!(
                "{name}: expected samples adjacent within each row (any row stride), got shape {} with strides {:?}{}; use numpy.ascontiguousarray({name})",
                tuple_text(shape),
                strides,
                layout.elsewhere(),
            );
            return Err(ImageError::new_err(message));
        }
        let (width, samples) = (columns.count, samples.count);
        // the rows of an image of one row could be stepped along as those of any contiguous image
        let rows = if rows.count == 1 { Steps { stride: pixel * width as isize, ..rows } } else { rows };
        Ok(Self { array, dtype, layout, width, samples, rows, planes, batch })
    }

    /// A new array for the result of warping this image, not initialised.
    pub(super) fn new_output(&self, rows: usize, columns: usize) -> PyResult<Self> {
        let (shape, dims) = self.output_shape(rows, columns);
        Self::allocate(&shape[..dims], self.dtype.clone(), self.layout)
    }

    /// A new array, not initialised.
    pub(super) fn allocate(shape: &[usize], dtype: Bound<'py, PyArrayDescr>, layout: Layout) -> PyResult<Self> {
        Self::new("out", empty_array(shape, dtype)?, layout)
    }

    /// Checks that `array` can take the result of warping this image.
    pub(super) fn check_output(
        &self,
        array: Bound<'py, PyUntypedArray>,
        rows: usize,
        columns: usize,
    ) -> PyResult<Self> {
        let (shape, dims) = self.output_shape(rows, columns);
        let dtype = (&self.dtype, "that of the image", "image.dtype");
        Self::output(array, &shape[..dims], dtype, self.layout, &[("image", self)])
    }

    /// Checks that `array` can take a result of that shape and dtype (with why, and how to write it), whose memory
    /// none of the inputs spans.
    pub(super) fn output(
        array: Bound<'py, PyUntypedArray>,
        expected: &[usize],
        (dtype, whose, name): (&Bound<'py, PyArrayDescr>, &str, &str),
        layout: Layout,
        inputs: &[(&str, &Self)],
    ) -> PyResult<Self> {
        if array.shape() != expected {
            let (expected, got) = (tuple_text(expected), tuple_text(array.shape()));
            return Err(ImageError::new_err(format!("out: expected shape {expected}, got {got}")));
        }
        let out = Self::new("out", array, layout)?;
        if !out.dtype.is_equiv_to(dtype) {
            let message = format!("out: expected dtype {dtype}, {whose}, got {}", out.dtype);
            return Err(DtypeError::new_err(message));
        }
        if out.rows_overlap() {
            return Err(ImageError::new_err(format!(
                "out: expected rows that do not overlap, got strides {:?}; use numpy.empty({}, {name})",
                out.array.strides(),
                tuple_text(expected)
            )));
        }
        let written = out.span();
        for (input, read) in inputs.iter().map(|(input, array)| (input, array.span())) {
            if read.start < written.end && written.start < read.end {
                return Err(ImageError::new_err(format!(
                    "out: expected memory of its own, got memory that {input} spans too; pass out=None or another array"
                )));
            }
        }
        Ok(out)
    }

    /// The shape of the result, in the first so many entries.
    fn output_shape(&self, rows: usize, columns: usize) -> ([usize; 4], usize) {
        let dims = self.array.ndim();
        let mut shape = [1; 4];
        shape[..dims].copy_from_slice(self.array.shape());
        if let Some(axes) = self.layout.axes(dims) {
            (shape[axes.rows], shape[axes.columns]) = (rows, columns);
        }
        (shape, dims)
    }

    pub(super) fn dtype(&self) -> &Bound<'py, PyArrayDescr> {
        &self.dtype
    }

    pub(super) fn layout(&self) -> Layout {
        self.layout
    }

    /// (width, height).
    pub(super) fn size(&self) -> (usize, usize) {
        (self.width, self.rows.count)
    }

    /// Channels of a picture, whether they lie together or in planes.
    pub(super) fn channels(&self) -> usize {
        self.samples * self.planes.count
    }

    /// How many images a batch has; 1 where there is no such axis.
    pub(super) fn images(&self) -> usize {
        self.batch.count
    }

    pub(super) fn shape(&self) -> &[usize] {
        self.array.shape()
    }

    pub(super) fn into_array(self) -> Bound<'py, PyUntypedArray> {
        self.array
    }

    fn row_bytes(&self) -> usize {
        self.width * self.samples * self.dtype.itemsize()
    }

    /// Whether two rows may share a byte: each axis must step over all that the shorter steps reach.
    fn rows_overlap(&self) -> bool {
        let mut axes = [self.rows, self.planes, self.batch];
        axes.sort_by_key(|axis| axis.stride.unsigned_abs());
        let mut reach = self.row_bytes();
        axes.into_iter().filter(|axis| axis.count > 1).any(|Steps { count, stride }| {
            let overlap = stride.unsigned_abs() < reach;
            reach += stride.unsigned_abs() * (count - 1);
            overlap
        })
    }

    /// Address of the array's first sample.
    fn address(&self) -> *mut u8 {
        bytes(&self.array).data()
    }

    /// Address of row 0 of every plane of every image of the batch, in order.
    fn planes(&self) -> impl ExactSizeIterator<Item = *mut u8> + use<'_, 'py> {
        let start = self.address();
        let planes = self.planes.count;
        (0..self.batch.count * planes).map(move |index| {
            let (image, plane) = ((index / planes) as isize, (index % planes) as isize);
            start.wrapping_offset(self.batch.stride * image + self.planes.stride * plane)
        })
    }

    /// The addresses between which rows lie that begin at `first` and where `axes` lead from there.
    fn reach(&self, first: *mut u8, axes: &[Steps]) -> Range<usize> {
        let (mut start, mut end) = (first.addr(), first.addr() + self.row_bytes());
        for axis in axes {
            let far = axis.stride * (axis.count as isize - 1);
            start = start.wrapping_add_signed(far.min(0));
            end = end.wrapping_add_signed(far.max(0));
        }
        start..end
    }

    /// The addresses between which all rows lie.
    fn span(&self) -> Range<usize> {
        self.reach(self.address(), &[self.rows, self.planes, self.batch])
    }

    /// Borrows the array for reading.
    pub(super) fn read(&self) -> PyResult<Reading<'_, 'py>> {
        let borrow = bytes(&arrays::to_borrow(&self.array)?).try_readonly().map_err(|_| in_use("image"))?;
        Ok(Reading { image: self, _borrow: borrow })
    }

    /// Borrows the array for writing.
    pub(super) fn write(&self) -> PyResult<Writing<'_, 'py>> {
        let borrow = bytes(&arrays::to_borrow(&self.array)?).try_readwrite().map_err(|error| match error {
            numpy::BorrowError::NotWriteable => {
                ImageError::new_err("out: expected a writable array, got a read-only one; pass out=None or a copy")
            }
            _ => in_use("out"),
        })?;
        Ok(Writing { image: self, _borrow: borrow })
    }
}

/// The array under another element type: only for its data pointer and borrow flags, which do not look at it.
fn bytes<'a, 'py>(array: &'a Bound<'py, PyUntypedArray>) -> &'a Bound<'py, PyArrayDyn<u8>> {
    // SAFETY: `PyArrayDyn<T>` is a transparent NumPy array whatever T is, and no element is read as T.
    unsafe { array.cast_unchecked() }
}

fn in_use(name: &str) -> PyErr {
    ImageError::new_err(format!(
        "{name}: another call is writing to or reading from this memory; use one array a thread"
    ))
}

/// The `out=` of a call, if one is given.
pub(super) struct Output<'py> {
    given: Option<(Bound<'py, PyAny>, Bound<'py, PyUntypedArray>)>,
}

impl<'py> Output<'py> {
    /// Takes what is given as an array, not yet checked; its Python code runs here.
    pub(super) fn new(object: Option<&Bound<'py, PyAny>>) -> PyResult<Self> {
        let given = object.filter(|object| !object.is_none());
        let given = given.map(|object| Ok::<_, PyErr>((object.clone(), shared::array("out", object, true)?)));
        Ok(Self { given: given.transpose()? })
    }

    /// The array to write to.
    pub(super) fn array(&self) -> Option<Bound<'py, PyUntypedArray>> {
        self.given.as_ref().map(|(_, array)| array.clone())
    }

    /// What the call returns: what was given, or the array that was made in its place.
    pub(super) fn given_or(&self, new: ImageArray<'py>) -> Bound<'py, PyAny> {
        self.given.as_ref().map_or_else(|| new.array.into_any(), |(object, _)| object.clone())
    }
}

/// A new array, not initialised.
///
/// # Errors
/// `OutOfMemoryError` where there is no memory for it, with NumPy's own words.
pub(super) fn empty_array<'py>(
    shape: &[usize],
    dtype: Bound<'py, PyArrayDescr>,
) -> PyResult<Bound<'py, PyUntypedArray>> {
    let py = dtype.py();
    let mut shape = shape.to_vec();
    let dims_of = shape.as_mut_ptr().cast::<npy_intp>();
    // SAFETY: `shape` has as many lengths as it says, the dtype is one of which NumPy takes over a reference, and a new
    // reference or null comes back. An array of that dtype is what `numpy.empty` makes, without the cost of asking for it
    // by name.
    let array = unsafe {
        let dtype = dtype.into_dtype_ptr();
        Bound::from_owned_ptr_or_err(py, PY_ARRAY_API.PyArray_Empty(py, shape.len() as _, dims_of, dtype, 0))
    };
    let array = array.map_err(|error| match error.is_instance_of::<PyMemoryError>(py) {
        true => OutOfMemoryError::new_err(format!("out: {}", error.value(py))),
        false => error,
    })?;
    Ok(array.cast_into()?)
}

/// An image whose array is borrowed for reading.
pub(super) struct Reading<'a, 'py> {
    image: &'a ImageArray<'py>,
    _borrow: PyReadonlyArrayDyn<'py, u8>,
}

impl Reading<'_, '_> {
    /// The images, or their planes, `T` being of the size of the dtype.
    pub(super) fn views<T: Sample>(&self) -> crate::Result<Vec<ImageView<'_, T>>> {
        let image = self.image;
        let sample = size_of::<T>();
        assert_eq!(sample, image.dtype.itemsize(), "chosen by the dtype");
        let row_stride = image.rows.stride / sample as isize;
        let view = |first: *mut u8| {
            let span = image.reach(first, &[image.rows]);
            let before = first.addr() - span.start;
            let (start, samples) = (first.wrapping_sub(before).cast::<T>(), span.len() / sample);
            // SAFETY: `span` is the memory of the array's own rows, checked to be aligned and adjacent, and the borrow
            // keeps writers that use rust-numpy away; a `Sample` takes any bits. What lies between rows may belong to
            // others, and nothing of ours writes to it: `check_output` refuses outputs within the whole array's span.
            let data = unsafe { std::slice::from_raw_parts(start, samples) };
            let size = (image.width, image.rows.count);
            ImageView::with_row_stride(data, size, image.samples, before / sample, row_stride)
        };
        let mut views = buffer::reserved("image", image.planes().len())?;
        for first in image.planes() {
            views.push(view(first)?);
        }
        Ok(views)
    }
}

/// An image whose array is borrowed for writing.
pub(super) struct Writing<'a, 'py> {
    image: &'a ImageArray<'py>,
    _borrow: PyReadwriteArrayDyn<'py, u8>,
}

impl Writing<'_, '_> {
    /// The images, or their planes, `T` being of the size of the dtype.
    pub(super) fn views<T: Sample>(&mut self) -> crate::Result<Vec<ImageViewMut<'_, T>>> {
        let image = self.image;
        assert_eq!(size_of::<T>(), image.dtype.itemsize(), "chosen by the dtype");
        let row_stride = image.rows.stride / size_of::<T>() as isize;
        let size = (image.width, image.rows.count);
        // SAFETY: the rows of the array, checked to be aligned, adjacent, writable and apart from each other (a new
        // array's are); the borrow, held by `self`, keeps every other user of rust-numpy away.
        let view = |first: *mut u8| unsafe { ImageViewMut::from_raw(first.cast(), size, image.samples, row_stride) };
        buffer::collected("out", image.planes().map(view))
    }
}
