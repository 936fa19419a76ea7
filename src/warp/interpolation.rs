//! How values are taken from an image.

use crate::error::{Result, WarpError};

/// How a cell's value is taken from the pixels around its coordinate. The most frequent id of what it covers is not among
/// these, because ids need no arithmetic and have an order:
/// [`Lut::warp_many_mode_into`](crate::Lut::warp_many_mode_into).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Interpolation {
    /// The nearest pixel, halves to even: no value that the image does not hold, so label images keep their ids.
    Nearest,
    /// The four pixels around the coordinate, weighted by nearness. The default.
    #[default]
    Bilinear,
    /// Bicubic convolution of the 4 x 4 pixels around the coordinate with a = -0.75, as `cv2.INTER_CUBIC`. Sharper than
    /// bilinear where a picture is magnified, with a light rim along edges; it does not average where a cell is larger than
    /// a pixel, as those of a road are: that is [`Interpolation::Area`].
    Cubic,
    /// Lanczos' windowed sinc of the 8 x 8 pixels around the coordinate, as `cv2.INTER_LANCZOS4`; likewise.
    Lanczos4,
    /// The mean of the source over what the cell covers of it, at least a pixel: no aliasing where a cell is larger than a
    /// pixel, bilinear where it is not. For warps through a [`Lut`](crate::Lut).
    Area,
}

impl Interpolation {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Nearest, Self::Bilinear, Self::Cubic, Self::Lanczos4, Self::Area];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Nearest => "nearest",
            Self::Bilinear => "bilinear",
            Self::Cubic => "cubic",
            Self::Lanczos4 => "lanczos4",
            Self::Area => "area",
        }
    }

    /// This interpolation, if a warp without a table can do it.
    ///
    /// # Errors
    /// [`WarpError::NeedsTable`].
    pub fn without_table(self) -> Result<Self, WarpError> {
        match self {
            Self::Nearest | Self::Bilinear | Self::Cubic | Self::Lanczos4 => Ok(self),
            Self::Area => Err(WarpError::NeedsTable { got: self.name() }),
        }
    }
}
