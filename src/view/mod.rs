//! Memory that others own, seen as images, tables and points: where things lie is checked once, here.

pub(crate) mod buffer;
mod half;
pub(crate) mod image;
mod number;
mod points;
mod prefetch;
mod sample;
mod strided;

pub use half::F16;
pub use image::{ImageView, ImageViewMut, Sample};
pub use number::{Cast, Real};
pub use points::PointsView;
pub use sample::{DepthSample, PointSample};
pub use strided::Strided;

pub(crate) use image::{RowsMut, as_bytes, as_bytes_mut};
pub(crate) use prefetch::prefetch;
