//! Left-handed (CARLA, Unreal: x forward, y right, z up) to right-handed (ISO 8855: y left) and back.
//!
//! Every function mirrors y, so each is its own inverse. With `S = diag(1, -1, 1)` a vector becomes `S v` and a rotation
//! `S R S`; `S R S` has the determinant of `R`, +1 on both sides, so a determinant cannot tell whether a mirror is missing.

use nalgebra::{Matrix3, Vector3};

use super::Pose;

/// (x, y, z) -> (x, -y, z).
pub fn flip_handedness_point(point: Vector3<f64>) -> Vector3<f64> {
    Vector3::new(point.x, -point.y, point.z)
}

/// (roll, pitch, yaw) -> (roll, -pitch, -yaw), any angular unit.
///
/// On the left-handed side the angles are CARLA's (`carla.Rotation`: positive pitch lifts the nose, positive yaw turns
/// right); on the right-handed side those of [`rotation_from_euler`](super::rotation_from_euler).
pub fn flip_handedness_euler(roll: f64, pitch: f64, yaw: f64) -> (f64, f64, f64) {
    (roll, -pitch, -yaw)
}

/// `S R S` with `S = diag(1, -1, 1)`.
pub fn flip_handedness_rotation(rotation: &Matrix3<f64>) -> Matrix3<f64> {
    let mut flipped = *rotation;
    for (row, column) in [(0, 1), (1, 0), (1, 2), (2, 1)] {
        flipped[(row, column)] = -flipped[(row, column)];
    }
    flipped
}

/// `S T S` with `S = diag(1, -1, 1, 1)`: both frames of the transform change hand.
pub fn flip_handedness_pose(pose: &Pose) -> Pose {
    pose.map(flip_handedness_rotation, |translation| flip_handedness_point(*translation))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::rotation_from_euler;

    /// CARLA's matrix is `Rz(yaw) Ry(-pitch) Rx(-roll)` of its own angles.
    fn carla_rotation(roll: f64, pitch: f64, yaw: f64) -> Matrix3<f64> {
        rotation_from_euler(-roll, -pitch, yaw)
    }

    #[test]
    fn angles_and_matrices_agree() {
        for (roll, pitch, yaw) in [(10.0, 20.0, 30.0), (-3.0, 80.0, 170.0), (90.0, -45.0, 1.0)] {
            let (roll, pitch, yaw) = (f64::to_radians(roll), f64::to_radians(pitch), f64::to_radians(yaw));
            let (r, p, y) = flip_handedness_euler(roll, pitch, yaw);
            let flipped = flip_handedness_rotation(&carla_rotation(roll, pitch, yaw));
            assert!((flipped - rotation_from_euler(r, p, y)).abs().max() < 1e-15);
        }
    }

    #[test]
    fn a_mirrored_pose_moves_mirrored_points() {
        let pose = Pose::new(rotation_from_euler(0.1, 0.2, 0.3), Vector3::new(1.0, 2.0, 3.0)).unwrap();
        let point = Vector3::new(-4.0, 5.0, 6.0);
        let expected = flip_handedness_point(pose.transform(&point));
        let got = flip_handedness_pose(&pose).transform(&flip_handedness_point(point));
        assert!((got - expected).abs().max() < 1e-14);
        assert_eq!(flip_handedness_pose(&flip_handedness_pose(&pose)), pose);
    }
}
