//! The backward warp: every output cell takes its value from where the table says.

pub(crate) mod kernels;
mod options;
pub mod reference;

pub use kernels::Bilinear;
pub use options::{Interpolation, WarpOptions};

use crate::error::{Error, Result};
use crate::image::{ImageView, ImageViewMut, Sample};
use crate::lut::Lut;
use crate::lut::table::RunKind;
use crate::parallel;
use kernels::{RowKernels, Source};

/// Outputs of fewer cells than this are warped on the caller's thread. Waking a helper takes 5 to 20 us here, in
/// which one thread warps that many cells.
const INLINE_CELLS: usize = 1 << 14;

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
        let kernels = match options.interpolation {
            Interpolation::Nearest => RowKernels::nearest(options.isa()?, image.channels(), image.is_contiguous()),
            Interpolation::Bilinear => RowKernels::bilinear(options.isa()?, image.channels(), image.is_contiguous()),
        };
        run(self, image, out, options, kernels)
    }

    /// Whether an image and options fit this table: what a warp checks first.
    ///
    /// # Errors
    /// [`Error::SizeMismatch`], [`Error::BorderChannels`] and [`Error::Threads`].
    pub fn check_image<T>(&self, image: &ImageView<'_, T>, options: &WarpOptions<T>) -> Result<()> {
        let source = self.source_size();
        let expected = (source.0 as usize, source.1 as usize);
        if (image.width(), image.height()) != expected {
            return Err(Error::SizeMismatch { expected, got: (image.width(), image.height()) });
        }
        let values = options.border_value.len();
        if values != 1 && values != image.channels() {
            return Err(Error::BorderChannels { expected: image.channels(), got: values });
        }
        options.threads.map_or(Ok(()), parallel::check_threads)
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
        run(self, image, out, options, RowKernels::nearest(options.isa()?, image.channels(), image.is_contiguous()))
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
    let border: Vec<T> = options.border_value.iter().copied().cycle().take(image.channels()).collect();
    let source = Source::new(image, &border);
    let threads = if rows * columns < INLINE_CELLS { 1 } else { options.threads.unwrap_or_else(parallel::num_threads) };
    let bands = out.bands(parallel::rows_per_band(rows, columns, threads));
    parallel::for_each(threads, bands, |(first, band)| {
        for (row, cells) in (first..).zip(band) {
            warp_row(lut, row, &source, cells, &kernels);
        }
    });
    Ok(())
}

/// Fills one output row, segment by segment.
fn warp_row<T: Sample>(lut: &Lut, row: usize, source: &Source<'_, T>, cells: &mut [T], kernels: &RowKernels<T>) {
    let channels = source.channels();
    for segment in lut.table().row(row) {
        let cells = &mut cells[segment.first * channels..(segment.first + segment.taps.len()) * channels];
        match segment.kind {
            RunKind::Outside => source.fill_border(cells),
            RunKind::Inside => (kernels.inside)(source, segment.taps, cells),
            RunKind::Rim | RunKind::Halo => (kernels.edge)(source, segment.taps, cells),
        }
    }
}
