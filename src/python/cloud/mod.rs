//! Depth images, points and their pixels.

mod carla;
mod compat;
mod depth;
mod gather;
mod options;
mod project;
mod rays;
mod render;

pub(super) use carla::{decode_carla_depth, encode_carla_depth};
pub(super) use compat::{depth_to_lidar, depth_to_local_point_cloud};
pub(super) use depth::points_from_depth;
pub(super) use project::{Projected, ProjectedArrays, ProjectedOut, project};
pub(super) use rays::PyPixelRays;
pub(super) use render::render_points;
