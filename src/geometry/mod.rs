//! Rigid transforms, Euler angles and handedness: float64, column vectors, names that read `dst_from_src`.

pub(crate) mod error;
mod euler;
mod handedness;
mod homography;
mod pose;
mod vanishing;

pub use euler::{euler_from_rotation, rotation_from_euler};
pub use handedness::{flip_handedness_euler, flip_handedness_point, flip_handedness_pose, flip_handedness_rotation};
pub use homography::{GroundHomography, homography_from_points};
pub use pose::{Pose, check_rotation};
pub use vanishing::vanishing_point;

use nalgebra::Matrix3;

/// Camera axes from vehicle axes: the optical frame (x right, y down, z forward) of a camera that looks along the
/// vehicle's +x (ISO 8855: x forward, y left, z up). `camX = -Y, camY = -Z, camZ = X`.
pub const OPTICAL_FROM_FLU: Matrix3<f64> = Matrix3::new(0.0, -1.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0);
