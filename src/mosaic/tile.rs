//! The accumulators of a square of cells.

use crate::error::{Error, MosaicError, Result};
use crate::view::Sample;
use crate::warp::Bilinear;

/// A number that is accumulated: 8 or 16 bits, without a sign.
pub trait Value: Sample + Bilinear + PartialOrd {
    /// The number.
    fn widened(self) -> u64;
}

impl Value for u8 {
    #[inline(always)]
    fn widened(self) -> u64 {
        self.into()
    }
}

impl Value for u16 {
    #[inline(always)]
    fn widened(self) -> u64 {
        self.into()
    }
}

/// The accumulators of a tile, row-major; channels of a cell are adjacent.
///
/// All are integers, and all that is done to them is adding and taking the larger: in whatever order frames come, and
/// however they are shared out, the same bits come out. With weights of 31 bits and values of 8 (16), sums hold 2^24
/// (2^16) frames a cell.
#[derive(Debug)]
pub struct Tile<'a, T> {
    pub(super) side: usize,
    pub(super) channels: usize,
    pub(super) layers: Layers<'a, T>,
}

/// The layers of a tile, or of some of its rows.
#[derive(Debug)]
pub struct Layers<'a, T> {
    /// Of each cell, the sum of the frames' weights.
    pub weights: &'a mut [u64],
    /// Of each cell and channel, the sum of weights times values.
    pub totals: &'a mut [u64],
    /// How many frames saw each cell.
    pub counts: &'a mut [u32],
    /// Of each cell and channel, the sum of values.
    pub sums: &'a mut [u64],
    /// Of each cell and channel, the sum of squares of values.
    pub squares: &'a mut [u64],
    /// Of each cell, the best resolution, in 1/4096 pixel a cell.
    pub resolutions: &'a mut [u16],
    /// Of each cell and channel, the value of the frame that resolved it best; of equals, the largest.
    pub bests: &'a mut [T],
}

impl<'a, T> Tile<'a, T> {
    /// The tile of these layers.
    ///
    /// # Errors
    /// [`MosaicError::Layer`] where one has another length than the others.
    pub fn new(side: usize, channels: usize, layers: Layers<'a, T>) -> Result<Self> {
        let (cells, numbers) = (side * side, side * side * channels);
        for (layer, got, expected) in [
            ("weights", layers.weights.len(), cells),
            ("totals", layers.totals.len(), numbers),
            ("counts", layers.counts.len(), cells),
            ("sums", layers.sums.len(), numbers),
            ("squares", layers.squares.len(), numbers),
            ("resolutions", layers.resolutions.len(), cells),
            ("bests", layers.bests.len(), numbers),
        ] {
            if got != expected {
                return Err(Error::Mosaic(MosaicError::Layer { layer, expected, got }));
            }
        }
        Ok(Self { side, channels, layers })
    }
}

impl<T> Layers<'_, T> {
    /// The layers from a cell to before another, borrowed for a while.
    pub(super) fn cells(&mut self, cells: std::ops::Range<usize>, channels: usize) -> Layers<'_, T> {
        let numbers = cells.start * channels..cells.end * channels;
        Layers {
            weights: &mut self.weights[cells.clone()],
            totals: &mut self.totals[numbers.clone()],
            counts: &mut self.counts[cells.clone()],
            sums: &mut self.sums[numbers.clone()],
            squares: &mut self.squares[numbers.clone()],
            resolutions: &mut self.resolutions[cells],
            bests: &mut self.bests[numbers],
        }
    }
}

impl<'a, T> Layers<'a, T> {
    /// The layers of the first cells, and of the others.
    pub(super) fn split(self, cells: usize, channels: usize) -> (Self, Self) {
        let numbers = cells * channels;
        let (weights, totals) = (self.weights.split_at_mut(cells), self.totals.split_at_mut(numbers));
        let (counts, sums) = (self.counts.split_at_mut(cells), self.sums.split_at_mut(numbers));
        let (squares, resolutions) = (self.squares.split_at_mut(numbers), self.resolutions.split_at_mut(cells));
        let bests = self.bests.split_at_mut(numbers);
        let first = Layers {
            weights: weights.0,
            totals: totals.0,
            counts: counts.0,
            sums: sums.0,
            squares: squares.0,
            resolutions: resolutions.0,
            bests: bests.0,
        };
        let others = Layers {
            weights: weights.1,
            totals: totals.1,
            counts: counts.1,
            sums: sums.1,
            squares: squares.1,
            resolutions: resolutions.1,
            bests: bests.1,
        };
        (first, others)
    }
}
