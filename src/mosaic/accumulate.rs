//! How much a frame counts in a cell, and the loop that adds it.

use super::tile::{Kept, Layers, Value, insert};
use crate::error::Result;
use crate::isa::{self, Isa};
use crate::view::buffer;

/// Resolutions are kept in 1/4096 pixel a cell.
const ONE_PIXEL: u32 = 1 << 12;

/// Coarser frames are left out, as if they did not see the cell: 16 cells to a pixel.
pub(super) const COARSEST: f64 = 1.0 / 16.0;

/// The same in 1/4096 pixel.
const LEAST: u32 = ONE_PIXEL / 16;

/// Pixels a cell that are told from fewer.
const FINEST: f32 = 15.999;

/// What a frame's whole weight is.
pub(super) const WHOLE: u32 = 1 << 16;

/// The weight of a frame by how it resolves the cell: its eighth power in Q31, level from one pixel a cell on.
///
/// All that resolve a cell share it, and where none does the best one wins by far: half the resolution counts 1/256.
#[inline(always)]
fn weight(resolution: u32, whole: u32) -> u32 {
    let square = u64::from(resolution.min(ONE_PIXEL)).pow(2); // Q24
    let fourth = (square * square) >> 17; // Q31
    let eighth = (fourth * fourth) >> 31;
    let weight = ((eighth * u64::from(whole)) >> 16).max(1); // up to 2^31
    if resolution >= LEAST { weight as u32 } else { 0 }
}

/// Of the id of a frame in the key of a sample.
pub(super) const ID_BITS: u32 = 20;

/// What samples are ordered by: the resolution, in 512 steps from each to its double, then the frame's id.
#[inline(always)]
fn key(resolution: u32, id: u32) -> u32 {
    let octave = 31 - (resolution | 1).leading_zeros(); // 8 to 15 of what counts
    let steps = ((resolution << 15) >> octave >> 6) & 511;
    (octave.saturating_sub(LEAST.ilog2()) << 9 | steps) << ID_BITS | id
}

/// The weights of a frame by resolution up to one pixel; those of finer ones are the last.
///
/// A table, because an eighth power in 64 bits has no vector instructions: looked up, adding a row takes half the time.
pub(super) struct Weights(Vec<u32>);

impl Weights {
    /// Of a frame that counts `whole` of [`WHOLE`].
    ///
    /// # Errors
    /// [`Error::OutOfMemory`](crate::Error::OutOfMemory).
    pub(super) fn new(whole: u32) -> Result<Self> {
        let mut weights = buffer::zeroed("mosaic", ONE_PIXEL as usize + 1)?;
        for (resolution, entry) in (0..).zip(&mut weights) {
            *entry = weight(resolution, whole);
        }
        Ok(Self(weights))
    }

    #[inline(always)]
    fn of(&self, resolution: u16) -> u32 {
        self.0[usize::from(resolution).min(ONE_PIXEL as usize)]
    }
}

/// Room for numbers of neighbouring cells.
pub(super) struct Scratch {
    resolutions: Vec<u16>,
    weights: Vec<u32>,
}

impl Scratch {
    /// # Errors
    /// [`Error::OutOfMemory`](crate::Error::OutOfMemory).
    pub(super) fn new(cells: usize) -> Result<Self> {
        Ok(Self { resolutions: buffer::zeroed("mosaic", cells)?, weights: buffer::zeroed("mosaic", cells)? })
    }
}

/// Neighbouring cells of a row, and what a frame shows of them.
pub(super) struct Cells<'a, T> {
    pub(super) layers: Layers<'a, T>,
    pub(super) kept: Kept,
    pub(super) values: &'a [T],
    /// Pixels a cell.
    pub(super) resolutions: &'a [f32],
    /// The square of how far the row is away along x, of each cell that along y, and which distances count.
    pub(super) x_squared: f64,
    pub(super) y_squared: &'a [f64],
    pub(super) distance: (f64, f64),
    pub(super) weights: &'a Weights,
    /// Of the frame, from 1 on, in [`ID_BITS`].
    pub(super) id: u32,
    pub(super) scratch: &'a mut Scratch,
}

