//! How to warp.

use super::kernels::{Bilinear, RowKernels};
use crate::cpu::Isa;
use crate::error::{Error, Result};
use crate::image::{ImageView, Sample};
use crate::parallel;

/// How a cell's value is taken from the pixels around its coordinate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Interpolation {
    /// The nearest pixel, halves to even: no value that the image does not hold, so label images keep their ids.
    Nearest,
    /// The four pixels around the coordinate, weighted by nearness. The default.
    #[default]
    Bilinear,
}

/// Options of a warp.
#[derive(Debug, Clone, PartialEq)]
pub struct WarpOptions<T> {
    /// How values are taken.
    pub interpolation: Interpolation,
    /// What cells without an image get: one value for all channels, or one each.
    pub border_value: Vec<T>,
    /// Which instruction set's kernels; `None` is [`Isa::active`]. All give the same result: this is for tests, benches
    /// and bug reports.
    pub isa: Option<Isa>,
    /// At most how many threads; `None` is [`num_threads`](crate::num_threads).
    pub threads: Option<usize>,
}

impl<T: Default> Default for WarpOptions<T> {
    fn default() -> Self {
        Self { interpolation: Interpolation::default(), border_value: vec![T::default()], isa: None, threads: None }
    }
}

/// Outputs of fewer cells than this are warped on the caller's thread. Waking a helper takes 5 to 20 us here, in
/// which one thread warps that many cells.
pub(super) const INLINE_CELLS: usize = 1 << 14;

impl<T: Copy> WarpOptions<T> {
    /// The instruction set to use, which this CPU can run.
    pub(super) fn isa(&self) -> Result<Isa> {
        self.isa.map_or_else(Isa::active, Isa::checked)
    }

    /// How many threads to use for so many cells.
    pub(super) fn threads_for(&self, cells: usize) -> Result<usize> {
        let threads = self.threads.unwrap_or_else(parallel::num_threads);
        parallel::check_threads(threads)?;
        Ok(if cells < INLINE_CELLS { 1 } else { threads })
    }

    /// The border value of each channel of the images; or, for images of one channel, of each plane in turn.
    pub(super) fn border(&self, channels: usize, images: usize) -> Result<Vec<T>> {
        match self.border_value.len() {
            1 => Ok(vec![self.border_value[0]; channels]),
            values if values == channels => Ok(self.border_value.clone()),
            values if values > 0 && channels == 1 && images.is_multiple_of(values) => Ok(self.border_value.clone()),
            values => Err(Error::BorderChannels { expected: channels, got: values }),
        }
    }
}

impl<T: Sample> WarpOptions<T> {
    /// The kernels of nearest for images of one number of channels, of which there is at least one.
    pub(super) fn nearest_kernels(&self, images: &[ImageView<'_, T>]) -> Result<RowKernels<T>> {
        let contiguous = images.iter().all(ImageView::is_contiguous);
        Ok(RowKernels::nearest(self.isa()?, images[0].channels(), contiguous))
    }
}

impl<T: Bilinear> WarpOptions<T> {
    /// The kernels of these options' interpolation, likewise.
    pub(super) fn kernels(&self, images: &[ImageView<'_, T>]) -> Result<RowKernels<T>> {
        let contiguous = images.iter().all(ImageView::is_contiguous);
        match self.interpolation {
            Interpolation::Nearest => self.nearest_kernels(images),
            Interpolation::Bilinear => Ok(RowKernels::bilinear(self.isa()?, images[0].channels(), contiguous)),
        }
    }
}
