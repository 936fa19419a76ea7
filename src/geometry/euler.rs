//! Euler angles in the one order of this crate.

use nalgebra::Matrix3;

/// `Rz(yaw) Ry(pitch) Rx(roll)`: turns vectors of the rotated body into its parent's frame.
///
/// Angles in radians, right-hand rule about x forward, y left, z up: positive pitch looks **down**, positive yaw turns
/// left, positive roll lifts the left side. Source: Cityscapes csCalibration.pdf, eq. (3), the ISO 8855 convention.
pub fn rotation_from_euler(roll: f64, pitch: f64, yaw: f64) -> Matrix3<f64> {
    let (sr, cr) = roll.sin_cos();
    let (sp, cp) = pitch.sin_cos();
    let (sy, cy) = yaw.sin_cos();
    Matrix3::new(
        cy * cp,
        cy * sp * sr - sy * cr,
        cy * sp * cr + sy * sr,
        sy * cp,
        sy * sp * sr + cy * cr,
        sy * sp * cr - cy * sr,
        -sp,
        cp * sr,
        cp * cr,
    )
}

/// (roll, pitch, yaw) of a rotation: undoes [`rotation_from_euler`] for pitches between -90 and 90 degrees. Looking
/// straight up or down, roll and yaw are not told apart and roll is 0.
pub fn euler_from_rotation(rotation: &Matrix3<f64>) -> (f64, f64, f64) {
    let pitch = (-rotation[(2, 0)]).clamp(-1.0, 1.0).asin();
    if rotation[(2, 1)].hypot(rotation[(2, 2)]) < 1e-12 {
        return (0.0, pitch, (-rotation[(0, 1)]).atan2(rotation[(1, 1)]));
    }
    (rotation[(2, 1)].atan2(rotation[(2, 2)]), pitch, rotation[(1, 0)].atan2(rotation[(0, 0)]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Rotation3, Vector3};

    #[test]
    fn equals_the_product_of_elementary_rotations() {
        let (roll, pitch, yaw) = (0.1, 0.2, 0.3);
        let product = Rotation3::from_axis_angle(&Vector3::z_axis(), yaw)
            * Rotation3::from_axis_angle(&Vector3::y_axis(), pitch)
            * Rotation3::from_axis_angle(&Vector3::x_axis(), roll);
        assert!((rotation_from_euler(roll, pitch, yaw) - product.matrix()).abs().max() < 1e-15);
    }

    #[test]
    fn positive_pitch_looks_down_positive_yaw_left_positive_roll_lifts_the_left_side() {
        assert!((rotation_from_euler(0.0, 0.1, 0.0) * Vector3::x()).z < 0.0);
        assert!((rotation_from_euler(0.0, 0.0, 0.1) * Vector3::x()).y > 0.0);
        assert!((rotation_from_euler(0.1, 0.0, 0.0) * Vector3::y()).z > 0.0);
    }

    #[test]
    fn angles_come_back() {
        for (roll, pitch, yaw) in [(0.1, 0.2, 0.3), (-3.0, -1.5, 2.9), (0.0, 0.0, 0.0)] {
            let (r, p, y) = euler_from_rotation(&rotation_from_euler(roll, pitch, yaw));
            assert!((r - roll).abs() < 1e-12 && (p - pitch).abs() < 1e-12 && (y - yaw).abs() < 1e-12);
        }
        let down = rotation_from_euler(0.3, std::f64::consts::FRAC_PI_2, 0.5);
        let (roll, pitch, yaw) = euler_from_rotation(&down);
        assert!((rotation_from_euler(roll, pitch, yaw) - down).abs().max() < 1e-12);
    }
}
