//! One picture of all cameras, in one pass over the output.

use super::pieces::{ONE, Piece};
use super::{RigLut, WHAT};
use crate::error::{Error, Result, RigError, ViewError, WarpError};
use crate::kernels::{RowKernels, Source};
use crate::lut::Lut;
use crate::parallel;
use crate::table::{BorderMode, Span};
use crate::view::{F16, ImageView, ImageViewMut, Sample, buffer};
use crate::warp::{Bilinear, Interpolation, WarpOptions};

/// Cells of a seam that are mixed at a time: of three channels of 8 bits they are 192 bytes for each camera, which no
/// other work drives out of the core's own cache.
const CELLS_AT_ONCE: usize = 64;

/// The middle of the floats between which there is 1.
const WHOLE: f32 = 1.5 * (1u32 << 23) as f32;

/// Samples that can be mixed and brightened.
pub trait Mix: Sample {
    /// The sum of samples by weights in 1/32768, rounded.
    fn mix(samples: impl Iterator<Item = (Self, u16)>) -> Self;

    /// The sample as a number, if it is above 0 and no end of an integer type's range.
    fn measured(self) -> Option<f64>;

    /// The sample times a factor, rounded and kept to what the type can hold.
    fn brightened(self, gain: f32) -> Self;
}

macro_rules! mix_integers {
    ($($type:ty: $sum:ty),*) => {$(
        impl Mix for $type {
            #[inline(always)]
            fn mix(samples: impl Iterator<Item = (Self, u16)>) -> Self {
                let sum: $sum = samples.map(|(sample, weight)| <$sum>::from(sample) * <$sum>::from(weight)).sum();
                ((sum + (ONE as $sum >> 1)) >> ONE.ilog2()) as Self
            }

            fn measured(self) -> Option<f64> {
                (self > 0 && self < Self::MAX).then_some(f64::from(self))
            }

            #[inline(always)]
            fn brightened(self, gain: f32) -> Self {
                // bound first: below 2^22 adding 1.5 * 2^23 rounds to a whole number, ties to even, and leaves it in the
                // lowest bits. `round_ties_even` is a call where there is no SSE4.1: 16 ms of 22 for 5.8 million samples
                let bound = (f32::from(self) * gain).clamp(f32::from(Self::MIN), f32::from(Self::MAX));
                (bound + WHOLE).to_bits().wrapping_sub(WHOLE.to_bits()) as Self
            }
        }
    )*};
}
mix_integers!(u8: u32, u16: u32, i8: i32, i16: i32);

macro_rules! mix_floats {
    ($($type:ty: $sum:ty),*) => {$(
        impl Mix for $type {
            #[inline(always)]
            fn mix(samples: impl Iterator<Item = (Self, u16)>) -> Self {
                let sum = samples.fold(0.0, |sum: $sum, (sample, weight)| {
                    sum + <$sum>::from(sample) * (<$sum>::from(weight) / ONE as $sum)
                });
                sum as Self
            }

            fn measured(self) -> Option<f64> {
                let value = f64::from(self);
                (value > 0.0 && value.is_finite()).then_some(value)
            }

            #[inline(always)]
            fn brightened(self, gain: f32) -> Self {
                self * <$type>::from(gain)
            }
        }
    )*};
}
mix_floats!(f32: f32, f64: f64);

impl Mix for F16 {
    #[inline(always)]
    fn mix(samples: impl Iterator<Item = (Self, u16)>) -> Self {
        Self::from_f32(f32::mix(samples.map(|(sample, weight)| (sample.to_f32(), weight))))
    }

    fn measured(self) -> Option<f64> {
        self.to_f32().measured()
    }

    #[inline(always)]
    fn brightened(self, gain: f32) -> Self {
        Self::from_f32(self.to_f32() * gain)
    }
}

/// Factors of the samples of [`CELLS_AT_ONCE`] cells of a camera, or none where all are 1.
type Gains<'a> = Option<&'a [f32]>;

