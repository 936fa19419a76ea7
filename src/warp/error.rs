//! What is wrong with a warp.

/// A warp that cannot be done.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum WarpError {
    /// No images, or another number of outputs.
    #[error("expected at least one image and an output for each, got {images} images and {outs} outputs")]
    ImageCount {
        /// Images that came.
        images: usize,
        /// Outputs that came.
        outs: usize,
    },
    /// Images of one call that differ in their number of channels.
    #[error("images: expected all with {expected} channels, as the first, got one with {got}")]
    MixedChannels {
        /// Channels of the first.
        expected: usize,
        /// Channels of the one that differs.
        got: usize,
    },
    /// A way to interpolate that only a table offers, without one.
    #[error(
        "interpolation: expected one of those that need no table, nearest, bilinear, cubic or lanczos4, got {got:?}"
    )]
    NeedsTable {
        /// The one that came.
        got: &'static str,
    },
    /// A border mode that a table was not built for.
    #[error("border_mode: expected \"transparent\" or what this Lut was built for, {built:?}, got {got:?}")]
    BorderMode {
        /// What the table was built for.
        built: &'static str,
        /// The one that came.
        got: &'static str,
    },
    /// A way to interpolate that has no transpose.
    #[error(
        "interpolation: expected one that has an adjoint, bilinear, nearest or area of a table whose border is constant, got {got:?}"
    )]
    NoAdjoint {
        /// The one that came.
        got: &'static str,
    },
    /// A label image of too many different ids.
    #[error("mode: expected an image of at most {limit} different ids, got more")]
    TooManyIds {
        /// The limit.
        limit: usize,
    },
}
