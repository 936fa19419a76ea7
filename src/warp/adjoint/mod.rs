//! The transpose of a warp: from the cells back to the pixels. What a gradient goes back through, and what splats a
//! bird's-eye view into the image.
//!
//! A warp is linear in the image: cell = sum of weight x pixel, and a constant of the border. Its transpose is pixel = sum of
//! weight x cell over the cells that look at the pixel. To scatter cells would need atomics, or an image for each thread, and
//! the sums would depend on the order; so the table is turned round once, and each pixel gathers its own cells, always in the
//! same order. Of area, entries of the levels gather cells, and pixels gather entries.

mod gather;
mod levels;
mod transposed;

use std::{array, iter, slice};

use super::area::looks::each_look;
use super::area::plan::Plan;
use super::{Interpolation, WarpOptions};
use crate::error::{Result, ViewError, WarpError};
use crate::isa::{self, Isa};
use crate::lut::{Derivative, Lut};
use crate::parallel;
use crate::view::{ImageView, ImageViewMut, PointSample, RowsMut, buffer};
use gather::{Cells, Gather, Interleaved, Pack, Planar, Put};
use levels::LevelSums;
use transposed::{Look, LooksOfRow, Transposed, WHAT, Weight, nearest, of_table};
pub(super) use transposed::{bilinear, existing, top_left};

/// The transpose of bilinear: 8 bytes for each pixel that a cell looks at, 8 for each that some cell does.
struct OfBilinear(Transposed<u32>);

/// The transpose of nearest.
struct OfNearest(Transposed<u32>);

/// The transpose of area: 12 bytes for each entry that a cell looks at.
struct OfArea(Transposed<f64>);

macro_rules! derivatives {
    ($($kind:ty),*) => {$(
        impl Derivative for $kind {
            fn nbytes(&self) -> usize {
                self.0.nbytes()
            }
        }
    )*};
}
derivatives!(OfBilinear, OfNearest, OfArea);

impl OfArea {
    fn new(lut: &Lut, plan: &Plan, isa: Isa) -> Result<Self> {
        let (width, height) = lut.source_size();
        let levels = plan.levels.iter().map(|level| [level.width as usize, level.columns.len()]);
        let planes: Vec<_> = iter::once([width as usize, height as usize]).chain(levels).collect();
        let transposed = Transposed::new(&planes, |found| {
            each_look((lut.table(), plan, isa), &mut |plane, at, (cell, weight)| {
                found(plane, at, Look { cell, weight })
            })
        })?;
        Ok(Self(transposed))
    }
}

impl Lut {
    /// The transpose of a warp of an image, from a value for each cell to one for each pixel of the source: the sum over
    /// the cells that look at it of the cell's value times the pixel's part in it. So `<warp(x), y> == <x, adjoint(y)>` for
    /// a border of 0, to the rounding of the sums. Sums are in f64; the result does not depend on the number of threads.
    ///
    /// # Errors
    /// Those of [`Lut::warp_many_adjoint_into`].
    pub fn warp_adjoint_into<T: PointSample>(
        &self,
        grad: &ImageView<'_, T>,
        out: &mut ImageViewMut<'_, T>,
        options: &WarpOptions<T>,
    ) -> Result<()> {
        self.warp_many_adjoint_into(slice::from_ref(grad), slice::from_mut(out), options)
    }

