//! A camera from where parallel lines of the road meet.

use nalgebra::Vector3;

use super::{Camera, Lens, Pinhole};
use crate::error::{Error, Result, finite};
use crate::geometry::OPTICAL_FROM_FLU;

impl Camera {
    /// A camera from the pixel towards which the vehicle's x axis points, the point where lane markings along it meet:
    /// its direction gives pitch and yaw; roll, which it does not tell, is given.
    ///
    /// With w that direction in axes x forward, y left, z up of the camera, `Rx(roll) w = (cos pitch cos yaw, -sin yaw,
    /// sin pitch cos yaw)`.
    ///
    /// # Errors
    /// [`Error::Points`] where the lens has no direction for the pixel, [`Error::NotFinite`], and those of
    /// [`Camera::from_euler`].
    pub fn from_vanishing_point(
        model: Pinhole,
        lens: Option<Lens>,
        image_size: (u32, u32),
        vanishing_point: [f64; 2],
        position: [f64; 3],
        roll: f64,
    ) -> Result<Self> {
        const WHAT: &str = "vanishing_point";
        for value in vanishing_point {
            finite(WHAT, value)?;
        }
        finite("roll", roll)?;
        let at_origin = Self::new(model, image_size, Self::forward_pose())?.with_lens(lens);
        let Some(ray) = at_origin.ray(vanishing_point) else {
            let expected = "a pixel that the lens gives a direction";
            return Err(Error::Points { what: WHAT, expected, got: format!("{vanishing_point:?}") });
        };
        let w: Vector3<f64> = OPTICAL_FROM_FLU.transpose() * ray.normalize();
        let (sin, cos) = roll.sin_cos();
        let (left, up) = (cos * w.y - sin * w.z, sin * w.y + cos * w.z);
        let (pitch, yaw) = (up.atan2(w.x), (-left).clamp(-1.0, 1.0).asin());
        Ok(Self::from_euler(model, image_size, position, roll, pitch, yaw)?.with_lens(lens))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::KannalaBrandt;
    use crate::geometry::euler_from_rotation;

    #[test]
    fn is_the_camera_that_sees_the_point_there() {
        let model = Pinhole::new(900.0, 910.0, 640.0, 355.0, 1.0).unwrap();
        let fisheye = Lens::from(KannalaBrandt::new(&[0.03, -0.01, 0.0, 0.0], None).unwrap());
        for lens in [None, Some(fisheye)] {
            for (roll, pitch, yaw) in [(0.0, 0.05, 0.0), (0.03, 0.2, -0.3), (-0.5, -0.4, 0.6), (2.0, 0.1, 0.1)] {
                let position = [1.5, -0.2, 1.3];
                let camera =
                    Camera::from_euler(model, (1280, 720), position, roll, pitch, yaw).unwrap().with_lens(lens);
                let far = camera.position() + Vector3::x() * 1e9;
                let found =
                    Camera::from_vanishing_point(model, lens, (1280, 720), camera.project(&far).pixel, position, roll);
                let found = found.unwrap();
                let attitude = found.vehicle_from_camera().rotation() * OPTICAL_FROM_FLU;
                let angles = euler_from_rotation(&attitude);
                let off = [angles.0 - roll, angles.1 - pitch, angles.2 - yaw].map(f64::abs);
                assert!(off.into_iter().fold(0.0, f64::max) < 1e-8, "{angles:?}");
                assert!((found.position() - camera.position()).norm() < 1e-12);
            }
        }
        let nan = Camera::from_vanishing_point(model, None, (8, 8), [f64::NAN, 0.0], [0.0; 3], 0.0);
        assert!(matches!(nan, Err(Error::NotFinite { what: "vanishing_point", .. })));
    }
}
