//! Memory that others own, seen as images, tables and points: where things lie is checked once, here.

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
