//! The backward warp: every output cell takes its value from where the table says.

pub mod direct;
pub(crate) mod kernels;
mod options;
pub mod reference;

pub use kernels::Bilinear;
pub use options::{Interpolation, WarpOptions};

use crate::error::{Error, Result};
use crate::image::{ImageView, ImageViewMut, Sample};
use crate::lut::Lut;
use crate::lut::table::{RunKind, Segment};
use crate::parallel;
use kernels::{RowKernels, Source};

impl Lut {
    /// Warps an image into a new one: row-major samples, `rows * columns * channels` of them.
    ///
    /// # Errors
    /// Those of [`Lut::warp_into`], and [`Error::OutOfMemory`].
    pub fn warp<T: Bilinear>(&self, image: &ImageView<'_, T>, options: &WarpOptions<T>) -> Result<Vec<T>> {
        self.check_image(image, options)?;
        let samples = self.rows() * self.columns() * image.channels();
        let mut out = Vec::new();
        out.try_reserve_exact(samples)
            .map_err(|_| Error::OutOfMemory { what: "out", bytes: samples.saturating_mul(size_of::<T>()) })?;
        out.resize(samples, T::default());
        let size = (self.columns(), self.rows());
        self.warp_into(image, &mut ImageViewMut::new(&mut out, size, image.channels())?, options)?;
        Ok(out)
    }

    /// Warps an image into a given one, bilinear or nearest. The result does not depend on the number of threads.
    ///
    /// # Errors
    /// [`Error::SizeMismatch`], [`Error::OutputShape`], [`Error::BorderChannels`] and [`Error::Threads`], all before
    /// anything is written.
    pub fn warp_into<T: Bilinear>(
        &self,
        image: &ImageView<'_, T>,
        out: &mut ImageViewMut<'_, T>,
        options: &WarpOptions<T>,
    ) -> Result<()> {
        run(self, image, out, options, options.kernels(image)?)
    }

    /// Whether an image and options fit this table: what a warp checks first.
    ///
    /// # Errors
    /// [`Error::SizeMismatch`], [`Error::BorderChannels`] and [`Error::Threads`].
    pub fn check_image<T: Copy>(&self, image: &ImageView<'_, T>, options: &WarpOptions<T>) -> Result<()> {
        let source = self.source_size();
        let expected = (source.0 as usize, source.1 as usize);
        if (image.width(), image.height()) != expected {
            return Err(Error::SizeMismatch { expected, got: (image.width(), image.height()) });
        }
        options.border(image.channels())?;
        options.threads_for(0).map(drop)
    }

    /// Nearest for samples of any kind, also those without arithmetic; `options.interpolation` is not looked at.
    ///
    /// # Errors
    /// Those of [`Lut::warp_into`].
    pub fn warp_nearest_into<T: Sample>(
        &self,
        image: &ImageView<'_, T>,
        out: &mut ImageViewMut<'_, T>,
        options: &WarpOptions<T>,
    ) -> Result<()> {
        run(self, image, out, options, options.nearest_kernels(image)?)
    }
}

fn run<T: Sample>(
    lut: &Lut,
    image: &ImageView<'_, T>,
    out: &mut ImageViewMut<'_, T>,
    options: &WarpOptions<T>,
    kernels: RowKernels<T>,
) -> Result<()> {
    lut.check_image(image, options)?;
    let (rows, columns) = (lut.rows(), lut.columns());
    let expected = (rows, columns, image.channels());
    if out.shape() != expected {
        return Err(Error::OutputShape { expected, got: out.shape() });
    }
    let border = options.border(image.channels())?;
    let source = Source::new(image, &border);
    let threads = options.threads_for(rows * columns)?;
    let bands = out.bands(parallel::rows_per_band(rows, columns, threads));
    parallel::for_each(threads, bands, |(first, band)| {
        for (row, cells) in (first..).zip(band) {
            warp_segments(lut.table().row(row), &source, cells, &kernels);
        }
    });
    Ok(())
}

/// Fills one output row, segment by segment.
fn warp_segments<'a, T: Sample>(
    segments: impl Iterator<Item = Segment<'a>>,
    source: &Source<'_, T>,
    cells: &mut [T],
    kernels: &RowKernels<T>,
) {
    let channels = source.channels();
    for segment in segments {
        let cells = &mut cells[segment.first * channels..(segment.first + segment.taps.len()) * channels];
        match segment.kind {
            RunKind::Outside => source.fill_border(cells),
            RunKind::Inside => (kernels.inside)(source, segment.taps, cells),
            RunKind::Rim | RunKind::Halo => (kernels.edge)(source, segment.taps, cells),
        }
    }
}
