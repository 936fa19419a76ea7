//! How to warp.

use crate::cpu::Isa;
use crate::error::Result;

/// How a cell's value is taken from the pixels around its coordinate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Interpolation {
    /// The nearest pixel, halves to even: no value that the image does not hold, so label images keep their ids.
    Nearest,
    /// The four pixels around the coordinate, weighted by nearness. The default.
    #[default]
    Bilinear,
}

/// Options of a warp.
#[derive(Debug, Clone, PartialEq)]
pub struct WarpOptions<T> {
    /// How values are taken.
    pub interpolation: Interpolation,
    /// What cells without an image get: one value for all channels, or one each.
    pub border_value: Vec<T>,
    /// Which instruction set's kernels; `None` is [`Isa::active`]. All give the same result: this is for tests, benches
    /// and bug reports.
    pub isa: Option<Isa>,
    /// At most how many threads; `None` is [`num_threads`](crate::num_threads).
    pub threads: Option<usize>,
}

impl<T: Default> Default for WarpOptions<T> {
    fn default() -> Self {
        Self { interpolation: Interpolation::default(), border_value: vec![T::default()], isa: None, threads: None }
    }
}

impl<T> WarpOptions<T> {
    /// The instruction set to use, which this CPU can run.
    pub(super) fn isa(&self) -> Result<Isa> {
        self.isa.map_or_else(Isa::active, Isa::checked)
    }
}
