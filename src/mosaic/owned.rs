//! A tile that has memory of its own.

use super::WHAT;
use super::tile::{Kept, Layers, Tile, Value};
use crate::error::Result;
use crate::view::buffer;

/// A tile of which nothing has been seen yet, and what frames make of it: the layers of [`Layers`], which says what they
/// are, in memory of their own.
#[derive(Debug, Clone, PartialEq)]
pub struct OwnedTile<T> {
    side: usize,
    kept: Kept,
    /// Of each cell, the sum of the frames' weights.
    pub weights: Vec<u64>,
    /// Of each cell and channel, the sum of weights times values; empty of labels.
    pub totals: Vec<u64>,
    /// How many frames saw each cell.
    pub counts: Vec<u32>,
    /// Of each cell and channel, the sum of values; empty of labels.
    pub sums: Vec<u64>,
    /// Of each cell and channel, the sum of squares of values; empty of labels.
    pub squares: Vec<u64>,
    /// Of each cell, the best resolution, in 1/4096 pixel a cell.
    pub resolutions: Vec<u16>,
    /// Of each cell and channel, the value of the frame that resolved it best.
    pub bests: Vec<T>,
    /// Of each cell the keys of its samples, descending, 0 where there is none.
    pub keys: Vec<u32>,
    /// The samples, in the order of their keys.
    pub samples: Vec<T>,
}

impl<T: Value> OwnedTile<T> {
    /// An empty tile of `side` x `side` cells.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`](crate::Error::OutOfMemory).
    pub fn new(side: usize, kept: Kept) -> Result<Self> {
        let of = |numbers: usize| side.saturating_mul(side).saturating_mul(numbers);
        Ok(Self {
            side,
            kept,
            weights: buffer::zeroed(WHAT, of(1))?,
            totals: buffer::zeroed(WHAT, of(kept.sums()))?,
            counts: buffer::zeroed(WHAT, of(1))?,
            sums: buffer::zeroed(WHAT, of(kept.sums()))?,
            squares: buffer::zeroed(WHAT, of(kept.sums()))?,
            resolutions: buffer::zeroed(WHAT, of(1))?,
            bests: buffer::filled(WHAT, of(kept.channels), T::default())?,
            keys: buffer::zeroed(WHAT, of(kept.samples))?,
            samples: buffer::filled(WHAT, of(kept.samples.saturating_mul(kept.channels)), T::default())?,
        })
    }

    /// The tile, for frames to be added to.
    ///
    /// # Errors
    /// [`MosaicError::Layer`](crate::error::MosaicError::Layer) where a layer has been given another length.
    pub fn tile(&mut self) -> Result<Tile<'_, T>> {
        let layers = Layers {
            weights: &mut self.weights,
            totals: &mut self.totals,
            counts: &mut self.counts,
            sums: &mut self.sums,
            squares: &mut self.squares,
            resolutions: &mut self.resolutions,
            bests: &mut self.bests,
            keys: &mut self.keys,
            samples: &mut self.samples,
        };
        Tile::new(self.side, self.kept, layers)
    }
}
