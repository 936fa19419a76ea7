//! The arguments of the transposes of warps, of one camera and of a rig.

use numpy::PyArrayDescrMethods;
use pyo3::prelude::*;

use super::detached;
use super::dtype::Taken;
use super::error::classes::{ArgumentError, DtypeError, ImageError};
use super::image::{ImageArray, Output};
use super::layout::Layout;
use super::options;
use super::shared;
use crate::view::PointSample;
use crate::{ImageView, ImageViewMut, Interpolation, WarpOptions};

/// What runs a transpose of each dtype.
pub(super) trait Transpose: Sync {
    /// # Errors
    /// Those of [`Lut::warp_many_adjoint_into`](crate::Lut::warp_many_adjoint_into).
    fn run<T: PointSample>(
        &self,
        grads: &[ImageView<'_, T>],
        outs: &mut [ImageViewMut<'_, T>],
        options: &WarpOptions<T>,
    ) -> crate::Result<()>;
}

/// One call, its arguments checked.
pub(super) struct Adjoint<'py> {
    grad: ImageArray<'py>,
    out: Output<'py>,
    interpolation: Interpolation,
    threads: Option<usize>,
}

impl<'py> Adjoint<'py> {
    /// `table` is what has so many rows and columns of cells, as messages name it.
    pub(super) fn new(
        (table, rows, columns): (&str, usize, usize),
        grad: &Bound<'py, PyAny>,
        interpolation: Option<&Bound<'py, PyAny>>,
        out: Option<&Bound<'py, PyAny>>,
        threads: Option<&Bound<'py, PyAny>>,
        layout: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Self> {
        let interpolation =
            match interpolation.map_or(Ok(Taken::By(Interpolation::Bilinear)), options::interpolation)? {
                Taken::By(interpolation) => interpolation,
                Taken::Mode => return Err(no_adjoint()),
            };
        let threads = threads.map(|threads| options::thread_count("threads", threads)).transpose()?;
        let layout = layout.map_or(Ok(Layout::Hwc), options::layout)?;
        let out = Output::new(out)?;
        let grad = ImageArray::new("grad", shared::array("grad", grad, false)?, layout)?;
        if grad.size() != (columns, rows) {
            let (got_columns, got_rows) = grad.size();
            return Err(ImageError::new_err(format!(
                "grad: expected {rows} rows of {columns} cells, as {table} has, got {got_rows} of {got_columns}; pass \
                 one value for each cell, and layout= if its axes are in another order"
            )));
        }
        Ok(Self { grad, out, interpolation, threads })
    }

    /// The result of one transpose, for images of this size.
    pub(super) fn run(&self, source_size: (u32, u32), transpose: &impl Transpose) -> PyResult<Bound<'py, PyAny>> {
        match (self.grad.dtype().kind(), self.grad.dtype().itemsize()) {
            (b'f', 4) => self.run_as::<f32>(source_size, transpose),
            (b'f', 8) => self.run_as::<f64>(source_size, transpose),
            _ => Err(DtypeError::new_err(format!(
                "grad: expected float32 or float64, got {}; use grad.astype(numpy.float32)",
                self.grad.dtype()
            ))),
        }
    }

    fn run_as<T: PointSample>(
        &self,
        (width, height): (u32, u32),
        transpose: &impl Transpose,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (rows, columns) = (height as usize, width as usize);
        let made = match self.out.array() {
            Some(array) => self.grad.check_output(array, rows, columns)?,
            None => self.grad.new_output(rows, columns)?,
        };
        let read = self.grad.read()?;
        let views = read.views::<T>()?;
        let mut write = made.write()?;
        let mut outs = write.views::<T>()?;
        let options =
            WarpOptions { interpolation: self.interpolation, threads: self.threads, ..WarpOptions::default() };
        detached::run(self.grad.dtype().py(), || transpose.run(&views, &mut outs, &options))?;
        drop(outs);
        drop(write);
        Ok(self.out.given_or(made))
    }
}

/// Why there is no adjoint of mode.
fn no_adjoint() -> PyErr {
    ArgumentError::new_err(
        "interpolation: expected \"bilinear\", \"nearest\" or \"area\", got \"mode\", which is not linear in the image and has \
         no adjoint; choose one",
    )
}