impl<T: Value> Cells<'_, T> {
    /// Adds them; returns how many counted.
    pub(super) fn add(self, isa: Isa) -> usize {
        isa::run(isa, self)
    }

    /// The resolution of each cell in 1/4096 pixel, 0 where the frame does not count, and its weight.
    #[inline(always)]
    fn weigh(&mut self) {
        let cells = self.resolutions.len();
        let (near, far) = (self.distance.0 * self.distance.0, self.distance.1 * self.distance.1);
        let (resolutions, y_squared) = (&self.resolutions[..cells], &self.y_squared[..cells]);
        let own = &mut self.scratch.resolutions[..cells];
        for cell in 0..cells {
            let squared = self.x_squared + y_squared[cell];
            let counts = (squared >= near) & (squared < far);
            // plain comparisons, which NaN fails: f32::max and min look for it, and block vectors
            let pixels = resolutions[cell];
            let pixels = if pixels > 0.0 { pixels } else { 0.0 };
            let pixels = if pixels < FINEST { pixels } else { FINEST };
            let resolution = (pixels * ONE_PIXEL as f32) as i32;
            own[cell] = if counts & (resolution >= LEAST as i32) { resolution as u16 } else { 0 };
        }
        for (weight, &resolution) in self.scratch.weights[..cells].iter_mut().zip(&*own) {
            *weight = self.weights.of(resolution);
        }
    }

    #[inline(always)]
    fn add_channels<const C: usize>(self) -> usize {
        let Self { layers, values, kept, .. } = self;
        let cells = self.resolutions.len();
        let channels = if C == 0 { kept.channels } else { C };
        let (resolutions, weights) = (&self.scratch.resolutions[..cells], &self.scratch.weights[..cells]);
        if kept.samples > 0 {
            let lists = layers.keys.chunks_exact_mut(kept.samples);
            let lists = lists.zip(layers.samples.chunks_exact_mut(kept.samples * channels));
            for (((keys, samples), value), &resolution) in lists.zip(values.chunks_exact(channels)).zip(resolutions) {
                if resolution > 0 {
                    insert(keys, samples, key(resolution.into(), self.id), value);
                }
            }
        }
        let mut counted = 0;
        for ((total, count), &weight) in layers.weights.iter_mut().zip(&mut *layers.counts).zip(weights) {
            *total += u64::from(weight);
            *count += u32::from(weight > 0);
            counted += u32::from(weight > 0);
        }
        if !kept.labels {
            let numbers = (layers.totals.chunks_exact_mut(channels).zip(layers.sums.chunks_exact_mut(channels)))
                .zip(layers.squares.chunks_exact_mut(channels).zip(values.chunks_exact(channels)));
            for (((totals, sums), (squares, values)), &weight) in numbers.zip(weights) {
                for channel in 0..channels {
                    let value = values[channel].widened();
                    let once = if weight > 0 { value } else { 0 };
                    totals[channel] += u64::from(weight) * u64::from(value);
                    sums[channel] += u64::from(once);
                    squares[channel] += u64::from(once * once);
                }
            }
        }
        let bests = layers.bests.chunks_exact_mut(channels).zip(&mut *layers.resolutions);
        for (((best, known), values), &resolution) in bests.zip(values.chunks_exact(channels)).zip(resolutions) {
            // of equals the largest, channel by channel: some rule that does not depend on the order of frames
            let larger = if C == 1 { values[0] > best[0] } else { values > &*best };
            let better = (resolution > *known) | ((resolution == *known) & (resolution > 0) & larger);
            if C == 1 {
                best[0] = if better { values[0] } else { best[0] };
                *known = if better { resolution } else { *known };
            } else if better {
                *known = resolution;
                best.copy_from_slice(values);
            }
        }
        counted as usize
    }
}

impl<T: Value> isa::Body for Cells<'_, T> {
    type Output = usize;

    #[inline(always)]
    fn run(mut self) -> usize {
        self.weigh();
        match self.kept.channels {
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
    fn keys_grow_with_the_resolution() {
        assert_eq!(key(LEAST, 1), 1);
        assert_eq!(key(u16::MAX.into(), 5), (4095 << ID_BITS) | 5);
        assert_eq!(key(ONE_PIXEL, 0) >> ID_BITS, 4 * 512);
        for resolution in LEAST..u32::from(u16::MAX) {
            let (low, high) = (key(resolution, 0) >> ID_BITS, key(resolution + 1, 0) >> ID_BITS);
            assert!(low <= high && high <= low + 2, "{resolution}");
            let octave = f64::from(1u32 << (low >> 9)) * f64::from(LEAST);
            let value = octave * (1.0 + f64::from(low & 511) / 512.0);
            assert!((value / f64::from(resolution) - 1.0).abs() < 1.0 / 256.0, "{resolution}: {value}");
        }
    }

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
            let got = f64::from(weight(resolution, WHOLE));
            assert!((got - exact).abs() <= 1.0 + exact * 1e-4, "{resolution}: {got}, {exact}");
        }
    }
}
