//! A plane road.

use nalgebra::Vector3;

use super::is_edge_on;
use super::nodata::HIGHEST;
use crate::error::{Error, GroundError, Result, finite};

/// Smallest z of a plane's unit normal: beyond it the plane stands upright to 6e-8 degrees and has no height.
const UPRIGHT: f64 = 1e-9;

/// The plane `z = a + b x + c y` in the vehicle frame, metres: any but an upright one.
///
/// One above the camera is seen from below, as a ceiling is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    a: f64,
    b: f64,
    c: f64,
}

impl Plane {
    /// The plane through `point` at right angles to `normal`, which may have any length and either sign.
    ///
    /// # Errors
    /// [`Error::NotFinite`], and [`GroundError::Plane`] where the normal is zero or horizontal.
    pub fn new(normal: [f64; 3], point: [f64; 3]) -> Result<Self> {
        for value in normal {
            finite("normal", value)?;
        }
        for value in point {
            finite("point", value)?;
        }
        // the largest entry first, so that its square can neither overflow nor vanish
        let largest = normal.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
        let unit = (Vector3::from(normal) / largest).normalize();
        if unit.z.is_nan() || unit.z.abs() <= UPRIGHT {
            let problem = if largest == 0.0 { "a normal that is not zero," } else { "a plane that is not upright," };
            return Err(Error::Ground(GroundError::Plane { expected: problem, got: normal }));
        }
        let (b, c) = (-unit.x / unit.z, -unit.y / unit.z);
        Self::from_coefficients(point[2] - b * point[0] - c * point[1], b, c)
    }

    /// The plane `z = a + b x + c y`.
    ///
    /// # Errors
    /// [`Error::NotFinite`], and [`GroundError::Plane`] where it is upright, or farther than 100 km above or below the
    /// vehicle.
    pub fn from_coefficients(a: f64, b: f64, c: f64) -> Result<Self> {
        for value in [a, b, c] {
            finite("Plane", value)?;
        }
        if a.abs() > HIGHEST {
            let expected = "a height at the vehicle of at most 100 000 m, in (a, b, c) of z = a + b x + c y,";
            return Err(Error::Ground(GroundError::Plane { expected, got: [a, b, c] }));
        }
        if b.hypot(c) > 2.0 * UPRIGHT.recip() {
            let expected = "slopes of at most 2e9, in (a, b, c) of z = a + b x + c y,";
            return Err(Error::Ground(GroundError::Plane { expected, got: [a, b, c] }));
        }
        Ok(Self { a, b, c })
    }

    /// The plane that is at `height` below (above) the vehicle's origin, climbs `slope` ahead and `bank` to the left:
    /// `z = height + tan(slope) x + tan(bank) y`. Radians.
    ///
    /// Positive slope is uphill; positive bank lifts the left side, as positive roll does.
    ///
    /// # Errors
    /// [`Error::NotFinite`], and [`GroundError::Plane`] where an angle is a quarter turn or more.
    pub fn from_angles(slope: f64, bank: f64, height: f64) -> Result<Self> {
        for (what, value) in [("slope", slope), ("bank", bank), ("height", height)] {
            finite(what, value)?;
        }
        let steepest = std::f64::consts::FRAC_PI_2 - UPRIGHT;
        if slope.abs() > steepest || bank.abs() > steepest {
            let expected = "a slope and a bank of less than a quarter turn, in radians,";
            return Err(Error::Ground(GroundError::Plane { expected, got: [slope, bank, height] }));
        }
        Self::from_coefficients(height, slope.tan(), bank.tan())
    }

    /// The plane `z = height`.
    pub(super) fn level(height: f64) -> Self {
        Self { a: height, b: 0.0, c: 0.0 }
    }

    /// (a, b, c) of `z = a + b x + c y`.
    pub fn coefficients(&self) -> [f64; 3] {
        [self.a, self.b, self.c]
    }

    /// The unit normal that points up.
    pub fn normal(&self) -> Vector3<f64> {
        Vector3::new(-self.b, -self.c, 1.0).normalize()
    }

    /// z at (x, y).
    #[inline]
    pub fn height_at(&self, x: f64, y: f64) -> f64 {
        if self.b == 0.0 && self.c == 0.0 {
            return self.a; // also where x or y is not finite
        }
        self.a + self.b * x + self.c * y
    }

