//! The levels of an image: averages over boxes, where probes will look.

use std::ops::Range;

use super::plan::{Plan, RipLevel};
use super::scratch_lease::ScratchLease;
use crate::error::Result;
use crate::isa::Isa;
use crate::kernels::Average;
use crate::parallel;
use crate::view::buffer;
use crate::view::{ImageView, Sample};

/// So many rows of a level are made at once.
const CHUNK_ROWS: usize = 16;

/// The levels of one image, ready to be looked at.
pub(super) struct Levels<'a, T> {
    source: ImageView<'a, T>,
    levels: Vec<(&'a RipLevel, ImageView<'a, T>)>,
}

impl<'a, T: Sample + Average> Levels<'a, T> {
    /// Averages `image`; threads share the rows.
    pub(super) fn new(
        plan: &'a Plan,
        image: &ImageView<'a, T>,
        room: &'a mut ScratchLease<'_>,
        (isa, threads): (Isa, usize),
    ) -> Result<Self> {
        let channels = image.channels();
        let row = |level: &RipLevel| level.width as usize * channels;
        let mut rest = room.samples::<T>();
        let jobs = plan.levels.iter().flat_map(|level| {
            let own = rest.take(level.columns.len() * row(level));
            own.chunks(CHUNK_ROWS * row(level)).enumerate().map(move |(chunk, rows)| (level, chunk, rows))
        });
        parallel::for_each(threads, jobs, |(level, chunk, rows)| {
            let mut scratch = Scratch::new(isa, image, level)?;
            for (index, out) in (chunk * CHUNK_ROWS..).zip(rows.chunks(row(level))) {
                let out = out.written();
                for columns in level.columns[index].0.clone().into_iter().filter(|columns| !columns.is_empty()) {
                    let own =
                        [columns.start, columns.end].map(|column| (column - level.first_column) as usize * channels);
                    scratch.row(level.first_row as usize + index, columns, &mut out[own[0]..own[1]])?;
                }
            }
            Ok(())
        })?;
        // SAFETY: all rows of all levels were written.
        let mut rest = unsafe { room.written::<T>() };
        let views = plan.levels.iter().map(|level| {
            let own;
            (own, rest) = rest.split_at(level.columns.len() * row(level));
            Ok((level, ImageView::new(own, (level.width as usize, level.columns.len()), channels)?))
        });
        Ok(Self { source: *image, levels: views.collect::<Result<_>>()? })
    }

    /// The level of so large boxes, and its first column and row.
    pub(super) fn get(&self, kx: u8, ky: u8) -> (&ImageView<'a, T>, [u32; 2]) {
        let found = self.levels.iter().find(|(level, _)| (level.kx, level.ky) == (kx.into(), ky.into()));
        found.map_or((&self.source, [0; 2]), |(level, view)| (view, [level.first_column, level.first_row]))
    }
}

/// Buffers for making the rows of a level.
struct Scratch<'a, T> {
    isa: Isa,
    image: &'a ImageView<'a, T>,
    kx: u32,
    ky: u32,
    /// The row so far, and the next step of it; as long as they had to be, for most levels are made without them.
    row: Vec<T>,
    next: Vec<T>,
    /// Two for each step by which many rows are averaged.
    halves: Vec<[Vec<T>; 2]>,
}

impl<'a, T: Sample + Average> Scratch<'a, T> {
    fn new(isa: Isa, image: &'a ImageView<'a, T>, level: &RipLevel) -> Result<Self> {
        let row = || buffer::filled("area", image.width() * image.channels(), T::default());
        let halves = (3..=level.ky).map(|_| Ok([row()?, row()?])).collect::<Result<_>>()?;
        Ok(Self { isa, image, kx: level.kx, ky: level.ky, row: vec![], next: vec![], halves })
    }

    /// Writes the entries `columns` of a row of the level. Averaging over rows, then over columns, is averaging over
    /// boxes; integers halfway are rounded up in every other step, so that they do not drift.
    fn row(&mut self, row: usize, columns: Range<u32>, out: &mut [T]) -> Result<()> {
        let channels = self.image.channels();
        let step = RipLevel::log_step(self.kx);
        let pixels = (columns.start as usize) << step..(((columns.end - 1) as usize) << step) + (1 << self.kx);
        let all = pixels.start * channels..pixels.end * channels;
        let y = row << RipLevel::log_step(self.ky);
        if self.kx == 0 {
            down(self.isa, self.image, y, self.ky, &all, &mut self.halves, out);
            return Ok(());
        }
        let mut length = all.len();
        let source = |index: usize| &source_row(self.image, y + index)[all.clone()];
        let k = [self.kx, self.ky];
        let done = match self.ky {
            0 => T::boxes(self.isa, channels, k, &[source(0)], out),
            1 => T::boxes(self.isa, channels, k, &[source(0), source(1)], out),
            2 => T::boxes(self.isa, channels, k, &[source(0), source(1), source(2), source(3)], out),
            _ => false,
        };
        if done {
            return Ok(());
        }
        if self.ky > 0 {
            let row = first_of(&mut self.row, length)?;
            down(self.isa, self.image, y, self.ky, &all, &mut self.halves, row);
            if self.ky > 2 && T::boxes(self.isa, channels, k, &[row], out) {
                return Ok(());
            }
        }
        for k in 0..self.kx {
            let from = if k + self.ky == 0 { &source_row(self.image, y)[all.clone()] } else { &self.row[..length] };
            let up = (k + self.ky).is_multiple_of(2);
            if k + 1 == self.kx {
                // boxes side by side become boxes that overlap by half
                T::halve(self.isa, up, from, &from[channels..], &mut *out);
            } else {
                length /= 2;
                T::halve_pairs(self.isa, up, channels, from, first_of(&mut self.next, length)?);
                std::mem::swap(&mut self.row, &mut self.next);
            }
        }
        Ok(())
    }
}

/// So many samples, of a row that grows where it is shorter.
fn first_of<T: Sample>(row: &mut Vec<T>, length: usize) -> Result<&mut [T]> {
    if row.len() < length {
        buffer::resize("area", row, length, T::default())?;
    }
    Ok(&mut row[..length])
}

/// Averages `2^ky` rows of an image from row y on, the samples `range` of each.
fn down<T: Sample + Average>(
    isa: Isa,
    image: &ImageView<'_, T>,
    y: usize,
    ky: u32,
    range: &Range<usize>,
    halves: &mut [[Vec<T>; 2]],
    out: &mut [T],
) {
    let row = |index: usize| &source_row(image, y + index)[range.clone()];
    match (ky, halves) {
        (0, _) => out.copy_from_slice(row(0)),
        (1, _) => T::halve(isa, true, row(0), row(1), out),
        (2, _) => T::quarter(isa, true, [row(0), row(1), row(2), row(3)], out),
        (_, [[upper, lower], halves @ ..]) => {
            let (upper, lower) = (&mut upper[..out.len()], &mut lower[..out.len()]);
            down(isa, image, y, ky - 1, range, halves, upper);
            down(isa, image, y + (1 << (ky - 1)), ky - 1, range, halves, lower);
            T::halve(isa, (ky - 1).is_multiple_of(2), upper, lower, out);
        }
        (_, []) => unreachable!("one pair for each step beyond the second"),
    }
}

/// The samples of row y.
fn source_row<'a, T: Sample>(image: &ImageView<'a, T>, y: usize) -> &'a [T] {
    let start = image.row_start(y);
    &image.data()[start..start + image.width() * image.channels()]
}
