//! The accumulators of a square of cells.

use crate::error::{Error, MosaicError, Result};
use crate::view::Sample;
use crate::warp::Bilinear;

/// A number that is accumulated: 8 or 16 bits, without a sign.
pub trait Value: Sample + Bilinear + Ord {
    /// The number.
    fn widened(self) -> u32;
}

impl Value for u8 {
    #[inline(always)]
    fn widened(self) -> u32 {
        self.into()
    }
}

impl Value for u16 {
    #[inline(always)]
    fn widened(self) -> u32 {
        self.into()
    }
}

/// What a tile keeps of each cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Kept {
    /// Channels of the images.
    pub channels: usize,
    /// The values of so many frames, those that resolve the cell best.
    pub samples: usize,
    /// Whether images are of labels, of which nothing is summed.
    pub labels: bool,
}

impl Kept {
    /// Numbers a cell in layers of sums of values.
    pub(super) fn sums(self) -> usize {
        if self.labels { 0 } else { self.channels }
    }
}

/// The accumulators of a tile, row-major; channels of a cell are adjacent.
///
/// All are integers, and all that is done to them is adding, taking the larger, and keeping the largest few: in whatever
/// order frames come, and however they are shared out, the same bits come out. With weights of 31 bits and values of 8
/// (16), sums hold 2^24 (2^16) frames a cell.
#[derive(Debug)]
pub struct Tile<'a, T> {
    pub(super) side: usize,
    pub(super) kept: Kept,
    pub(super) layers: Layers<'a, T>,
}

/// The layers of a tile, or of some of its rows.
#[derive(Debug)]
pub struct Layers<'a, T> {
    /// Of each cell, the sum of the frames' weights.
    pub weights: &'a mut [u64],
    /// Of each cell and channel, the sum of weights times values; empty of labels.
    pub totals: &'a mut [u64],
    /// How many frames saw each cell.
    pub counts: &'a mut [u32],
    /// Of each cell and channel, the sum of values; empty of labels.
    pub sums: &'a mut [u64],
    /// Of each cell and channel, the sum of squares of values; empty of labels.
    pub squares: &'a mut [u64],
    /// Of each cell, the best resolution, in 1/4096 pixel a cell.
    pub resolutions: &'a mut [u16],
    /// Of each cell and channel, the value of the frame that resolved it best; of equals, the largest.
    pub bests: &'a mut [T],
    /// Of each cell the keys of its samples, descending, 0 where there is none: 12 bits for how well the frame resolves the
    /// cell, then 20 of its id.
    pub keys: &'a mut [u32],
    /// The samples, in the order of their keys.
    pub samples: &'a mut [T],
}

impl<'a, T> Tile<'a, T> {
    /// The tile of these layers.
    ///
    /// # Errors
    /// [`MosaicError::Channels`] of no channels, [`MosaicError::Layer`] where a layer has another length than the others.
    pub fn new(side: usize, kept: Kept, layers: Layers<'a, T>) -> Result<Self> {
        if kept.channels == 0 {
            return Err(Error::Mosaic(MosaicError::Channels { expected: 1, got: 0 }));
        }
        // too many to be counted are more than any layer has
        let of = |numbers: usize| side.saturating_mul(side).saturating_mul(numbers);
        let (cells, sums) = (of(1), of(kept.sums()));
        for (layer, got, expected) in [
            ("weights", layers.weights.len(), cells),
            ("totals", layers.totals.len(), sums),
            ("counts", layers.counts.len(), cells),
            ("sums", layers.sums.len(), sums),
            ("squares", layers.squares.len(), sums),
            ("resolutions", layers.resolutions.len(), cells),
            ("bests", layers.bests.len(), of(kept.channels)),
            ("keys", layers.keys.len(), of(kept.samples)),
            ("samples", layers.samples.len(), of(kept.samples.saturating_mul(kept.channels))),
        ] {
            if got != expected {
                return Err(Error::Mosaic(MosaicError::Layer { layer, expected, got }));
            }
        }
        Ok(Self { side, kept, layers })
    }
}

