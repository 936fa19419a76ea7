//! The transpose of a warp: from the cells back to the pixels. What a gradient goes back through, and what splats a
//! bird's-eye view into the image.
//!
//! A warp is linear in the image: cell = sum of weight x pixel, and a constant of the border. Its transpose is pixel = sum of
//! weight x cell over the cells that look at the pixel. To scatter cells would need atomics, or an image for each thread, and
//! the sums would depend on the order; so the table is turned round once, and each pixel gathers its own cells, always in the
//! same order.

use std::slice;

use super::{Interpolation, WarpOptions};
use crate::error::{Error, Result, ViewError, WarpError};
use crate::lut::{Derivative, Lut};
use crate::parallel::{self, check_interrupt};
use crate::table::{ONE, SpanKind, Table, Tap, unframed};
use crate::view::{ImageView, ImageViewMut, PointSample, RowsMut, buffer};

/// What memory is asked for, in errors.
const WHAT: &str = "the transposed Lut";

/// A cell that looks at a pixel.
#[derive(Debug, Clone, Copy, Default)]
struct Look {
    /// `row * columns + column` of the cell.
    cell: u32,
    /// How much of the pixel is in it, Q30: the exact product of two Q15 fractions.
    weight: u32,
}

/// For each pixel of the source the cells that look at it, in the order of the cells.
#[derive(Debug)]
struct Transposed {
    /// Where each pixel's looks end.
    ends: Vec<u32>,
    looks: Vec<Look>,
}

/// The pixels that a cell takes its value from, with their weights, in Q30 as [`Look::weight`]; none outside the image.
type PixelsOf = fn(Tap, (i64, i64)) -> [((i64, i64), u32); 4];

/// The transpose of bilinear: 8 bytes for each pixel that a cell looks at, 4 for each pixel of the source.
struct OfBilinear(Transposed);

/// The transpose of nearest.
struct OfNearest(Transposed);

impl Derivative for OfBilinear {
    fn nbytes(&self) -> usize {
        self.0.nbytes()
    }
}

impl Derivative for OfNearest {
    fn nbytes(&self) -> usize {
        self.0.nbytes()
    }
}

/// The four pixels and their weights, as the kernels of floats have them.
fn bilinear(tap: Tap, (x, y): (i64, i64)) -> [((i64, i64), u32); 4] {
    let (fx, fy) = (tap.fx(), tap.fy());
    [
        ((x, y), (ONE - fx) * (ONE - fy)),
        ((x + 1, y), fx * (ONE - fy)),
        ((x, y + 1), (ONE - fx) * fy),
        ((x + 1, y + 1), fx * fy),
    ]
}

/// The nearest pixel, and three without weight.
fn nearest(tap: Tap, (x, y): (i64, i64)) -> [((i64, i64), u32); 4] {
    let near = (x + i64::from(tap.step_x()), y + i64::from(tap.step_y()));
    [(near, ONE * ONE), (near, 0), (near, 0), (near, 0)]
}

impl Transposed {
    /// # Errors
    /// [`Error::OutOfMemory`] and [`Error::Interrupted`].
    fn new(table: &Table, pixels_of: PixelsOf) -> Result<Self> {
        let (width, height) = table.source();
        let pixels = width as usize * height as usize;
        let mut ends: Vec<u32> = buffer::zeroed(WHAT, pixels)?;
        let mut count = 0usize;
        Self::each(table, pixels_of, |pixel, _| {
            ends[pixel] += 1; // a table has fewer cells than 2^32, and a cell looks at a pixel once
            count += 1;
        })?;
        if u32::try_from(count).is_err() {
            return Err(Error::OutOfMemory { what: WHAT, bytes: count * size_of::<Look>() });
        }
        let mut begin = 0;
        for end in &mut ends {
            (*end, begin) = (begin, begin + *end); // for now where its looks begin
        }
        let mut looks = buffer::filled(WHAT, count, Look::default())?;
        Self::each(table, pixels_of, |pixel, look| {
            looks[ends[pixel] as usize] = look;
            ends[pixel] += 1; // and, when all are there, where they end
        })?;
        Ok(Self { ends, looks })
    }

    /// Calls `found` with each pixel that a cell looks at, in the order of the cells.
    fn each(table: &Table, pixels_of: PixelsOf, mut found: impl FnMut(usize, Look)) -> Result<()> {
        let (width, height) = table.source();
        let (wide, high) = (i64::from(width), i64::from(height));
        for row in 0..table.rows() {
            check_interrupt()?;
            for span in table.row(row) {
                for (column, &tap) in (span.first..).zip(span.taps) {
                    let at = match span.kind {
                        SpanKind::Inside => (i64::from(tap.offset) % wide, i64::from(tap.offset) / wide),
                        SpanKind::Rim | SpanKind::Halo | SpanKind::Outside => unframed(tap.offset, width),
                    };
                    let cell = (row * table.columns() + column) as u32;
                    for ((x, y), weight) in pixels_of(tap, at) {
                        if weight != 0 && (0..wide).contains(&x) && (0..high).contains(&y) {
                            found((y * wide + x) as usize, Look { cell, weight });
                        }
                    }
                }
            }
        }
        Ok(())
    }

    fn nbytes(&self) -> usize {
        size_of_val(&*self.ends) + size_of_val(&*self.looks)
    }

    /// The looks of a pixel.
    #[inline]
    fn of(&self, pixel: usize) -> &[Look] {
        let begin = if pixel == 0 { 0 } else { self.ends[pixel - 1] };
        &self.looks[begin as usize..self.ends[pixel] as usize]
    }

