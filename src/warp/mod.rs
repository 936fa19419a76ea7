//! The backward warp: every output cell takes its value from where the table says.
//!
//! ```
//! use ipm_rs::{ImageView, ImageViewMut, Interpolation, Lut, WarpOptions};
//!
//! # fn main() -> ipm_rs::Result<()> {
//! // four cells of a 3 x 2 image; the last one is nowhere
//! let lut = Lut::from_maps(&[0.0f32, 1.5, 2.0, 9.0], &[0.0f32, 0.5, 1.0, 9.0], 4, (3, 2))?;
//! let image = [10u8, 20, 30, 40, 50, 60];
//! let view = ImageView::new(&image, (3, 2), 1)?;
//! let mut out = [0; 4];
//! let options = WarpOptions { border_value: vec![7], ..WarpOptions::default() };
//! lut.warp_into(&view, &mut ImageViewMut::new(&mut out, (4, 1), 1)?, &options)?;
//! assert_eq!(out, [10, 40, 60, 7]);
//! let nearest = WarpOptions { interpolation: Interpolation::Nearest, ..options };
//! assert_eq!(lut.warp(&view, &nearest)?, [10, 30, 60, 7]); // halves to even
//! # Ok(())
//! # }
//! ```

mod adjoint;
pub(crate) mod area;
mod blend;
pub mod direct;
pub(crate) mod error;
mod interpolation;
mod masked;
mod mode;
mod nearest;
mod options;
pub mod reference;

pub use blend::Bilinear;
pub use interpolation::Interpolation;
pub use options::WarpOptions;

use std::borrow::Cow;
use std::slice;

use crate::error::{Error, Result, ViewError, WarpError};
use crate::kernels::{CopyKernel, RowKernels, Source};
use crate::lut::Lut;
use crate::parallel::{self, Work};
use crate::table::{Band, Span, SpanKind, Table};
use crate::view::{ImageView, ImageViewMut, RowsMut, Sample, buffer};
use nearest::NearestPixels;
use options::border_of;

/// Several images go band by band through bands of at most so many cells: half a megabyte of the table, which a core's
/// cache holds meanwhile. Six images through a table of 32 MB took 1.3 times as long one after the other; where the
/// whole table fits the caches there was no difference.
const SHARED_CELLS: usize = 1 << 16;

impl Lut {
    /// Warps an image into a new one: row-major samples, `rows * columns * channels` of them.
    ///
    /// # Errors
    /// Those of [`Lut::warp_into`], and [`Error::OutOfMemory`].
    pub fn warp<T: Bilinear>(&self, image: &ImageView<'_, T>, options: &WarpOptions<T>) -> Result<Vec<T>> {
        self.check_images(slice::from_ref(image), options)?;
        let samples = self.rows() * self.columns() * image.channels();
        let mut out = buffer::filled("out", samples, T::default())?;
        let size = (self.columns(), self.rows());
        self.warp_into(image, &mut ImageViewMut::new(&mut out, size, image.channels())?, options)?;
        Ok(out)
    }

    /// Warps an image into a given one. The result does not depend on the number of threads.
    ///
    /// # Errors
    /// [`ViewError::SizeMismatch`], [`ViewError::OutputShape`], [`ViewError::BorderChannels`], [`WarpError::BorderMode`] and
    /// [`ThreadsError::Zero`](crate::error::ThreadsError::Zero), all before anything is written; so are
    /// [`IsaError`](crate::error::IsaError), and of area [`LutError::AreaSize`](crate::error::LutError::AreaSize) and
    /// [`Error::OutOfMemory`].
    pub fn warp_into<T: Bilinear>(
        &self,
        image: &ImageView<'_, T>,
        out: &mut ImageViewMut<'_, T>,
        options: &WarpOptions<T>,
    ) -> Result<()> {
        self.warp_many_into(slice::from_ref(image), slice::from_mut(out), options)
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
        self.warp_many_nearest_into(slice::from_ref(image), slice::from_mut(out), options)
    }

