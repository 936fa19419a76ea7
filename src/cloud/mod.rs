//! Depth images to points, and points to pixels.

mod back_project;
mod carla;
mod compat;
pub(crate) mod error;
mod kernels;
mod project;
mod rays;
mod render;

pub use back_project::{DepthCloud, DepthKind, DepthOptions, DepthRows, cloud_from_depth};
pub use back_project::{points_from_depth_into, points_size};
pub use carla::{CarlaDepth, ChannelOrder, DepthUnit, decode_carla_depth_into, encode_carla_depth_into};
pub use compat::{LidarPoints, carla_084_points, depth_to_lidar};
pub use project::{Projections, project_into};
pub use rays::{PixelRays, Viewpoint};
pub use render::{NO_POINT, RenderOptions, paint_into, render_points_into};

use nalgebra::Matrix3;

use crate::camera::Camera;
use crate::error::CloudError;

/// Most points that one depth image may become, and most pixels that points may be drawn into: 2^28, 3 GiB of points.
pub const MAX_POINTS: usize = 1 << 28;

/// Refuses more, before any memory is asked for.
pub(crate) fn check_points(what: &'static str, (width, height): (usize, usize)) -> Result<(), CloudError> {
    let got = width.saturating_mul(height);
    if got <= MAX_POINTS { Ok(()) } else { Err(CloudError::TooManyPoints { what, got, limit: MAX_POINTS }) }
}

/// fx, fy, cx, cy, skew.
fn intrinsics(camera: &Camera) -> [f64; 5] {
    let k = camera.intrinsics();
    [k[(0, 0)], k[(1, 1)], k[(0, 2)], k[(1, 2)], k[(0, 1)]]
}

/// A matrix, row by row.
fn rows(matrix: &Matrix3<f64>) -> [[f64; 3]; 3] {
    std::array::from_fn(|row| std::array::from_fn(|column| matrix[(row, column)]))
}
