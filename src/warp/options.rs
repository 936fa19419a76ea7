//! How to warp.

use std::borrow::Cow;

use super::{Bilinear, Interpolation};
use crate::error::{Error, IsaError, Result, ViewError, WarpError};
use crate::isa::Isa;
use crate::kernels::wide::{CUBIC, LANCZOS4};
use crate::kernels::{RowKernels, Source};
use crate::lut::Lut;
use crate::parallel::Work;
use crate::table::BorderMode;
use crate::view::buffer;
use crate::view::{ImageView, Sample};

/// Options of a warp.
#[derive(Debug, Clone, PartialEq)]
pub struct WarpOptions<T> {
    /// How values are taken.
    pub interpolation: Interpolation,
    /// What cells without an image get: one value for all channels, or one each.
    pub border_value: Vec<T>,
    /// What lies beyond the image; `None` is what the table was built for ([`Lut::border_mode`]), and without a table the
    /// border value. A table's cells outside the image sample what they were built for, so of a table it can only be
    /// [`BorderMode::Transparent`] or that.
    pub border_mode: Option<BorderMode>,
    /// Which instruction set's kernels; `None` is [`Isa::active`]. All give the same result: this is for tests, benches
    /// and bug reports.
    pub isa: Option<Isa>,
    /// At most how many threads; `None` is [`num_threads`](crate::num_threads).
    pub threads: Option<usize>,
}

impl<T: Default> Default for WarpOptions<T> {
    fn default() -> Self {
        Self {
            interpolation: Interpolation::default(),
            border_value: vec![T::default()],
            border_mode: None,
            isa: None,
            threads: None,
        }
    }
}

impl<T: Copy> WarpOptions<T> {
    /// The instruction set to use, which this CPU can run.
    pub(super) fn isa(&self) -> Result<Isa, IsaError> {
        self.isa.map_or_else(Isa::active, Isa::checked)
    }

    /// How many threads to use for so many cells of so many channels.
    pub(crate) fn threads_for(&self, cells: usize, channels: usize) -> Result<usize> {
        Work::warp(cells, channels * size_of::<T>()).threads(self.threads)
    }

    /// Whether there is a border value for each channel of the images; or, for images of one channel, for each plane.
    pub(super) fn check_border(&self, channels: usize, images: usize) -> Result<()> {
        match self.border_value.len() {
            1 => Ok(()),
            values if values == channels => Ok(()),
            values if values > 0 && channels == 1 && images.is_multiple_of(values) => Ok(()),
            values => Err(Error::View(ViewError::BorderChannels { expected: channels, got: values })),
        }
    }

    /// Whether a table that was built for a mode can do as this says.
    pub(super) fn check_border_mode(&self, built: BorderMode) -> Result<(), WarpError> {
        match self.border_mode {
            None | Some(BorderMode::Transparent) => Ok(()),
            Some(mode) if mode == built => Ok(()),
            Some(got) => Err(WarpError::BorderMode { built: built.name(), got: got.name() }),
        }
    }

    /// The border value of each channel, or of each plane in turn, if [`Self::check_border`] allows.
    pub(crate) fn border(&self, channels: usize, images: usize) -> Result<Cow<'_, [T]>> {
        self.check_border(channels, images)?;
        match *self.border_value {
            [value] if channels > 1 => Ok(Cow::Owned(buffer::filled("border_value", channels, value)?)),
            _ => Ok(Cow::Borrowed(&self.border_value)),
        }
    }
}

impl<T: Sample> WarpOptions<T> {
    /// An image as the cells of a table sample it.
    pub(crate) fn source<'a>(&self, lut: &Lut, image: &'a ImageView<'a, T>, border: &'a [T]) -> Source<'a, T> {
        let source = Source::new(image, border).with_edges(lut.table().edges().axes());
        if self.border_mode == Some(BorderMode::Transparent) { source.transparent() } else { source }
    }

    /// The kernels of nearest for images of one number of channels, of which there is at least one.
    pub(crate) fn nearest_kernels(&self, images: &[ImageView<'_, T>]) -> Result<RowKernels<T>> {
        let contiguous = images.iter().all(ImageView::is_contiguous);
        Ok(RowKernels::nearest(self.isa()?, images[0].channels(), contiguous))
    }
}

impl<T: Bilinear> WarpOptions<T> {
    /// The kernels of these options' interpolation, likewise; of area those for cells that see no more than a pixel.
    pub(crate) fn kernels(&self, images: &[ImageView<'_, T>]) -> Result<RowKernels<T>> {
        let contiguous = images.iter().all(ImageView::is_contiguous);
        match self.interpolation {
            Interpolation::Nearest => self.nearest_kernels(images),
            Interpolation::Bilinear | Interpolation::Area => {
                Ok(RowKernels::bilinear(self.isa()?, images[0].channels(), contiguous))
            }
            Interpolation::Cubic => Ok(RowKernels::wide::<CUBIC>(self.isa()?, images[0].channels())),
            Interpolation::Lanczos4 => Ok(RowKernels::wide::<LANCZOS4>(self.isa()?, images[0].channels())),
        }
    }
}

/// The border value of the `index`-th image, of one for each channel or for each plane in turn.
pub(super) fn border_of<T>(border: &[T], channels: usize, index: usize) -> &[T] {
    let first = if border.len() == channels { 0 } else { index % border.len() };
    &border[first..first + channels]
}