    /// Warps several images at once, the i-th into the i-th output: a batch, or the planes of planar images. All have
    /// the same number of channels; threads share out all of their rows.
    ///
    /// For planes, which are images of one channel, `options.border_value` may have one value for each plane of a
    /// picture: plane i gets value i modulo their number.
    ///
    /// # Errors
    /// Those of [`Lut::warp_into`], [`WarpError::ImageCount`] and [`WarpError::MixedChannels`].
    pub fn warp_many_into<T: Bilinear>(
        &self,
        images: &[ImageView<'_, T>],
        outs: &mut [ImageViewMut<'_, T>],
        options: &WarpOptions<T>,
    ) -> Result<()> {
        if options.interpolation == Interpolation::Area {
            let border = check(self, images, outs, options)?;
            return T::area(self, images, outs, &border, options);
        }
        run(self, images, outs, options, WarpOptions::kernels)
    }

    /// [`Lut::warp_many_into`] with nearest for samples of any kind, as [`Lut::warp_nearest_into`].
    ///
    /// # Errors
    /// Those of [`Lut::warp_many_into`].
    pub fn warp_many_nearest_into<T: Sample>(
        &self,
        images: &[ImageView<'_, T>],
        outs: &mut [ImageViewMut<'_, T>],
        options: &WarpOptions<T>,
    ) -> Result<()> {
        run(self, images, outs, options, WarpOptions::nearest_kernels)
    }

    /// Whether images and options fit this table and each other: what a warp checks first.
    ///
    /// # Errors
    /// [`WarpError::ImageCount`], [`ViewError::SizeMismatch`], [`WarpError::MixedChannels`],
    /// [`ViewError::BorderChannels`], [`WarpError::BorderMode`] and [`ThreadsError::Zero`](crate::error::ThreadsError::Zero).
    pub fn check_images<T: Copy>(&self, images: &[ImageView<'_, T>], options: &WarpOptions<T>) -> Result<()> {
        let [first, ..] = images else { return Err(Error::Warp(WarpError::ImageCount { images: 0, outs: 0 })) };
        let source = self.source_size();
        let expected = (source.0 as usize, source.1 as usize);
        for image in images {
            if (image.width(), image.height()) != expected {
                return Err(Error::View(ViewError::SizeMismatch { expected, got: (image.width(), image.height()) }));
            }
            if image.channels() != first.channels() {
                return Err(Error::Warp(WarpError::MixedChannels {
                    expected: first.channels(),
                    got: image.channels(),
                }));
            }
        }
        options.check_border(first.channels(), images.len())?;
        options.check_border_mode(self.border_mode())?;
        options.threads_for(0, 0).map(drop)
    }
}

/// Whether images, options and outputs fit the table and each other; the border value of each channel or plane.
fn check<'a, T: Sample>(
    lut: &Lut,
    images: &[ImageView<'_, T>],
    outs: &[ImageViewMut<'_, T>],
    options: &'a WarpOptions<T>,
) -> Result<Cow<'a, [T]>> {
    lut.check_images(images, options)?;
    if images.len() != outs.len() {
        return Err(Error::Warp(WarpError::ImageCount { images: images.len(), outs: outs.len() }));
    }
    let expected = (lut.rows(), lut.columns(), images[0].channels());
    if let Some(out) = outs.iter().find(|out| out.shape() != expected) {
        return Err(Error::View(ViewError::OutputShape { expected, got: out.shape() }));
    }
    options.border(images[0].channels(), images.len())
}

/// [`WarpOptions::kernels`] or [`WarpOptions::nearest_kernels`].
type ChooseFn<T> = fn(&WarpOptions<T>, &[ImageView<'_, T>]) -> Result<RowKernels<T>>;

fn run<T: Sample>(
    lut: &Lut,
    images: &[ImageView<'_, T>],
    outs: &mut [ImageViewMut<'_, T>],
    options: &WarpOptions<T>,
    choose: ChooseFn<T>,
) -> Result<()> {
    let border = check(lut, images, outs, options)?;
    let kernels = choose(options, images)?;
    let (rows, columns, channels) = (lut.rows(), lut.columns(), images[0].channels());
    let threads = options.threads_for(rows * columns * images.len(), channels)?;
    let pixels = match kernels.copy {
        Some(kernel) => Some((kernel, lut.derived(|table| NearestPixels::new(options.isa()?, table, threads))?)),
        None => None,
    };
    let source = |index: usize| options.source(lut, &images[index], border_of(&border, channels, index));
    let engine = Engine { table: lut.table(), kernels: &kernels, pixels };
    let planes = if kernels.planes.is_some() { PLANES } else { 1 };
    let even = parallel::rows_per_band(rows * images.len(), columns, threads);
    let shared = if images.len() > 1 { SHARED_CELLS.div_ceil(columns) } else { rows };
    let band_rows = even.min(shared).min(rows);
    if band_rows == rows {
        let together = Work::warp(rows * columns, channels * size_of::<T>()).pieces_together().next_multiple_of(planes);
        parallel::for_each(threads, outs.chunks_mut(together).enumerate(), |(job, outs)| {
            for (index, outs) in (job * together..).step_by(planes).zip(outs.chunks_mut(planes)) {
                let mut outs = outs.iter_mut();
                engine.warp_band(index, source, 0, Planes::of(|| outs.next().map(ImageViewMut::rows)));
            }
            Ok(())
        })
    } else {
        // band by band through all images: they share the band of the table while the caches hold it
        let mut bands = buffer::collected("out", outs.iter_mut().map(|out| out.bands(band_rows)))?;
        let chunks = bands.len().div_ceil(planes);
        let jobs = (0..).map_while(|job| {
            let (index, mut first) = (job % chunks * planes, 0);
            let mut chunk = bands[index..].iter_mut().take(planes);
            let rows = Planes::of(|| {
                let (row, rows) = chunk.next()?.next()?;
                first = row;
                Some(rows)
            });
            rows.0[0].is_some().then_some((index, first, rows))
        });
        parallel::for_each(threads, jobs, |(index, first, rows)| {
            engine.warp_band(index, source, first, rows);
            Ok(())
        })
    }
}

/// So many planes are blended at once, from one reading of the table. More would compete for the same few places of a
/// core's own cache: planes often lie a power of two of bytes apart, and so do the rows of each.
const PLANES: usize = 4;

/// Rows of up to so many planes.
struct Planes<R>([Option<R>; PLANES]);

impl<R> Planes<R> {
    /// What `next` gives, as long as it gives something.
    fn of(mut next: impl FnMut() -> Option<R>) -> Self {
        let mut planes = [const { None }; PLANES];
        for plane in &mut planes {
            *plane = next();
            if plane.is_none() {
                break;
            }
        }
        Self(planes)
    }
}

/// Where most cells are outside, the border value goes into so many bytes at once and the others are written over it:
/// 64 KiB, which a core's own cache holds meanwhile. The C library's memset then does not read what it overwrites; the
/// same bytes in pieces of half a row took three times as long.
const FILL_BYTES: usize = 1 << 16;

/// What fills rows from a table.
struct Engine<'a, T> {
    table: &'a Table,
    kernels: &'a RowKernels<T>,
    pixels: Option<(CopyKernel<T>, &'a NearestPixels)>,
}

impl<T: Sample> Engine<'_, T> {
    /// Fills neighbouring rows of an output, of which the first is row `first` of the table, or of as many outputs as
    /// there are `rows`; `source` gives the image of the `index`-th and those that follow.
    fn warp_band<'s>(
        &self,
        index: usize,
        source: impl Fn(usize) -> Source<'s, T>,
        first: usize,
        rows: Planes<RowsMut<'_, T>>,
    ) where
        T: 's,
    {
        match (rows.0, self.kernels.planes) {
            ([Some(one), Some(two), Some(three), Some(four)], Some(kernel)) => {
                let sources = [0, 1, 2, 3].map(|plane| source(index + plane));
                self.warp_rows(first, [one, two, three, four], &sources, |_, span, cells| {
                    kernel(&sources, span.taps, cells);
                });
            }
            (planes, _) => {
                for (index, rows) in (index..).zip(planes.into_iter().flatten()) {
                    let source = source(index);
                    self.warp_rows(first, [rows], slice::from_ref(&source), |band, span, [cells]| match self.pixels {
                        Some((copy, pixels)) => copy(&source, pixels.of(self.table, band, span), cells),
                        None => (self.kernels.inside)(&source, span.taps, cells),
                    });
                }
            }
        }
    }

    /// Fills neighbouring rows of the outputs, of which the first is row `first` of the table; what is inside by `inside`.
    fn warp_rows<const N: usize>(
        &self,
        mut first: usize,
        mut rows: [RowsMut<'_, T>; N],
        sources: &[Source<'_, T>],
        inside: impl Fn(&Band<'_>, &Span<'_>, [&mut [T]; N]),
    ) {
        let row_bytes = self.table.columns() * sources[0].channels() * size_of::<T>();
        let piece_rows = (FILL_BYTES / row_bytes).max(1);
        while rows[0].remaining() > 0 {
            let band = self.table.band(first);
            let end = band.rows.end.min(first + piece_rows.min(rows[0].remaining()));
            let mostly_outside = 2 * band.cells_with_taps(first..end) < (end - first) * self.table.columns();
            let filled = mostly_outside
                && rows
                    .iter_mut()
                    .zip(sources)
                    .all(|(rows, source)| rows.flat(end - first).map(|cells| source.fill_border(cells)).is_some());
            for row in first..end {
                let cells = rows.each_mut().map(|rows| rows.next().unwrap_or_default());
                warp_spans(band.spans(row), sources, cells, self.kernels, filled, |span, cells| {
                    inside(&band, span, cells);
                });
            }
            first = end;
        }
    }
}

/// Fills a row of each output, span by span: those inside by `inside`, those outside only if not `filled`.
fn warp_spans<'a, T: Sample, const N: usize>(
    spans: impl Iterator<Item = Span<'a>>,
    sources: &[Source<'_, T>],
    mut rows: [&mut [T]; N],
    kernels: &RowKernels<T>,
    filled: bool,
    inside: impl Fn(&Span<'_>, [&mut [T]; N]),
) {
    let channels = sources[0].channels();
    for span in spans {
        let own = span.first * channels..(span.first + span.cells) * channels;
        let cells = rows.each_mut().map(|row| &mut row[own.clone()]);
        match span.kind {
            SpanKind::Outside if filled => {}
            SpanKind::Outside => cells.into_iter().zip(sources).for_each(|(cells, source)| source.fill_border(cells)),
            SpanKind::Inside => inside(&span, cells),
            SpanKind::Halo if sources[0].keeps() => {}
            SpanKind::Rim | SpanKind::Halo => {
                cells.into_iter().zip(sources).for_each(|(cells, source)| (kernels.edge)(source, span.taps, cells));
            }
        }
    }
}
