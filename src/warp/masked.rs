//! Tables without the cells that show hidden pixels: the own bonnet, what lies outside a fisheye's circle.

use super::{Interpolation, WarpOptions};
use crate::error::{Error, Result};
use crate::lut::Lut;
use crate::view::{ImageView, buffer};

impl Lut {
    /// The table of the cells whose whole footprint shows pixels of `shown`, row-major; the others are outside.
    ///
    /// # Errors
    /// [`Error::SizeMismatch`] for a mask that is not of the size of the images, [`Error::OutOfMemory`] and those of
    /// [`Interpolation::Area`].
    pub fn masked(&self, shown: &[bool]) -> Result<Self> {
        self.restricted(&self.unmasked(shown)?)
    }

    /// Which cells have a whole footprint of pixels of `shown`.
    ///
    /// An average over all of a footprint is white only where every pixel that counts is.
    pub(crate) fn unmasked(&self, shown: &[bool]) -> Result<Vec<bool>> {
        let (width, height) = self.source_size();
        let size = (width as usize, height as usize);
        if shown.len() != size.0 * size.1 {
            return Err(Error::SizeMismatch { expected: size, got: (shown.len(), 1) });
        }
        let white: Vec<u8> = buffer::collected("mask", shown.iter().map(|&shown| if shown { u8::MAX } else { 0 }))?;
        let image = ImageView::new(&white, size, 1)?;
        let options = WarpOptions { interpolation: Interpolation::Area, ..WarpOptions::default() };
        let view = self.warp(&image, &options)?;
        buffer::collected("mask", view.into_iter().map(|white| white == u8::MAX))
    }
}
