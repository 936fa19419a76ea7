//! How much a frame counts in a cell, and the loop that adds it.

use super::tile::{Layers, Value};
use crate::cpu::{self, Isa};

/// Resolutions are kept in 1/4096 pixel a cell.
const ONE_PIXEL: u32 = 1 << 12;

/// Coarser frames are left out, as if they did not see the cell: 16 cells to a pixel.
pub(super) const COARSEST: f64 = 1.0 / 16.0;

/// The same in 1/4096 pixel.
const LEAST: u32 = ONE_PIXEL / 16;

/// What a frame's whole weight is.
pub(super) const WHOLE: u32 = 1 << 16;

/// The weight of a frame by how it resolves the cell: its eighth power in Q31, level from one pixel a cell on.
///
/// All that resolve a cell share it, and where none does the best one wins by far: half the resolution counts 1/256.
#[inline(always)]
fn weight(resolution: u32, whole: u32) -> u64 {
    let square = u64::from(resolution.min(ONE_PIXEL)).pow(2); // Q24
    let fourth = (square * square) >> 17; // Q31
    let eighth = (fourth * fourth) >> 31;
    let weight = ((eighth * u64::from(whole)) >> 16).max(1);
    if resolution >= LEAST { weight } else { 0 }
}

/// Neighbouring cells of a row, and what a frame shows of them.
pub(super) struct Cells<'a, T> {
    pub(super) layers: Layers<'a, T>,
    pub(super) channels: usize,
    pub(super) values: &'a [T],
    /// Pixels a cell.
    pub(super) resolutions: &'a [f32],
    /// Of each cell the square of the distance, and which of them count.
    pub(super) distances: &'a [f64],
    pub(super) distance: (f64, f64),
    /// Of [`WHOLE`].
    pub(super) whole: u32,
    /// Room for numbers of the cells.
    pub(super) scratch: &'a mut [(u32, u64)],
}

impl<T: Value> Cells<'_, T> {
    /// Adds them; returns how many counted.
    pub(super) fn add(self, isa: Isa) -> usize {
        cpu::run(isa, self)
    }

    #[inline(always)]
    fn add_channels<const C: usize>(self) -> usize {
        let Self { layers, values, scratch, .. } = self;
        for (cell, &(_, weight)) in scratch.iter().enumerate() {
            layers.weights[cell] += weight;
            layers.counts[cell] += u32::from(weight > 0);
        }
        let channels = if C == 0 { self.channels } else { C };
        let numbers = (layers.totals.chunks_exact_mut(channels).zip(layers.sums.chunks_exact_mut(channels)))
            .zip(layers.squares.chunks_exact_mut(channels).zip(values.chunks_exact(channels)));
        for (((totals, sums), (squares, values)), &(_, weight)) in numbers.zip(scratch.iter()) {
            let counts = u64::from(weight > 0);
            for channel in 0..channels {
                let value = values[channel].widened();
                totals[channel] += weight * value;
                sums[channel] += counts * value;
                squares[channel] += counts * value * value;
            }
        }
        let bests = layers.bests.chunks_exact_mut(channels).zip(layers.resolutions.iter_mut());
        for (((best, best_resolution), values), &(resolution, weight)) in
            bests.zip(values.chunks_exact(channels)).zip(scratch.iter())
        {
            let resolution = resolution as u16;
            // of equals the largest, channel by channel: some rule that does not depend on the order of frames
            let better =
                weight > 0 && (resolution > *best_resolution || resolution == *best_resolution && values > &best[..]);
            if better {
                *best_resolution = resolution;
                best.copy_from_slice(values);
            }
        }
        scratch.iter().filter(|&&(_, weight)| weight > 0).count()
    }
}

impl<T: Value> cpu::Body for Cells<'_, T> {
    type Output = usize;

    #[inline(always)]
    fn run(self) -> usize {
        let (near, far) = self.distance;
        let cells = self.scratch.len();
        let (resolutions, distances) = (&self.resolutions[..cells], &self.distances[..cells]);
        for cell in 0..cells {
            let within = distances[cell] >= near * near && distances[cell] < far * far;
            let resolution = (resolutions[cell] * ONE_PIXEL as f32) as u32; // saturates, and NaN is 0
            let resolution = if within { resolution.min(u16::MAX.into()) } else { 0 };
            self.scratch[cell] = (resolution, weight(resolution, self.whole));
        }
        match self.channels {
            1 => self.add_channels::<1>(),
            3 => self.add_channels::<3>(),
            _ => self.add_channels::<0>(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_the_eighth_power_and_level_from_one_pixel_on() {
        assert_eq!(weight(ONE_PIXEL, WHOLE), 1 << 31);
        assert_eq!(weight(10 * ONE_PIXEL, WHOLE), 1 << 31);
        assert_eq!(weight(ONE_PIXEL / 2, WHOLE), 1 << 23);
        assert_eq!(weight(ONE_PIXEL, WHOLE / 2), 1 << 30);
        assert_eq!(weight(LEAST, WHOLE), 1, "what counts at all counts something");
        assert_eq!(weight(LEAST - 1, WHOLE), 0);
        for resolution in LEAST..ONE_PIXEL {
            let exact = (f64::from(resolution) / f64::from(ONE_PIXEL)).powi(8) * f64::from(1u32 << 31);
            let got = weight(resolution, WHOLE) as f64;
            assert!((got - exact).abs() <= 1.0 + exact * 1e-4, "{resolution}: {got}, {exact}");
        }
    }
}
