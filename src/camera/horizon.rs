//! The horizon of a plane.

use nalgebra::Vector3;

use super::trace::Tracer;
use super::{Camera, check_tracing};
use crate::error::{CameraError, Error, Result};
use crate::ground::Plane;

/// Parts in which the circle of the horizon's directions is looked at.
const PARTS: usize = 32;

impl Camera {
    /// The horizon of a plane on the image, clipped to the rectangle of pixel centres: pixels whose rays run along the
    /// plane and never meet it. A line of two points through a pinhole; curves, to `tolerance` pixels, through a lens;
    /// nothing where the camera does not see it.
    ///
    /// # Errors
    /// [`CameraError::Tracing`] for a tolerance below 0.001 pixel, [`CameraError::Winding`] for a horizon that no
    /// reasonable number of points follows.
    pub fn horizon(&self, plane: &Plane, tolerance: f64) -> Result<Vec<Vec<[f64; 2]>>> {
        check_tracing(0.0, tolerance)?;
        let mut tracer = Tracer::new(self.image_size(), 0.0, tolerance);
        // from behind once around: where the camera does not see everything, the ends are not in its image
        let normal = plane.normal();
        let ahead = self.optical_axis() - normal * self.optical_axis().dot(&normal);
        let ahead = if ahead.norm() > 1e-9 { ahead } else { normal.cross(&Vector3::x()) };
        let back = -ahead.normalize();
        let side = normal.cross(&back);
        let image = |angle: f64| {
            let (sin, cos) = angle.sin_cos();
            self.pixel_of_direction(&(back * cos + side * sin))
        };
        use std::f64::consts::{FRAC_PI_2, TAU};
        if self.lens().is_none() {
            // the half of the circle that lies ahead is a straight line
            tracer.straight(&|t| image(FRAC_PI_2 + t * 2.0 * FRAC_PI_2))?;
        } else {
            tracer.curve(PARTS, &|t| image(if t == 1.0 { 0.0 } else { t * TAU }))?;
        }
        Ok(tracer.finish())
    }

    /// The horizon of a plane as (a, b, c), `a u + b v + c = 0` with `a^2 + b^2 = 1`: the distance of a pixel from it,
    /// positive below. `K^-T R n`, n the plane's normal. `None` where the image is parallel to the plane, so that the
    /// horizon lies at infinity.
    ///
    /// # Errors
    /// [`CameraError::Horizon`] behind a lens, which bends it.
    pub fn horizon_line(&self, plane: &Plane) -> Result<Option<[f64; 3]>> {
        if let Some(lens) = self.lens() {
            return Err(Error::Camera(CameraError::Horizon { lens: lens.name() }));
        }
        // K^T is a lower triangle, and its determinant may be beyond float64
        let (k, normal) = (self.intrinsics(), self.camera_from_vehicle().rotation() * plane.normal());
        let a = normal.x / k[(0, 0)];
        let b = (normal.y - k[(0, 1)] * a) / k[(1, 1)];
        let line = -Vector3::new(a, b, normal.z - k[(0, 2)] * a - k[(1, 2)] * b);
        let norm = line.x.hypot(line.y);
        // in pixels beyond anything: rounding of a camera that looks straight down
        let seen = norm * 1e12 > line.z.abs();
        Ok(seen.then(|| (line / norm).into()))
    }

    /// The pixel that looks along a direction of the vehicle frame.
    fn pixel_of_direction(&self, direction: &Vector3<f64>) -> Option<[f64; 2]> {
        let in_camera = self.camera_from_vehicle().rotation() * direction;
        self.pixel_of(&in_camera)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Ground;
    use crate::camera::{KannalaBrandt, Lens, Pinhole};

    fn camera(roll: f64, pitch: f64) -> Camera {
        let model = Pinhole::new(400.0, 410.0, 330.0, 230.0, 2.5).unwrap();
        Camera::from_euler(model, (640, 480), [1.5, 0.3, 1.4], roll, pitch, -0.3).unwrap()
    }

    #[test]
    fn the_line_of_a_tiny_focal_length_is_a_line() {
        let model = Pinhole::new(1e-163, 1e-163, 320.0, 240.0, 0.0).unwrap();
        let camera = Camera::from_euler(model, (640, 480), [0.0, 0.0, 1.4], 0.0, 0.1, 0.0).unwrap();
        let [a, b, c] = camera.horizon_line(&Plane::from_angles(0.0, 0.0, 0.0).unwrap()).unwrap().unwrap();
        // the horizon passes through the principal point, as all does
        assert!((a, b) == (0.0, 1.0) && (c + 240.0).abs() < 1e-9, "{a} {b} {c}");
    }

    #[test]
    fn the_line_is_where_rays_run_along_the_plane() {
        let plane = Plane::from_angles(0.05, -0.03, -0.2).unwrap();
        for (roll, pitch) in [(0.0, 0.1), (0.2, 0.2), (-0.3, -0.1)] {
            let camera = camera(roll, pitch);
            let [a, b, c] = camera.horizon_line(&plane).unwrap().unwrap();
            let pieces = camera.horizon(&plane, 0.25).unwrap();
            assert_eq!((pieces.len(), pieces[0].len()), (1, 2), "two ends");
            for [u, v] in pieces.concat() {
                assert!((a * u + b * v + c).abs() < 1e-9);
                assert!(camera.unproject([u, v]).unwrap().dot(&plane.normal()).abs() < 1e-12);
                let ground = Ground::from(plane);
                let (below, above) = ([u + 2.0 * a, v + 2.0 * b], [u - 2.0 * a, v - 2.0 * b]);
                assert!(camera.ground_from_pixel(below, &ground).is_some());
                assert!(camera.ground_from_pixel(above, &ground).is_none());
                assert!((a * below[0] + b * below[1] + c - 2.0).abs() < 1e-9, "positive below");
            }
        }
        assert!(camera(0.0, 1.2).horizon(&plane, 0.25).unwrap().is_empty(), "looks below it");
        let level = Plane::from_coefficients(0.0, 0.0, 0.0).unwrap();
        assert_eq!(camera(0.0, std::f64::consts::FRAC_PI_2).horizon_line(&level).unwrap(), None);
        assert!(camera(0.0, std::f64::consts::FRAC_PI_2).horizon(&level, 0.25).unwrap().is_empty());
    }

    #[test]
    fn a_lens_bends_it() {
        let fisheye: Lens = KannalaBrandt::new(&[0.05, -0.02, 0.003, 0.0], Some(1.9)).unwrap().into();
        let plane = Plane::from_angles(0.05, -0.03, -0.2).unwrap();
        let camera = camera(0.1, 0.4).with_lens(fisheye);
        let pieces = camera.horizon(&plane, 0.1).unwrap();
        assert_eq!(pieces.len(), 1);
        let line = &pieces[0];
        for &pixel in line {
            // a clipped end lies on the chord of two others
            assert!(camera.unproject(pixel).unwrap().dot(&plane.normal()).abs() * 400.0 < 0.2);
        }
        for ends in line.windows(2) {
            let middle = [0, 1].map(|axis| 0.5 * (ends[0][axis] + ends[1][axis]));
            assert!(camera.unproject(middle).unwrap().dot(&plane.normal()).abs() * 400.0 < 0.2);
        }
        assert!(line.len() > 5);
        assert!(matches!(
            camera.horizon_line(&plane),
            Err(Error::Camera(CameraError::Horizon { lens: "KannalaBrandt" }))
        ));
    }
}
