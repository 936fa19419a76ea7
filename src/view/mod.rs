//! Memory that others own, seen as images, tables and points: where things lie is checked once, here.
//!
//! ```
//! use ipm_rs::ImageView;
//!
//! # fn main() -> ipm_rs::Result<()> {
//! let buffer: Vec<u8> = (0..40).collect(); // 4 rows of 10 bytes, of which 9 are pixels
//! let image = ImageView::with_row_stride(&buffer, (3, 4), 3, 0, 10)?;
//! assert_eq!(image.pixel(2, 1), [16, 17, 18]);
//! assert!(ImageView::new(&buffer, (7, 4), 3).is_err()); // 84 bytes
//! # Ok(())
//! # }
//! ```

pub(crate) mod buffer;
pub(crate) mod error;
mod half;
mod image;
mod limits;
mod mask;
mod number;
mod prefetch;
mod strided;

pub use half::F16;
pub use image::{ImageView, ImageViewMut};
pub use limits::MAX_CELLS;
pub use mask::ImageMask;
pub use number::{Cast, DepthSample, PointSample, Sample};
pub use strided::{Strided, reach};

pub(crate) use image::RowsMut;
pub(crate) use limits::{are_too_many, check_image_size};
pub(crate) use number::{as_bytes, as_bytes_mut};
pub(crate) use prefetch::prefetch;
