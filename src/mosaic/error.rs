//! What is wrong with a tile of a mosaic.

use super::windows::COARSEST_STEP;

/// Layers or a window that do not fit a tile.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MosaicError {
    /// A layer of another length than the tile's cells and channels make.
    #[error("mosaic: expected {expected} numbers in the tile's layer {layer}, got {got}")]
    Layer {
        /// Which layer.
        layer: &'static str,
        /// Numbers that the tile has.
        expected: usize,
        /// Numbers that came.
        got: usize,
    },
    /// A window that is not within its tile.
    #[error("mosaic: expected a window within the {side} x {side} cells of its tile, got {rows} x {columns} at {at:?}")]
    Window {
        /// Cells along the tile's side.
        side: usize,
        /// Rows of the window.
        rows: usize,
        /// Columns of the window.
        columns: usize,
        /// Its first row and column in the tile.
        at: (usize, usize),
    },
    /// An image of other channels than the tile.
    #[error("mosaic: expected images of {expected} channels, got {got}")]
    Channels {
        /// Channels of the tile.
        expected: usize,
        /// Channels that came.
        got: usize,
    },
    /// Tiles of a side that windows cannot be found for.
    #[error("mosaic: expected tiles of a multiple of {COARSEST_STEP} cells, got {got}")]
    Side {
        /// The side that came.
        got: usize,
    },
}
