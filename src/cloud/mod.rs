//! Depth images to points, and points to pixels.
//!
//! ```
//! use ipm_rs::cloud::{DepthOptions, Projections, cloud_from_depth, project_into};
//! use ipm_rs::view::Strided;
//! use ipm_rs::{Camera, ImageView, Pinhole};
//!
//! # fn main() -> ipm_rs::Result<()> {
//! let lens = Pinhole::new(40.0, 40.0, 31.5, 23.5, 0.0)?;
//! let camera = Camera::from_euler(lens, (64, 48), [0.0, 0.0, 1.5], 0.0, 0.2, 0.0)?;
//! let depth = vec![8.0f32; 64 * 48]; // metres along the optical axis
//! let view = ImageView::new(&depth, (64, 48), 1)?;
//! let cloud = cloud_from_depth::<_, f32>(&view, &camera, camera.vehicle_from_camera(), None, &DepthOptions::default())?;
//! assert_eq!(cloud.points.len(), 64 * 48);
//! // and back: each point falls on its own pixel
//! let points = Strided::new(cloud.points.as_flattened(), 3)?;
//! let (mut uv, mut depth, mut valid) = (vec![[0.0; 2]; 64 * 48], vec![0.0; 64 * 48], vec![false; 64 * 48]);
//! project_into(&camera, &points, Projections { uv: &mut uv, depth: &mut depth, valid: &mut valid }, None)?;
//! assert!((uv[100][0] - 36.0).abs() < 1e-4 && (uv[100][1] - 1.0).abs() < 1e-4);
//! # Ok(())
//! # }
//! ```

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