impl RigLut {
    /// Makes one picture of the cameras' images, which are in the rig's order.
    ///
    /// Bilinear, cubic, Lanczos and area mix along seams. `gains`, if not empty, has a factor for each channel of each camera, by which
    /// its samples are multiplied first.
    ///
    /// # Errors
    /// [`WarpError::ImageCount`], [`ViewError::SizeMismatch`], [`WarpError::MixedChannels`],
    /// [`ViewError::OutputShape`], [`ViewError::BorderChannels`],
    /// [`ThreadsError::Zero`](crate::error::ThreadsError::Zero) and [`RigError::ImageCount`], [`RigError::GainCount`]
    /// and [`RigError::Gain`], all before anything is written; [`Error::OutOfMemory`].
    pub fn warp_into<T: Bilinear + Mix>(
        &self,
        images: &[ImageView<'_, T>],
        out: &mut ImageViewMut<'_, T>,
        options: &WarpOptions<T>,
        gains: &[f32],
    ) -> Result<()> {
        self.check(images, out, options)?;
        let channels = images[0].channels();
        self.check_gains(gains, channels)?;
        // repeated, so that samples and factors are two rows of one length, which compile to vectors
        let mut repeated = buffer::reserved(WHAT, gains.len() * CELLS_AT_ONCE)?;
        for gains in gains.chunks_exact(channels) {
            repeated.extend(std::iter::repeat_n(gains, CELLS_AT_ONCE).flatten().copied());
        }
        let size = CELLS_AT_ONCE * channels;
        let gains = |table: u8| repeated.chunks_exact(size).nth(self.cameras[usize::from(table)]);
        let mix = |piece: &Piece<'_>, scratch: &mut [T], fill: Fill<'_, T>, cells: &mut [T]| {
            mixed(piece, channels, gains, scratch, fill, cells);
        };
        match options.interpolation {
            Interpolation::Nearest => {
                self.pass(images, out, options, &options.nearest_kernels(images)?, &|piece, scratch, fill, cells| {
                    winner(piece, scratch, fill, cells);
                    brighten(cells, gains(piece.tables[0]));
                })
            }
            Interpolation::Bilinear | Interpolation::Cubic | Interpolation::Lanczos4 => {
                self.pass(images, out, options, &options.kernels(images)?, &mix)
            }
            Interpolation::Area => {
                let warp = |lut: &Lut, image: &ImageView<'_, T>, out: &mut ImageViewMut<'_, T>| {
                    lut.warp_into(image, out, options)
                };
                self.picture_by_picture(images, out, options, warp, &mix)
            }
        }
    }

    /// Nearest for samples of any kind; each cell takes the camera of its largest weight.
    ///
    /// # Errors
    /// Those of [`RigLut::warp_into`].
    pub fn warp_nearest_into<T: Sample>(
        &self,
        images: &[ImageView<'_, T>],
        out: &mut ImageViewMut<'_, T>,
        options: &WarpOptions<T>,
    ) -> Result<()> {
        self.check(images, out, options)?;
        self.pass(images, out, options, &options.nearest_kernels(images)?, &winner)
    }

    /// The commonest id of each cell, of the camera of its largest weight.
    ///
    /// # Errors
    /// Those of [`RigLut::warp_into`] and of [`Lut::warp_many_mode_into`].
    pub fn warp_mode_into<T: Sample + Ord>(
        &self,
        images: &[ImageView<'_, T>],
        out: &mut ImageViewMut<'_, T>,
        options: &WarpOptions<T>,
    ) -> Result<()> {
        self.check(images, out, options)?;
        let warp = |lut: &Lut, image: &ImageView<'_, T>, out: &mut ImageViewMut<'_, T>| {
            lut.warp_many_mode_into(std::slice::from_ref(image), std::slice::from_mut(out), options)
        };
        self.picture_by_picture(images, out, options, warp, &winner)
    }

    /// Whether images, output and options fit the table and each other.
    fn check<T: Sample>(
        &self,
        images: &[ImageView<'_, T>],
        out: &ImageViewMut<'_, T>,
        options: &WarpOptions<T>,
    ) -> Result<()> {
        self.check_images(images)?;
        options.border(images[0].channels(), 1)?;
        if let Some(got) = options.border_mode.filter(|&mode| mode != BorderMode::Constant) {
            return Err(Error::Warp(WarpError::BorderMode { built: BorderMode::Constant.name(), got: got.name() }));
        }
        options.threads_for(0, 0)?;
        let expected = (self.rows(), self.columns(), images[0].channels());
        if out.shape() == expected {
            Ok(())
        } else {
            Err(Error::View(ViewError::OutputShape { expected, got: out.shape() }))
        }
    }

    /// Whether there is an image of the right size for each camera, all of one number of channels.
    pub(super) fn check_images<T: Sample>(&self, images: &[ImageView<'_, T>]) -> Result<()> {
        if images.len() != self.cameras() {
            return Err(Error::Rig(RigError::ImageCount { got: images.len(), cameras: self.cameras() }));
        }
        for (camera, image) in images.iter().enumerate() {
            let (width, height) = self.source_size(camera);
            let expected = (width as usize, height as usize);
            if (image.width(), image.height()) != expected {
                return Err(Error::View(ViewError::SizeMismatch { expected, got: (image.width(), image.height()) }));
            }
            if image.channels() != images[0].channels() {
                return Err(Error::Warp(WarpError::MixedChannels {
                    expected: images[0].channels(),
                    got: image.channels(),
                }));
            }
        }
        Ok(())
    }

    /// Whether there is a gain for each channel of each camera, or none at all.
    pub(super) fn check_gains(&self, gains: &[f32], channels: usize) -> Result<()> {
        if !gains.is_empty() && gains.len() != channels * self.cameras() {
            return Err(Error::Rig(RigError::GainCount { got: gains.len(), cameras: self.cameras(), channels }));
        }
        match gains.iter().find(|gain| !(0.0..=1e3).contains(*gain)) {
            Some(&got) => Err(Error::Rig(RigError::Gain { got })),
            None => Ok(()),
        }
    }

    /// One pass: every cell of one camera straight from its taps into the output.
    fn pass<T: Sample>(
        &self,
        images: &[ImageView<'_, T>],
        out: &mut ImageViewMut<'_, T>,
        options: &WarpOptions<T>,
        kernels: &RowKernels<T>,
        compose: &(impl Fn(&Piece<'_>, &mut [T], Fill<'_, T>, &mut [T]) + Sync),
    ) -> Result<()> {
        let channels = images[0].channels();
        let border = options.border(channels, 1)?;
        let sources = buffer::collected(
            WHAT,
            (self.cameras.iter().zip(&self.tables)).map(|(&camera, lut)| options.source(lut, &images[camera], &border)),
        )?;
        self.by_pieces(out, options, &sources[0], compose, |row| {
            let mut rows: Vec<_> = (self.tables.iter().zip(&sources))
                .map(|(lut, source)| RowOf { spans: lut.table().row(row), span: None, source, kernels })
                .collect();
            move |table: u8, first, cells: &mut [T]| rows[usize::from(table)].fill(first, cells)
        })
    }

    /// For interpolations that look at more than a row: each camera's picture as a whole, then one of all.
    fn picture_by_picture<T: Sample>(
        &self,
        images: &[ImageView<'_, T>],
        out: &mut ImageViewMut<'_, T>,
        options: &WarpOptions<T>,
        warp: impl Fn(&Lut, &ImageView<'_, T>, &mut ImageViewMut<'_, T>) -> Result<()>,
        compose: &(impl Fn(&Piece<'_>, &mut [T], Fill<'_, T>, &mut [T]) + Sync),
    ) -> Result<()> {
        let channels = images[0].channels();
        let (columns, samples) = (self.columns(), self.rows() * self.columns() * channels);
        let border = options.border(channels, 1)?;
        let mut whole = buffer::reserved(WHAT, self.cameras())?;
        for (lut, &camera) in self.shown()?.iter().zip(&self.cameras) {
            let mut picture = buffer::filled(WHAT, samples, T::default())?;
            let mut view = ImageViewMut::new(&mut picture, (columns, self.rows()), channels)?;
            warp(lut, &images[camera], &mut view)?;
            whole.push(picture);
        }
        self.by_pieces(out, options, &Source::new(&images[0], &border), compose, |row| {
            let whole = &whole;
            move |table: u8, first, cells: &mut [T]| {
                let at = (row * columns + first) * channels;
                cells.copy_from_slice(&whole[usize::from(table)][at..at + cells.len()]);
            }
        })
    }

    /// Goes through the pieces of all rows: `fill_of` a row fills cells of one camera, `compose` makes of them what is
    /// shown, and where nobody sees the road there is the border value of `source`.
    fn by_pieces<T: Sample, F: FnMut(u8, usize, &mut [T])>(
        &self,
        out: &mut ImageViewMut<'_, T>,
        options: &WarpOptions<T>,
        source: &Source<'_, T>,
        compose: &(impl Fn(&Piece<'_>, &mut [T], Fill<'_, T>, &mut [T]) + Sync),
        fill_of: impl Fn(usize) -> F + Sync,
    ) -> Result<()> {
        let channels = source.channels();
        let threads = options.threads_for(self.rows() * self.columns(), channels)?;
        let band_rows = parallel::rows_per_band(self.rows(), self.columns(), threads);
        parallel::for_each(threads, out.bands(band_rows), |(first, band)| {
            let mut scratch = buffer::filled(WHAT, CELLS_AT_ONCE * channels * self.cameras(), T::default())?;
            for (row, cells) in (first..).zip(band) {
                let mut fill = fill_of(row);
                for piece in self.pieces.row(row) {
                    let cells = &mut cells[piece.first * channels..(piece.first + piece.cells) * channels];
                    if piece.tables.is_empty() {
                        source.fill_border(cells);
                    } else {
                        compose(&piece, &mut scratch, &mut fill, cells);
                    }
                }
            }
            Ok(())
        })
    }
}

/// A row of one camera's table, from left to right.
struct RowOf<'a, T: Sample, I: Iterator<Item = Span<'a>>> {
    spans: I,
    span: Option<Span<'a>>,
    source: &'a Source<'a, T>,
    kernels: &'a RowKernels<T>,
}

impl<'a, T: Sample, I: Iterator<Item = Span<'a>>> RowOf<'a, T, I> {
    /// Fills whole cells, the first of which is that of column `first`; no smaller one than before.
    fn fill(&mut self, mut first: usize, mut cells: &mut [T]) {
        let channels = self.source.channels();
        while !cells.is_empty() {
            let span = match self.span.take() {
                Some(span) if span.first + span.cells > first => span,
                _ => {
                    self.span = self.spans.next();
                    debug_assert!(self.span.is_some(), "a row's spans are as many cells as the row has");
                    if self.span.is_none() {
                        return self.source.fill_border(cells);
                    }
                    continue;
                }
            };
            let skip = first - span.first;
            let count = (span.cells - skip).min(cells.len() / channels);
            let (own, rest) = std::mem::take(&mut cells).split_at_mut(count * channels);
            let taps = if span.taps.is_empty() { span.taps } else { &span.taps[skip..skip + count] };
            self.kernels.fill(span.kind, self.source, taps, own);
            self.span = Some(span);
            (first, cells) = (first + count, rest);
        }
    }
}

/// Fills the cells of one camera's table from a column on.
type Fill<'a, T> = &'a mut dyn FnMut(u8, usize, &mut [T]);

/// A piece of the camera of the largest weight, as it is.
fn winner<T>(piece: &Piece<'_>, _: &mut [T], fill: Fill<'_, T>, cells: &mut [T]) {
    fill(piece.tables[0], piece.first, cells);
}

/// A piece of all its cameras, brightened by the gains of their tables and mixed by their weights.
fn mixed<'a, T: Mix>(
    piece: &Piece<'_>,
    channels: usize,
    gains: impl Fn(u8) -> Gains<'a>,
    scratch: &mut [T],
    fill: Fill<'_, T>,
    cells: &mut [T],
) {
    if let [table] = *piece.tables {
        fill(table, piece.first, cells);
        return brighten(cells, gains(table));
    }
    let size = CELLS_AT_ONCE * channels;
    for (part, cells) in cells.chunks_mut(size).enumerate() {
        let skip = part * CELLS_AT_ONCE;
        for (&table, own) in piece.tables.iter().zip(scratch.chunks_mut(size)) {
            let own = &mut own[..cells.len()];
            fill(table, piece.first + skip, own);
            brighten(own, gains(table));
        }
        let weights = |place: usize| &piece.weights_of(place).expect("of several")[skip..];
        if let [_, _] = piece.tables {
            let (one, other) = scratch.split_at(size);
            let weights = weights(0).iter().zip(weights(1));
            let pixels = one.chunks_exact(channels).zip(other.chunks_exact(channels));
            for ((cell, (one, other)), (&w, &v)) in cells.chunks_exact_mut(channels).zip(pixels).zip(weights) {
                for (sample, (&a, &b)) in cell.iter_mut().zip(one.iter().zip(other)) {
                    *sample = T::mix([(a, w), (b, v)].into_iter());
                }
            }
        } else {
            for (index, sample) in cells.iter_mut().enumerate() {
                let of = |place: usize| (scratch[place * size + index], weights(place)[index / channels]);
                *sample = T::mix((0..piece.tables.len()).map(of));
            }
        }
    }
}

/// Multiplies samples, the first of which is a cell's first, by their factors.
fn brighten<T: Mix>(cells: &mut [T], gains: Gains<'_>) {
    let Some(gains) = gains else { return };
    for cells in cells.chunks_mut(gains.len()) {
        cells.iter_mut().zip(gains).for_each(|(sample, &gain)| *sample = sample.brightened(gain));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn brightened_samples_are_rounded_to_even_and_kept_to_their_type() {
        for gain in [0.0, 1e-3, 0.25, 0.5, 0.75, 1.0, 1.125, 1.5, 2.0, 3.3, 1e3] {
            let exact = |sample: f32| (sample * gain).round_ties_even();
            (0..=u8::MAX).for_each(|x| assert_eq!(x.brightened(gain), exact(x.into()) as u8, "{x} x {gain}"));
            (i8::MIN..=i8::MAX).for_each(|x| assert_eq!(x.brightened(gain), exact(x.into()) as i8, "{x} x {gain}"));
            (0..=u16::MAX).for_each(|x| assert_eq!(x.brightened(gain), exact(x.into()) as u16, "{x} x {gain}"));
            (i16::MIN..=i16::MAX).for_each(|x| assert_eq!(x.brightened(gain), exact(x.into()) as i16, "{x} x {gain}"));
        }
    }
}