impl<T: Value> Tile<'_, T> {
    /// Keeps the best of its own samples and of another tile's, which are in the same order.
    ///
    /// # Errors
    /// [`MosaicError::Layer`] where they are of another length.
    pub fn merge_samples(&mut self, keys: &[u32], samples: &[T]) -> Result<()> {
        let Kept { channels, samples: count, .. } = self.kept;
        for (layer, got, expected) in
            [("keys", keys.len(), self.layers.keys.len()), ("samples", samples.len(), self.layers.samples.len())]
        {
            if got != expected {
                return Err(Error::Mosaic(MosaicError::Layer { layer, expected, got }));
            }
        }
        if count == 0 {
            return Ok(());
        }
        let own = self.layers.keys.chunks_exact_mut(count).zip(self.layers.samples.chunks_exact_mut(count * channels));
        let others = keys.chunks_exact(count).zip(samples.chunks_exact(count * channels));
        for ((keys, samples), (their_keys, theirs)) in own.zip(others) {
            for (&key, value) in their_keys.iter().zip(theirs.chunks_exact(channels)).filter(|&(&key, _)| key > 0) {
                insert(keys, samples, key, value);
            }
        }
        Ok(())
    }
}

/// Puts a sample among those of a cell, whose keys descend; of equal keys the larger value is before the smaller. The last
/// one makes room, or the new one is left out.
#[inline(always)]
pub(super) fn insert<T: Value>(keys: &mut [u32], values: &mut [T], key: u32, value: &[T]) {
    let channels = value.len();
    let mut at = keys.len();
    while at > 0 {
        let before = at - 1;
        let other = &values[before * channels..at * channels];
        if key < keys[before] || key == keys[before] && value <= other {
            break;
        }
        if at < keys.len() {
            keys[at] = keys[before];
            values.copy_within(before * channels..at * channels, at * channels);
        }
        at = before;
    }
    if at < keys.len() {
        keys[at] = key;
        values[at * channels..(at + 1) * channels].copy_from_slice(value);
    }
}

impl<T> Layers<'_, T> {
    /// The layers from a cell to before another, borrowed for a while.
    pub(super) fn cells(&mut self, cells: std::ops::Range<usize>, kept: Kept) -> Layers<'_, T> {
        let of = |numbers: usize| cells.start * numbers..cells.end * numbers;
        Layers {
            weights: &mut self.weights[of(1)],
            totals: &mut self.totals[of(kept.sums())],
            counts: &mut self.counts[of(1)],
            sums: &mut self.sums[of(kept.sums())],
            squares: &mut self.squares[of(kept.sums())],
            resolutions: &mut self.resolutions[of(1)],
            bests: &mut self.bests[of(kept.channels)],
            keys: &mut self.keys[of(kept.samples)],
            samples: &mut self.samples[of(kept.samples * kept.channels)],
        }
    }
}

impl<'a, T> Layers<'a, T> {
    /// The layers of the first cells, and of the others.
    pub(super) fn split(self, cells: usize, kept: Kept) -> (Self, Self) {
        let sums = cells * kept.sums();
        let (weights, totals) = (self.weights.split_at_mut(cells), self.totals.split_at_mut(sums));
        let (counts, sums_of) = (self.counts.split_at_mut(cells), self.sums.split_at_mut(sums));
        let (squares, resolutions) = (self.squares.split_at_mut(sums), self.resolutions.split_at_mut(cells));
        let (bests, keys) =
            (self.bests.split_at_mut(cells * kept.channels), self.keys.split_at_mut(cells * kept.samples));
        let samples = self.samples.split_at_mut(cells * kept.samples * kept.channels);
        let first = Layers {
            weights: weights.0,
            totals: totals.0,
            counts: counts.0,
            sums: sums_of.0,
            squares: squares.0,
            resolutions: resolutions.0,
            bests: bests.0,
            keys: keys.0,
            samples: samples.0,
        };
        let others = Layers {
            weights: weights.1,
            totals: totals.1,
            counts: counts.1,
            sums: sums_of.1,
            squares: squares.1,
            resolutions: resolutions.1,
            bests: bests.1,
            keys: keys.1,
            samples: samples.1,
        };
        (first, others)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_best_samples_are_kept_in_any_order() {
        let frames: Vec<(u32, [u8; 2])> =
            vec![(7, [1, 2]), (9, [3, 0]), (7, [1, 3]), (2, [9, 9]), (9, [3, 0]), (8, [0, 0])];
        let kept = |order: &[usize]| {
            let (mut keys, mut values) = ([0u32; 4], [0u8; 8]);
            for &frame in order {
                insert(&mut keys, &mut values, frames[frame].0, &frames[frame].1);
            }
            (keys, values)
        };
        let expected = ([9, 9, 8, 7], [3, 0, 3, 0, 0, 0, 1, 3]);
        assert_eq!(kept(&[0, 1, 2, 3, 4, 5]), expected);
        assert_eq!(kept(&[5, 4, 3, 2, 1, 0]), expected);
        assert_eq!(kept(&[3, 0, 2, 5, 1, 4]), expected);
        assert_eq!(kept(&[2, 3]), ([7, 2, 0, 0], [1, 3, 9, 9, 0, 0, 0, 0]));
    }
}
