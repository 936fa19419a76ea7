//! How to warp.

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
    /// At most how many threads; `None` is [`num_threads`](crate::num_threads).
    pub threads: Option<usize>,
}

impl<T: Default> Default for WarpOptions<T> {
    fn default() -> Self {
        Self { interpolation: Interpolation::default(), border_value: vec![T::default()], threads: None }
    }
}