    /// Whether the plane passes through `eye`, from where it is a line and not a road.
    pub(crate) fn is_edge_on(&self, eye: &Vector3<f64>) -> bool {
        is_edge_on(self.height_at(eye.x, eye.y) - eye.z)
    }

    /// Where the ray from `origin` along `direction` meets the plane; nowhere where the plane passes through `origin`.
    pub(super) fn intersect(&self, origin: &Vector3<f64>, direction: &Vector3<f64>) -> Option<Vector3<f64>> {
        let above = self.height_at(origin.x, origin.y) - origin.z;
        let distance = above / (direction.z - self.b * direction.x - self.c * direction.y);
        let point = origin + direction * distance;
        // a ray within rounding of the horizon ends at infinity
        (distance > 0.0 && !is_edge_on(above) && point.x.is_finite() && point.y.is_finite())
            .then(|| Vector3::new(point.x, point.y, self.height_at(point.x, point.y)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_forms_agree() {
        let (slope, bank) = (0.05_f64, -0.02_f64);
        let plane = Plane::from_angles(slope, bank, -0.3).unwrap();
        assert_eq!(plane.coefficients(), [-0.3, slope.tan(), bank.tan()]);
        for scale in [1.0, -7.0, 1e200, 1e-200] {
            let normal = (plane.normal() * scale).into();
            let again = Plane::new(normal, [10.0, 2.0, plane.height_at(10.0, 2.0)]).unwrap();
            for (again, once) in again.coefficients().into_iter().zip(plane.coefficients()) {
                assert!((again - once).abs() < 1e-15, "{scale}");
            }
        }
        assert!((plane.height_at(1.0, 0.0) + 0.3 - slope.tan()).abs() < 1e-16, "uphill ahead");
    }

    #[test]
    fn a_ray_meets_the_plane_where_both_are() {
        let plane = Plane::from_angles(0.05, -0.02, -0.3).unwrap();
        let origin = Vector3::new(1.0, 0.2, 1.4);
        let direction = Vector3::new(1.0, 0.3, -0.1);
        let point = plane.intersect(&origin, &direction).unwrap();
        assert!((point - origin).cross(&direction).norm() < 1e-12);
        assert_eq!(point.z, plane.height_at(point.x, point.y));
        assert_eq!(plane.intersect(&origin, &-direction), None, "behind");
        assert_eq!(plane.intersect(&origin, &Vector3::new(1.0, 0.0, 0.06)), None, "steeper than the road");
        assert!(plane.intersect(&origin, &Vector3::new(1.0, 0.0, 0.04)).is_some(), "uphill");
    }

    #[test]
    fn a_plane_through_the_eye_is_met_nowhere() {
        let plane = Plane::from_angles(0.05, -0.02, -0.3).unwrap();
        let eye = Vector3::new(1.0, 0.2, plane.height_at(1.0, 0.2));
        for off in [0.0, 4e-16, -4e-16] {
            let eye = eye + Vector3::z() * off;
            assert!(plane.is_edge_on(&eye));
            assert_eq!(plane.intersect(&eye, &Vector3::new(1.0, 0.0, -0.1)), None);
        }
        assert!(!plane.is_edge_on(&(eye + Vector3::z() * 1e-3)));
    }

    #[test]
    fn refuses_what_has_no_height() {
        assert!(matches!(Plane::new([0.0; 3], [0.0; 3]), Err(Error::Ground(GroundError::Plane { .. }))));
        assert!(matches!(Plane::new([1.0, 2.0, 1e-12], [0.0; 3]), Err(Error::Ground(GroundError::Plane { .. }))));
        assert!(matches!(Plane::new([f64::NAN, 0.0, 1.0], [0.0; 3]), Err(Error::NotFinite { what: "normal", .. })));
        assert!(matches!(Plane::new([0.0, 0.0, 1.0], [0.0, f64::INFINITY, 0.0]), Err(Error::NotFinite { .. })));
        assert!(matches!(Plane::from_coefficients(0.0, f64::NAN, 0.0), Err(Error::NotFinite { .. })));
        assert!(matches!(Plane::from_angles(1.6, 0.0, 0.0), Err(Error::Ground(GroundError::Plane { .. }))));
    }
}