    /// Fills rows of the source, from row `first` on.
    fn gather<T: PointSample>(&self, grad: &ImageView<'_, T>, first: usize, rows: RowsMut<'_, T>, sums: &mut [f64]) {
        let (channels, columns, contiguous) = (grad.channels(), grad.width(), grad.is_contiguous());
        for (row, pixels) in (first..).zip(rows) {
            let width = pixels.len() / channels;
            for (pixel, values) in (row * width..).zip(pixels.chunks_exact_mut(channels)) {
                sums.fill(0.0);
                for look in self.of(pixel) {
                    let cell = look.cell as usize;
                    let weight = f64::from(look.weight) * (1.0 / (1u64 << 30) as f64);
                    let from = match contiguous {
                        true => &grad.data()[cell * channels..(cell + 1) * channels], // no division
                        false => grad.pixel(cell % columns, cell / columns),
                    };
                    for (sum, value) in sums.iter_mut().zip(from) {
                        *sum += weight * value.to_f64();
                    }
                }
                for (value, sum) in values.iter_mut().zip(&*sums) {
                    *value = T::from_f64(*sum);
                }
            }
        }
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
        interpolation: Interpolation,
        threads: Option<usize>,
    ) -> Result<()> {
        self.warp_many_adjoint_into(slice::from_ref(grad), slice::from_mut(out), interpolation, threads)
    }

    /// [`Lut::warp_adjoint_into`] of several at once, the i-th into the i-th output. The first call turns the table round,
    /// which takes as long as some warps, and keeps that: 40 bytes a cell of bilinear, 8 of nearest, and 4 a pixel.
    ///
    /// # Errors
    /// [`WarpError::NoAdjoint`] for area; [`WarpError::ImageCount`], [`WarpError::MixedChannels`],
    /// [`ViewError::SizeMismatch`], [`ViewError::OutputShape`] and
    /// [`ThreadsError::Zero`](crate::error::ThreadsError::Zero), all before anything is written; [`Error::OutOfMemory`] and
    /// [`Error::Interrupted`].
    pub fn warp_many_adjoint_into<T: PointSample>(
        &self,
        grads: &[ImageView<'_, T>],
        outs: &mut [ImageViewMut<'_, T>],
        interpolation: Interpolation,
        threads: Option<usize>,
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
        let options = WarpOptions::<T> { threads, ..WarpOptions::default() };
        let threads = options.threads_for(width * height * grads.len(), channels)?;
        let transposed = match interpolation {
            Interpolation::Bilinear => &self.derived(|table| Ok(OfBilinear(Transposed::new(table, bilinear)?)))?.0,
            Interpolation::Nearest => &self.derived(|table| Ok(OfNearest(Transposed::new(table, nearest)?)))?.0,
            Interpolation::Area => {
                return Err(WarpError::NoAdjoint { got: interpolation.name() }.into());
            }
        };
        let band_rows = parallel::rows_per_band(height, width, threads);
        for (grad, out) in grads.iter().zip(outs) {
            parallel::for_each(threads, out.bands(band_rows), |(first, band)| {
                let mut sums = buffer::zeroed(WHAT, channels)?;
                transposed.gather(grad, first, band, &mut sums);
                Ok(())
            })?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        for interpolation in [Interpolation::Bilinear, Interpolation::Nearest] {
            for channels in [1, 3] {
                let (x, y) = (numbers(25 * 18 * channels, 389), numbers(1200 * channels, 577));
                let image = ImageView::new(&x, (25, 18), channels).unwrap();
                let grad = ImageView::new(&y, (40, 30), channels).unwrap();
                let options = WarpOptions { interpolation, ..WarpOptions::default() };
                let there = dot(&lut.warp(&image, &options).unwrap(), &y);
                let mut alone = None;
                for threads in [1, 2] {
                    let mut out = vec![7.0; x.len()];
                    let mut view = ImageViewMut::new(&mut out, (25, 18), channels).unwrap();
                    lut.warp_adjoint_into(&grad, &mut view, interpolation, Some(threads)).unwrap();
                    assert!((there - dot(&x, &out)).abs() < 1e-12 * there.abs().max(1.0), "{interpolation:?}");
                    assert_eq!(*alone.get_or_insert(out.clone()), out);
                }
            }
        }
    }

    #[test]
    fn wrong_sizes_are_refused_and_nothing_is_written() {
        let (lut, y) = (ragged(), numbers(1200, 577));
        let grad = ImageView::new(&y, (40, 30), 1).unwrap();
        let mut out = vec![7.0; 25 * 18];
        let mut call = |grad: &ImageView<'_, f64>, size, interpolation, threads| {
            let mut view = ImageViewMut::new(&mut out, size, 1).unwrap();
            lut.warp_adjoint_into(grad, &mut view, interpolation, Some(threads)).unwrap_err()
        };
        let small = ImageView::new(&y, (30, 40), 1).unwrap();
        let kind = Interpolation::Bilinear;
        assert!(matches!(
            call(&small, (25, 18), kind, 1),
            Error::View(ViewError::SizeMismatch { expected: (40, 30), .. })
        ));
        assert!(matches!(
            call(&grad, (18, 25), kind, 1),
            Error::View(ViewError::OutputShape { expected: (18, 25, 1), .. })
        ));
        assert!(matches!(call(&grad, (25, 18), kind, 0), Error::Threads(_)));
        assert!(matches!(call(&grad, (25, 18), Interpolation::Area, 1), Error::Warp(WarpError::NoAdjoint { .. })));
        assert!(out.iter().all(|&value| value == 7.0));
    }
}
