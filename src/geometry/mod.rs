//! Rigid transforms, Euler angles and handedness: float64, column vectors, names that read `dst_from_src`.
//!
//! ```
//! use ipm_rs::geometry::{Pose, flip_handedness_pose, rotation_from_euler};
//! use nalgebra::Vector3;
//!
//! # fn main() -> ipm_rs::Result<()> {
//! // a camera 1.5 m above the origin that looks 0.1 rad down
//! let vehicle_from_camera = Pose::new(rotation_from_euler(0.0, 0.1, 0.0), Vector3::new(0.0, 0.0, 1.5))?;
//! let ahead = vehicle_from_camera.transform(&Vector3::new(10.0, 0.0, 0.0));
//! assert!((ahead.z - (1.5 - 10.0 * 0.1f64.sin())).abs() < 1e-12);
//! let back = vehicle_from_camera.inverse().transform(&ahead);
//! assert!((back - Vector3::new(10.0, 0.0, 0.0)).norm() < 1e-12);
//! // the same pose where y points to the right, as simulators have it
//! assert_eq!(flip_handedness_pose(&vehicle_from_camera).transform(&Vector3::zeros()).z, 1.5);
//! # Ok(())
//! # }
//! ```

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
