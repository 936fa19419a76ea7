//! Kannala-Brandt: an odd polynomial of the angle.

use nalgebra::Vector3;

use super::angle::angle_from_axis;
use super::{Distort, coefficients, direction, limit, listed, polynomial, shown};
use crate::error::Result;

/// The equidistant fisheye, also called KB4. With `r = sqrt(X^2 + Y^2)` and `t = atan2(r, Z)`:
/// `rho = t (1 + k1 t^2 + k2 t^4 + k3 t^6 + k4 t^8)`, `m = (X, Y) rho / r`, right beyond 90 degrees too (OpenCV's
/// `fisheye.projectPoints` takes atan(r / Z) there, of the mirrored ray). Source: Kannala and Brandt 2006; OpenCV,
/// calib3d, "Fisheye camera model".
///
/// Its domain ends at the first zero of the derivative of rho, or straight behind.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KannalaBrandt {
    k: [f64; 4],
    limit: Option<f64>,
    end: f64,
}

impl KannalaBrandt {
    /// A lens from k1, k2, k3, k4. `max_angle`, radians from the axis, makes the domain smaller.
    ///
    /// # Errors
    /// [`Error::LensCoefficients`](crate::Error::LensCoefficients) for another count than 4,
    /// [`Error::LensParameter`](crate::Error::LensParameter) for what is not finite or a limit that is none.
    pub fn new(given: &[f64], max_angle: Option<f64>) -> Result<Self> {
        let k = coefficients("KannalaBrandt", "4 (k1, k2, k3, k4)", &[4], given)?;
        let limit = limit("KannalaBrandt", max_angle)?;
        let slope = [1.0, 0.0, 3.0 * k[0], 0.0, 5.0 * k[1], 0.0, 7.0 * k[2], 0.0, 9.0 * k[3]];
        let end = polynomial::positive_until(&slope, limit).unwrap_or(limit);
        Ok(Self { k, limit: max_angle, end })
    }

    /// k1, k2, k3, k4.
    pub fn coefficients(&self) -> &[f64; 4] {
        &self.k
    }

    /// The limit that was given.
    pub fn limit(&self) -> Option<f64> {
        self.limit
    }

    /// The validity limit, radians from the axis.
    pub fn max_angle(&self) -> f64 {
        self.end
    }

    pub(super) fn undistort(&self, m: [f64; 2]) -> Option<Vector3<f64>> {
        let [k1, k2, k3, k4] = self.k;
        let rho = m[0].hypot(m[1]);
        let angle = polynomial::root_of_increasing(self.end, rho, |t| {
            let u = t * t;
            let value = t * (1.0 + u * (k1 + u * (k2 + u * (k3 + u * k4))));
            (value - rho, 1.0 + u * (3.0 * k1 + u * (5.0 * k2 + u * (7.0 * k3 + u * 9.0 * k4))))
        });
        Some(direction(m, rho, angle))
    }
}

impl Distort for KannalaBrandt {
    #[inline(always)]
    fn distort(&self, x: f64, y: f64, z: f64) -> (f64, f64) {
        let [k1, k2, k3, k4] = self.k;
        let r = (x * x + y * y).sqrt();
        let t = angle_from_axis(r, z);
        let t = if t <= self.end { t } else { f64::NAN };
        let u = t * t;
        let rho = t * (1.0 + u * (k1 + u * (k2 + u * (k3 + u * k4))));
        // on the axis itself both are 0
        let scale = if r > 0.0 { rho / r } else { rho };
        (x * scale, y * scale)
    }
}

impl std::fmt::Display for KannalaBrandt {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "KannalaBrandt([{}]{})", listed(&self.k), shown(self.limit))
    }
}
