//! Tables without the cells that show hidden pixels: the own bonnet, what lies outside a fisheye's circle.

use super::{Interpolation, WarpOptions};
use crate::error::{Error, Result, ViewError};
use crate::lut::Lut;
use crate::view::{ImageMask, ImageView, buffer};

impl Lut {
    /// The table of the cells whose whole footprint shows pixels that the mask shows; the others are outside.
    ///
    /// # Errors
    /// [`ViewError::SizeMismatch`] for a mask that is not of the size of the images, [`Error::OutOfMemory`] and those
    /// of [`Interpolation::Area`].
    pub fn masked(&self, mask: &ImageMask) -> Result<Self> {
        self.restricted(&self.unmasked(mask)?)
    }

    /// Which cells have a whole footprint of pixels that the mask shows.
    ///
    /// An average over all of a footprint is white only where every pixel that counts is.
    pub(crate) fn unmasked(&self, mask: &ImageMask) -> Result<Vec<bool>> {
        let [expected, size] =
            [self.source_size(), mask.size()].map(|(width, height)| (width as usize, height as usize));
        if size != expected {
            return Err(Error::View(ViewError::SizeMismatch { expected, got: size }));
        }
        let white: Vec<u8> =
            buffer::collected("mask", mask.shown().iter().map(|&shown| if shown { u8::MAX } else { 0 }))?;
        let image = ImageView::new(&white, size, 1)?;
        // what lies outside the image is not hidden
        let border_value = vec![u8::MAX];
        let options = WarpOptions { interpolation: Interpolation::Area, border_value, ..WarpOptions::default() };
        let view = self.warp(&image, &options)?;
        buffer::collected("mask", view.into_iter().map(|white| white == u8::MAX))
    }
}
