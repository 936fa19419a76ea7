//! Which pixels of a camera's images show the road.

use std::ops::Range;

use super::buffer;
use crate::error::{Error, Result, ViewError};

/// What memory is asked for, in errors.
const WHAT: &str = "mask";

/// For each pixel of an image whether it shows the road: not the own bonnet, nor what lies outside a fisheye's circle.
///
/// It follows the image as the camera does: a pixel of a resized or binned image is shown where all that it is made of is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ImageMask {
    size: (u32, u32),
    shown: Vec<bool>,
}

impl ImageMask {
    /// The mask of images of (width, height), row-major, true where they show the road.
    ///
    /// # Errors
    /// [`ViewError::EmptyImage`], and [`ViewError::MaskSize`] for another number of pixels.
    pub fn new(size: (u32, u32), shown: Vec<bool>) -> Result<Self> {
        let expected = (size.0 as usize, size.1 as usize);
        if expected.0 == 0 || expected.1 == 0 {
            let (width, height) = expected;
            return Err(Error::View(ViewError::EmptyImage { what: WHAT, width, height, channels: 1 }));
        }
        if shown.len() != expected.0 * expected.1 {
            return Err(Error::View(ViewError::MaskSize { expected, got: shown.len() }));
        }
        Ok(Self { size, shown })
    }

    /// For each pixel, row-major, whether it shows the road.
    pub fn shown(&self) -> &[bool] {
        &self.shown
    }

    /// (width, height) of the images.
    pub fn size(&self) -> (u32, u32) {
        self.size
    }

    /// Hides what `other`, of the same size, hides too.
    ///
    /// # Panics
    /// Where the sizes differ.
    pub fn and(mut self, other: &Self) -> Self {
        assert_eq!(self.size, other.size);
        self.shown.iter_mut().zip(&other.shown).for_each(|(shown, &other)| *shown &= other);
        self
    }

    /// The mask of the images of [`Camera::resized`](crate::Camera::resized).
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    pub fn resized(&self, width: u32, height: u32) -> Result<Self> {
        let of = |new: u32, old: u32| {
            move |pixel: u32| {
                let [begin, end] = [pixel, pixel + 1].map(|edge| u64::from(edge) * u64::from(old));
                (begin / u64::from(new)) as u32..end.div_ceil(u64::from(new)) as u32
            }
        };
        self.of_blocks((width, height), of(width, self.size.0), of(height, self.size.1))
    }

    /// The mask of the images of [`Camera::cropped`](crate::Camera::cropped), for a rectangle inside the image.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    ///
    /// # Panics
    /// Where the rectangle is not inside.
    pub fn cropped(&self, x: u32, y: u32, width: u32, height: u32) -> Result<Self> {
        let of = |first: u32| move |pixel: u32| first + pixel..first + pixel + 1;
        self.of_blocks((width, height), of(x), of(y))
    }

    /// The mask of the images of [`Camera::binned`](crate::Camera::binned), for blocks that the image has.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    ///
    /// # Panics
    /// For blocks of no pixels.
    pub fn binned(&self, x: u32, y: u32) -> Result<Self> {
        let of = |block: u32| move |pixel: u32| pixel * block..(pixel + 1) * block;
        self.of_blocks((self.size.0 / x, self.size.1 / y), of(x), of(y))
    }

    /// The mask of the images of [`Camera::rotated180`](crate::Camera::rotated180).
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    pub fn rotated180(&self) -> Result<Self> {
        Ok(Self { size: self.size, shown: buffer::collected(WHAT, self.shown.iter().rev().copied())? })
    }

    /// The mask of the images of [`Camera::mirrored`](crate::Camera::mirrored).
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    pub fn mirrored(&self) -> Result<Self> {
        let mut mirrored = buffer::copied(WHAT, &self.shown)?;
        mirrored.chunks_mut(self.size.0 as usize).for_each(<[bool]>::reverse);
        Ok(Self { size: self.size, shown: mirrored })
    }

    /// The mask of an image each of whose pixels is made of a rectangle of this one's.
    fn of_blocks(
        &self,
        size: (u32, u32),
        columns: impl Fn(u32) -> Range<u32>,
        rows: impl Fn(u32) -> Range<u32>,
    ) -> Result<Self> {
        let width = self.size.0 as usize;
        let mut shown = buffer::reserved(WHAT, size.0 as usize * size.1 as usize)?;
        for row in 0..size.1 {
            for column in 0..size.0 {
                let columns = columns(column);
                let all = rows(row).all(|row| {
                    let row = &self.shown[row as usize * width..][..width];
                    row[columns.start as usize..columns.end as usize].iter().all(|&shown| shown)
                });
                shown.push(all);
            }
        }
        Ok(Self { size, shown })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mask_of_no_image_is_refused() {
        for size in [(0, 0), (0, 3), (3, 0)] {
            assert!(matches!(ImageMask::new(size, vec![]), Err(Error::View(ViewError::EmptyImage { .. }))));
        }
    }

    fn mask(width: u32, rows: &[&str]) -> ImageMask {
        let shown = rows.iter().flat_map(|row| row.bytes().map(|pixel| pixel == b'#')).collect();
        ImageMask { size: (width, rows.len() as u32), shown }
    }

    #[test]
    fn masks_follow_the_image() {
        let given = mask(5, &["#####", "##.##", "####."]);
        assert_eq!(given.resized(5, 3).unwrap(), given);
        assert_eq!(given.resized(10, 3).unwrap(), mask(10, &["##########", "####..####", "########.."]));
        assert_eq!(given.resized(2, 3).unwrap(), mask(2, &["##", "..", "#."]));
        assert_eq!(given.cropped(1, 1, 3, 2).unwrap(), mask(3, &["#.#", "###"]));
        assert_eq!(given.binned(2, 1).unwrap(), mask(2, &["##", "#.", "##"]));
        assert_eq!(given.binned(5, 3).unwrap(), mask(1, &["."]));
        assert_eq!(given.rotated180().unwrap(), mask(5, &[".####", "##.##", "#####"]));
        assert_eq!(given.mirrored().unwrap(), mask(5, &["#####", "##.##", ".####"]));
        let other = mask(5, &[".####", "#####", "#####"]);
        assert_eq!(given.and(&other), mask(5, &[".####", "##.##", "####."]));
    }

    #[test]
    fn another_number_of_pixels_is_refused() {
        assert_eq!(ImageMask::new((5, 3), vec![true; 15]).unwrap().size(), (5, 3));
        assert!(matches!(ImageMask::new((5, 3), vec![true; 16]), Err(Error::View(ViewError::MaskSize { .. }))));
    }
}