    /// [`Lut::warp_adjoint_into`] of several at once, the i-th into the i-th output; `options.border_value` is not looked
    /// at. The first call turns the table round, which takes as long as some warps, and keeps that: some 35 bytes a cell of
    /// bilinear, 12 of nearest, and of area more, the more pixels cells cover.
    ///
    /// # Errors
    /// [`WarpError::ImageCount`], [`WarpError::MixedChannels`], [`ViewError::SizeMismatch`], [`ViewError::OutputShape`]
    /// and [`ThreadsError::Zero`](crate::error::ThreadsError::Zero), all before anything is written;
    /// [`WarpError::NoAdjoint`] of cubic, Lanczos and borders that repeat the image, [`IsaError`](crate::error::IsaError),
    /// [`LutError::AreaSize`](crate::error::LutError::AreaSize) for area,
    /// [`Error::OutOfMemory`](crate::Error::OutOfMemory) and [`Error::Interrupted`](crate::Error::Interrupted).
    pub fn warp_many_adjoint_into<T: PointSample>(
        &self,
        grads: &[ImageView<'_, T>],
        outs: &mut [ImageViewMut<'_, T>],
        options: &WarpOptions<T>,
    ) -> Result<()> {
        let [first, ..] = grads else { return Err(WarpError::ImageCount { images: 0, outs: outs.len() }.into()) };
        if grads.len() != outs.len() {
            return Err(WarpError::ImageCount { images: grads.len(), outs: outs.len() }.into());
        }
        let (width, height) = self.source_size();
        let (width, height, channels) = (width as usize, height as usize, first.channels());
        for (grad, out) in grads.iter().zip(&*outs) {
            let (expected, got) = ((self.columns(), self.rows()), (grad.width(), grad.height()));
            if got != expected {
                return Err(ViewError::SizeMismatch { expected, got }.into());
            }
            if grad.channels() != channels {
                return Err(WarpError::MixedChannels { expected: channels, got: grad.channels() }.into());
            }
            let expected = (height, width, channels);
            if out.shape() != expected {
                return Err(ViewError::OutputShape { expected, got: out.shape() }.into());
            }
        }
        let isa = options.isa()?;
        let threads = options.threads_for(width * height * grads.len(), channels)?;
        let band_rows = parallel::rows_per_band(height, width, threads);
        let job = Job { width, isa, threads, band_rows };
        let edges = self.table().edges();
        if edges.mode.repeats() || edges.wraps {
            return Err(WarpError::NoAdjoint { got: edges.axes()[0].name() }.into());
        }
        match options.interpolation {
            Interpolation::Cubic | Interpolation::Lanczos4 => {
                Err(WarpError::NoAdjoint { got: options.interpolation.name() }.into())
            }
            Interpolation::Bilinear => {
                let table = &self.derived(|table| Ok(OfBilinear(of_table(table, bilinear)?)))?.0;
                job.run(table, None, grads, outs)
            }
            Interpolation::Nearest => {
                let table = &self.derived(|table| Ok(OfNearest(of_table(table, nearest)?)))?.0;
                job.run(table, None, grads, outs)
            }
            Interpolation::Area => {
                let plan = self.derived(|table| Plan::new(Isa::active()?, table))?;
                let table = &self.derived(|_| OfArea::new(self, plan, isa))?.0;
                job.run(table, Some(plan), grads, outs)
            }
        }
    }
}

/// Channels or planes that are gathered at once are one of these numbers: sixteen of float32 are a line of a cache.
const TOGETHER: [usize; 6] = [16, 8, 4, 3, 2, 1];

/// Calls a method for the number of channels or planes that are gathered at once.
macro_rules! together {
    ($count:expr, $job:ident.$method:ident($($argument:expr),*)) => {
        match $count {
            16 => $job.$method::<16, _, _>($($argument),*),
            8 => $job.$method::<8, _, _>($($argument),*),
            4 => $job.$method::<4, _, _>($($argument),*),
            3 => $job.$method::<3, _, _>($($argument),*),
            2 => $job.$method::<2, _, _>($($argument),*),
            _ => $job.$method::<1, _, _>($($argument),*),
        }
    };
}

/// The sums of levels take no more than this for each group of channels or planes, which gets smaller instead.
const MOST_LEVEL_BYTES: usize = 1 << 27;

/// How one call shares out its work.
struct Job {
    width: usize,
    isa: Isa,
    threads: usize,
    band_rows: usize,
}

impl Job {
    fn run<T: PointSample, W: Weight>(
        &self,
        transposed: &Transposed<W>,
        plan: Option<&Plan>,
        grads: &[ImageView<'_, T>],
        outs: &mut [ImageViewMut<'_, T>],
    ) -> Result<()> {
        let entry_bytes = plan.map_or(0, |plan| size_of::<f64>() * levels::entries(plan));
        let most = TOGETHER.into_iter().find(|count| count * entry_bytes <= MOST_LEVEL_BYTES).unwrap_or(1);
        let groups = |count: usize| {
            let mut first = 0;
            iter::from_fn(move || {
                let together = TOGETHER.into_iter().find(|&together| together <= most.min(count - first))?;
                first += together;
                Some((first - together, together))
            })
        };
        let table = (transposed, plan);
        let channels = grads[0].channels();
        let mut packed = vec![];
        if channels == 1 {
            for (first, count) in groups(grads.len()) {
                let (grads, outs) = (&grads[first..first + count], &mut outs[first..first + count]);
                together!(count, self.planes(table, grads, outs, &mut packed))?;
            }
            return Ok(());
        }
        for (grad, out) in grads.iter().zip(outs) {
            let data = if grad.is_contiguous() { grad.data() } else { self.pack::<1, _>(&[*grad], &mut packed)? };
            if plan.is_none() {
                self.all_channels(transposed, data, groups(channels), out)?;
                continue;
            }
            for (first, count) in groups(channels) {
                together!(count, self.channels(table, Cells { data, stride: channels, first }, out))?;
            }
        }
        Ok(())
    }

    /// Gathers all channels of an image row by row, without levels: cells and pixels of a row stay in the caches meanwhile.
    fn all_channels<T: PointSample, W: Weight>(
        &self,
        transposed: &Transposed<W>,
        data: &[T],
        groups: impl Iterator<Item = (usize, usize)> + Clone + Sync,
        out: &mut ImageViewMut<'_, T>,
    ) -> Result<()> {
        let (_, _, stride) = out.shape();
        parallel::for_each(self.threads, out.bands(self.band_rows), |(first, band)| {
            for (y, row) in (first..).zip(band) {
                row.fill(T::default());
                for (first, count) in groups.clone() {
                    together!(count, self.piece(transposed.row(0, y), Cells { data, stride, first }, row));
                }
            }
            Ok(())
        })
    }

    /// Gathers `N` neighbouring channels of a row.
    fn piece<const N: usize, T: PointSample, W: Weight>(
        &self,
        looks: LooksOfRow<'_, W>,
        cells: Cells<'_, T>,
        row: &mut [T],
    ) {
        let put = Interleaved { row, channels: cells.stride, first: cells.first };
        isa::run(self.isa, Gather::<_, _, _, N> { looks, cells, put });
    }

    /// Gathers `N` neighbouring channels of an image, with levels.
    fn channels<const N: usize, T: PointSample, W: Weight>(
        &self,
        (transposed, plan): (&Transposed<W>, Option<&Plan>),
        cells: Cells<'_, T>,
        out: &mut ImageViewMut<'_, T>,
    ) -> Result<()> {
        let rows = Rows::<W, N>::new(self, transposed, plan, cells)?;
        parallel::for_each(self.threads, out.bands(self.band_rows), |(first, band)| {
            let mut sums = rows.buffer()?;
            for (y, row) in (first..).zip(band) {
                rows.fill(y, cells, Interleaved { row, channels: cells.stride, first: cells.first }, &mut sums);
            }
            Ok(())
        })
    }

    /// Gathers `N` planes.
    fn planes<const N: usize, T: PointSample, W: Weight>(
        &self,
        (transposed, plan): (&Transposed<W>, Option<&Plan>),
        grads: &[ImageView<'_, T>],
        outs: &mut [ImageViewMut<'_, T>],
        packed: &mut Vec<T>,
    ) -> Result<()> {
        let planes: &[ImageView<'_, T>; N] = grads.first_chunk().expect("as many as are gathered");
        let outs: &mut [ImageViewMut<'_, T>; N] = outs.first_chunk_mut().expect("as many as are gathered");
        let direct = N == 1 && planes[0].is_contiguous();
        let data = if direct { planes[0].data() } else { self.pack(planes, packed)? };
        let cells = Cells { data, stride: N, first: 0 };
        let rows = Rows::<W, N>::new(self, transposed, plan, cells)?;
        let mut bands = outs.each_mut().map(|out| out.bands(self.band_rows));
        let bands = iter::from_fn(move || {
            let mut first = 0;
            let mut next = bands.each_mut().map(|bands| {
                let (row, rows) = bands.next()?;
                first = row;
                Some(rows)
            });
            next[0].is_some().then(|| (first, array::from_fn(|plane| next[plane].take().expect("planes are alike"))))
        });
        parallel::for_each(self.threads, bands, |(first, mut band): (usize, [RowsMut<'_, T>; N])| {
            let mut sums = rows.buffer()?;
            for y in first..first + band[0].remaining() {
                let mut of_planes = band.each_mut().map(|rows| rows.next().unwrap_or_default());
                if plan.is_none() {
                    of_planes.iter_mut().for_each(|row| row.fill(T::default()));
                }
                rows.fill(y, cells, Planar(of_planes), &mut sums);
            }
            Ok(())
        })
    }

    /// The samples of images side by side, those of the same place next to each other.
    fn pack<'a, const N: usize, T: PointSample>(
        &self,
        images: &[ImageView<'_, T>; N],
        packed: &'a mut Vec<T>,
    ) -> Result<&'a [T]> {
        let (row_length, rows) = (images[0].width() * images[0].channels(), images[0].height());
        if packed.len() < row_length * rows * N {
            *packed = buffer::zeroed(WHAT, row_length * rows * N)?;
        }
        let of_rows = packed[..row_length * rows * N].chunks_mut(row_length * N).enumerate();
        parallel::for_each(self.threads, of_rows, |(row, packed)| {
            let planes = images.map(|image| &image.data()[image.row_start(row)..][..row_length]);
            isa::run(self.isa, Pack { planes, packed });
            Ok(())
        })?;
        Ok(&packed[..row_length * rows * N])
    }
}

/// What fills rows of the source with the sums of `N` channels.
struct Rows<'a, W: Copy, const N: usize> {
    isa: Isa,
    transposed: &'a Transposed<W>,
    levels: Option<LevelSums<'a, N>>,
    width: usize,
}

impl<'a, W: Weight, const N: usize> Rows<'a, W, N> {
    fn new<T: PointSample>(
        job: &Job,
        transposed: &'a Transposed<W>,
        plan: Option<&'a Plan>,
        cells: Cells<'_, T>,
    ) -> Result<Self> {
        let levels = plan.map(|plan| LevelSums::new(plan, transposed, cells, (job.isa, job.threads))).transpose()?;
        Ok(Self { isa: job.isa, transposed, levels, width: job.width })
    }

    /// Room for the sums of a row, where levels give to them too.
    fn buffer(&self) -> Result<Vec<[f64; N]>> {
        let columns = if self.levels.is_some() { self.width } else { 0 };
        buffer::filled(WHAT, columns, [0.0; N])
    }

    /// Puts the sums of row y; without levels, only those of pixels that a cell looks at.
    fn fill<T: PointSample, P: Put<N>>(&self, y: usize, cells: Cells<'_, T>, mut put: P, sums: &mut [[f64; N]]) {
        let looks = self.transposed.row(0, y);
        let Some(levels) = &self.levels else {
            return isa::run(self.isa, Gather::<_, _, _, N> { looks, cells, put });
        };
        sums.fill([0.0; N]);
        let own = Interleaved { row: sums.as_flattened_mut(), channels: N, first: 0 };
        isa::run(self.isa, Gather::<_, _, _, N> { looks, cells, put: own });
        levels.add_to(self.isa, y, sums);
        sums.iter().enumerate().for_each(|(column, &sums)| put.put(column, sums));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Error;

    /// Cells inside, on rims, in the halo and outside; some at whole and at half pixels.
    fn ragged() -> Lut {
        let count = 40 * 30;
        let u: Vec<f64> = (0..count).map(|i| ((i * 37) % 256) as f64 * 0.125 - 3.0).collect();
        let v: Vec<f64> = (0..count).map(|i| ((i * 101) % 199) as f64 * 0.13 - 2.5).collect();
        Lut::from_maps(&u, &v, 40, (25, 18)).unwrap()
    }

    fn numbers(count: usize, factor: usize) -> Vec<f64> {
        (0..count).map(|i| ((i * factor) % 1009) as f64 / 500.0 - 1.0).collect()
    }

    fn dot(a: &[f64], b: &[f64]) -> f64 {
        a.iter().zip(b).map(|(x, y)| x * y).sum()
    }

    #[test]
    fn products_are_the_same() {
        let lut = ragged();
        for interpolation in [Interpolation::Bilinear, Interpolation::Nearest, Interpolation::Area] {
            for channels in [1, 3, 7] {
                let (x, y) = (numbers(25 * 18 * channels, 389), numbers(1200 * channels, 577));
                let image = ImageView::new(&x, (25, 18), channels).unwrap();
                let grad = ImageView::new(&y, (40, 30), channels).unwrap();
                let options = WarpOptions { interpolation, ..WarpOptions::default() };
                let there = dot(&lut.warp(&image, &options).unwrap(), &y);
                let mut alone = None;
                for (&isa, threads) in Isa::available().iter().flat_map(|isa| [(isa, 1), (isa, 2)]) {
                    let mut out = vec![7.0; x.len()];
                    let mut view = ImageViewMut::new(&mut out, (25, 18), channels).unwrap();
                    let options = WarpOptions { isa: Some(isa), threads: Some(threads), ..options.clone() };
                    lut.warp_adjoint_into(&grad, &mut view, &options).unwrap();
                    assert!((there - dot(&x, &out)).abs() < 1e-12 * there.abs().max(1.0), "{interpolation:?}");
                    assert_eq!(*alone.get_or_insert(out.clone()), out, "{isa:?}");
                }
            }
        }
    }

    #[test]
    fn planes_and_channels_together_are_as_each_alone() {
        let lut = ragged();
        let planes: Vec<Vec<f32>> =
            (0..23).map(|plane| numbers(1200, 577 + plane).into_iter().map(|y| y as f32).collect()).collect();
        let mixed: Vec<f32> = (0..1200 * 23).map(|i| planes[i % 23][i / 23]).collect();
        for interpolation in [Interpolation::Bilinear, Interpolation::Nearest, Interpolation::Area] {
            let options = |isa| WarpOptions { interpolation, isa: Some(isa), ..WarpOptions::default() };
            let alone: Vec<Vec<f32>> = (planes.iter())
                .map(|plane| {
                    let (grad, mut out) = (ImageView::new(plane, (40, 30), 1).unwrap(), vec![7.0; 25 * 18]);
                    let mut view = ImageViewMut::new(&mut out, (25, 18), 1).unwrap();
                    lut.warp_adjoint_into(&grad, &mut view, &options(Isa::Scalar)).unwrap();
                    out
                })
                .collect();
            for &isa in Isa::available() {
                let grads: Vec<_> = planes.iter().map(|plane| ImageView::new(plane, (40, 30), 1).unwrap()).collect();
                let mut together = vec![vec![7.0; 25 * 18]; 23];
                let mut views: Vec<_> =
                    together.iter_mut().map(|out| ImageViewMut::new(out, (25, 18), 1).unwrap()).collect();
                lut.warp_many_adjoint_into(&grads, &mut views, &options(isa)).unwrap();
                assert_eq!(together, alone, "{isa:?} {interpolation:?}");
                let mut out = vec![7.0; 25 * 18 * 23];
                let mut view = ImageViewMut::new(&mut out, (25, 18), 23).unwrap();
                lut.warp_adjoint_into(&ImageView::new(&mixed, (40, 30), 23).unwrap(), &mut view, &options(isa))
                    .unwrap();
                assert!(out.iter().enumerate().all(|(i, value)| *value == alone[i % 23][i / 23]), "{isa:?}");
            }
        }
    }

    #[test]
    fn wrong_sizes_are_refused_and_nothing_is_written() {
        let (lut, y) = (ragged(), numbers(1200, 577));
        let grad = ImageView::new(&y, (40, 30), 1).unwrap();
        let mut out = vec![7.0; 25 * 18];
        let mut call = |grad: &ImageView<'_, f64>, size, threads| {
            let mut view = ImageViewMut::new(&mut out, size, 1).unwrap();
            let options = WarpOptions { threads: Some(threads), ..WarpOptions::default() };
            lut.warp_adjoint_into(grad, &mut view, &options).unwrap_err()
        };
        let small = ImageView::new(&y, (30, 40), 1).unwrap();
        assert!(matches!(call(&small, (25, 18), 1), Error::View(ViewError::SizeMismatch { expected: (40, 30), .. })));
        assert!(matches!(call(&grad, (18, 25), 1), Error::View(ViewError::OutputShape { expected: (18, 25, 1), .. })));
        assert!(matches!(call(&grad, (25, 18), 0), Error::Threads(_)));
        assert!(out.iter().all(|&value| value == 7.0));
    }
}
