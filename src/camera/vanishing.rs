//! A camera from where parallel lines of the road meet.

use nalgebra::{Matrix3, Vector3};

use super::{Camera, Lens, Pinhole};
use crate::error::{Error, PointsError, Result, finite, radians};
use crate::geometry::OPTICAL_FROM_FLU;

/// Pixels: lines that meet farther out are parallel in the image, but for rounding.
const FARTHEST: f64 = 1e9;

/// The unit vector nearest to being at right angles to all of these unit vectors; `None` where they are all one.
fn across_all(normals: &[Vector3<f64>]) -> Option<Vector3<f64>> {
    /// Least squared sine between them.
    const LEAST: f64 = 1e-18;
    if let [one, other] = normals {
        let along = one.cross(other);
        return (along.norm_squared() > LEAST).then(|| along.normalize());
    }
    let sum: Matrix3<f64> = normals.iter().map(|normal| normal * normal.transpose()).sum();
    let eigen = sum.symmetric_eigen();
    let (least, _) = eigen.eigenvalues.argmin();
    let second = (0..3).filter(|&k| k != least).map(|k| eigen.eigenvalues[k]).fold(f64::INFINITY, f64::min);
    (second > 1e-12).then(|| eigen.eigenvectors.column(least).into())
}

impl Camera {
    /// A camera from the pixel towards which the vehicle's x axis points, the point where lane markings along it meet:
    /// its direction gives pitch and yaw; roll, which it does not tell, is given.
    ///
    /// With w that direction in axes x forward, y left, z up of the camera, `Rx(roll) w = (cos pitch cos yaw, -sin yaw,
    /// sin pitch cos yaw)`.
    ///
    /// # Errors
    /// [`PointsError::Unfit`] where the lens has no direction for the pixel, [`Error::NotFinite`], and those of
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
        radians("roll", roll)?;
        let at_origin = Self::new(model, image_size, Self::forward_pose())?.with_lens(lens);
        let Some(ray) = at_origin.ray(vanishing_point) else {
            let expected = "a pixel that the lens gives a direction";
            return Err(Error::Points(PointsError::Unfit {
                what: WHAT,
                expected,
                got: format!("{vanishing_point:?}"),
            }));
        };
        let w: Vector3<f64> = OPTICAL_FROM_FLU.transpose() * ray.normalize();
        let (sin, cos) = roll.sin_cos();
        let (left, up) = (cos * w.y - sin * w.z, sin * w.y + cos * w.z);
        let (pitch, yaw) = (up.atan2(w.x), (-left).clamp(-1.0, 1.0).asin());
        Ok(Self::from_euler(model, image_size, position, roll, pitch, yaw)?.with_lens(lens))
    }

    /// The pixel where straight lines that are parallel on the road meet, from two pixels of each in a raw picture: a lens
    /// bends the lines, so what meets are the planes through them and the optical centre. Of two lines it is the direction
    /// in both planes, of more the one with the least sum of squared sines of its angles to them.
    ///
    /// # Errors
    /// [`PointsError::Unfit`] where there are fewer than two lines, a pixel has no direction, both of a line or all
    /// lines are in one place, or the direction has no pixel; [`Error::NotFinite`].
    pub fn vanishing_point(&self, lines: &[[[f64; 2]; 2]]) -> Result<[f64; 2]> {
        const WHAT: &str = "lines";
        let refuse = |expected, got| Err(Error::Points(PointsError::Unfit { what: WHAT, expected, got }));
        if lines.len() < 2 {
            return refuse("at least two", lines.len().to_string());
        }
        let mut normals = Vec::with_capacity(lines.len());
        for (index, ends) in lines.iter().enumerate() {
            let mut rays = [Vector3::zeros(); 2];
            for (ray, pixel) in rays.iter_mut().zip(ends) {
                for &value in pixel {
                    finite(WHAT, value)?;
                }
                let Some(seen) = self.ray(*pixel) else {
                    return refuse("pixels that the lens gives a direction", format!("{pixel:?} of line {index}"));
                };
                *ray = seen.normalize();
            }
            let normal = rays[0].cross(&rays[1]);
            if normal.norm() <= 1e-12 {
                return refuse("two different points for each", format!("line {index} with both points in one place"));
            }
            normals.push(normal.normalize());
        }
        let Some(along) = across_all(&normals) else {
            return refuse("lines that meet", format!("{} that are one and the same", lines.len()));
        };
        // a line has two ends: the one that the camera sees, ahead of it if it sees both
        let ahead = if along.z < 0.0 { -along } else { along };
        match self.pixel_of(&ahead).or_else(|| self.pixel_of(&-ahead)) {
            Some(pixel) if pixel.iter().all(|value| value.abs() < FARTHEST) => Ok(pixel),
            _ => refuse("lines that meet where the camera looks", format!("ones along {:?}", ahead.as_slice())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::KannalaBrandt;
    use crate::geometry::euler_from_rotation;

    #[test]
    fn through_a_lens_lines_meet_where_their_direction_is_seen() {
        let model = Pinhole::new(402.0, 398.0, 655.0, 470.0, 0.0).unwrap();
        let lens = KannalaBrandt::new(&[0.05, -0.012, 0.002, -0.0004], None).unwrap();
        let bent = Camera::from_euler(model, (1300, 940), [0.3, 0.1, 1.5], 0.02, 0.25, -0.1)
            .unwrap()
            .with_lens(Some(lens.into()));
        for camera in [bent, bent.with_lens(None)] {
            let line = |y: f64| [2.2, 13.0].map(|x| camera.project(&Vector3::new(x, y, 0.0)).pixel);
            let lines = [line(-2.0), line(1.3), line(3.6), line(0.2)];
            let [u, v] = camera.project(&(camera.position() + Vector3::x() * 1e12)).pixel;
            for lines in [&lines[..2], &lines[1..3], &lines] {
                let found = camera.vanishing_point(lines).unwrap();
                assert!((found[0] - u).abs() < 1e-7 && (found[1] - v).abs() < 1e-7, "{found:?} {u} {v}");
            }
            let mut clicked = lines;
            clicked[2][0][1] += 1.5;
            let found = camera.vanishing_point(&clicked).unwrap();
            assert!((found[0] - u).hypot(found[1] - v) < 8.0);
            let off = [0.0, f64::NAN];
            assert!(camera.vanishing_point(&lines[..1]).is_err());
            assert!(camera.vanishing_point(&[lines[0], lines[0]]).is_err());
            assert!(camera.vanishing_point(&[lines[0], lines[0], lines[0]]).is_err());
            assert!(camera.vanishing_point(&[lines[0], [[5.0, 5.0]; 2]]).is_err());
            assert!(matches!(camera.vanishing_point(&[lines[0], [[0.0; 2], off]]), Err(Error::NotFinite { .. })));
        }
        let outside = [[-4000.0, 3000.0], [600.0, 300.0]];
        assert!(matches!(bent.vanishing_point(&[outside, outside]), Err(Error::Points(PointsError::Unfit { .. }))));
    }

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
