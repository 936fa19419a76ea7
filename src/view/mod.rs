//! Memory that others own, seen as images, tables and points: where things lie is checked once, here.

pub(crate) mod buffer;
mod half;
mod image;
mod number;
mod prefetch;
mod strided;

pub use half::F16;
pub use image::{ImageView, ImageViewMut};
pub use number::{Cast, DepthSample, PointSample, Sample};
pub use strided::{Strided, reach};

pub(crate) use image::RowsMut;
pub(crate) use number::{as_bytes, as_bytes_mut};
pub(crate) use prefetch::prefetch;
