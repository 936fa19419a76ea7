//! The transpose of area's levels: what boxes got goes to their pixels.

use std::ops::Range;

use super::gather::{Cells, Gather, Interleaved};
use super::transposed::{Transposed, WHAT, Weight};
use crate::error::Result;
use crate::isa::{self, Body, Isa};
use crate::parallel;
use crate::view::{PointSample, buffer};
use crate::warp::area::plan::{Plan, RipLevel};

/// The sums of `N` channels of all entries of the levels.
pub(super) struct LevelSums<'a, const N: usize> {
    levels: &'a [RipLevel],
    sums: Vec<f64>,
}

impl<'a, const N: usize> LevelSums<'a, N> {
    /// Gathers them; threads share the rows.
    pub(super) fn new<T: PointSample, W: Weight>(
        plan: &'a Plan,
        transposed: &Transposed<W>,
        cells: Cells<'_, T>,
        (isa, threads): (Isa, usize),
    ) -> Result<Self> {
        let mut sums = buffer::zeroed(WHAT, entries(plan) * N)?;
        let mut rest = &mut *sums;
        let rows = plan.levels.iter().enumerate().flat_map(|(index, level)| {
            let row_length = level.width as usize * N;
            let own;
            (own, rest) = std::mem::take(&mut rest).split_at_mut(row_length * level.columns.len());
            own.chunks_mut(row_length).enumerate().map(move |(row, sums)| (1 + index, row, sums))
        });
        parallel::for_each(threads, rows, |(plane, row, sums)| {
            let put = Interleaved { row: sums, channels: N, first: 0 };
            isa::run(isa, Gather::<_, _, _, N> { looks: transposed.row(plane, row), cells, put });
            Ok(())
        })?;
        Ok(Self { levels: &plan.levels, sums })
    }

    /// Adds to row y of the source, `N` sums for each pixel, what boxes give to it.
    pub(super) fn add_to(&self, isa: Isa, y: usize, pixels: &mut [[f64; N]]) {
        let mut rest = self.sums.as_chunks::<N>().0;
        for level in self.levels {
            let own;
            (own, rest) = rest.split_at(level.width as usize * level.columns.len());
            let (log_step, log_step_y) = (RipLevel::log_step(level.kx), RipLevel::log_step(level.ky));
            let last = y >> log_step_y; // boxes overlap by half: that before has the row too, if it is higher than one pixel
            for row in last.saturating_sub(usize::from(level.ky > 0))..=last {
                let Some(row) = row.checked_sub(level.first_row as usize).filter(|&row| row < level.columns.len())
                else {
                    continue;
                };
                let sums = &own[row * level.width as usize..][..level.width as usize];
                let part = 1.0 / f64::from(1u32 << (level.kx + level.ky));
                for Range { start, end } in level.columns[row].0.clone() {
                    if start < end {
                        let kept = (start - level.first_column) as usize..(end - level.first_column) as usize;
                        let pixels = &mut pixels[(start as usize) << log_step..];
                        isa::run(
                            isa,
                            Spread { sums: &sums[kept], part, step: 1 << log_step, side: 1 << level.kx, pixels },
                        );
                    }
                }
            }
        }
    }
}

/// How many entries the levels of a plan have.
pub(super) fn entries(plan: &Plan) -> usize {
    plan.levels.iter().map(|level| level.columns.len() * level.width as usize).sum()
}

/// Adds the parts of neighbouring boxes to their pixels.
struct Spread<'a, const N: usize> {
    sums: &'a [[f64; N]],
    part: f64,
    step: usize,
    side: usize,
    pixels: &'a mut [[f64; N]],
}

impl<const N: usize> Body for Spread<'_, N> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        for (index, sums) in self.sums.iter().enumerate() {
            let given = sums.map(|sum| sum * self.part);
            for pixel in &mut self.pixels[index * self.step..][..self.side] {
                for channel in 0..N {
                    pixel[channel] += given[channel];
                }
            }
        }
    }
}
