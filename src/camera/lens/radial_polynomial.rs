//! WoodScape's radial polynomial.

use nalgebra::Vector3;

use super::angle::angle_from_axis;
use super::{Distort, coefficients, direction, limit, listed, parameter, polynomial, shown};
use crate::error::Result;

/// A polynomial of the angle in pixels. With `r = sqrt(X^2 + Y^2)` and `t = atan2(r, Z)`:
/// `rho = k1 t + k2 t^2 + k3 t^3 + k4 t^4` pixels, `m = (X, Y) rho / r`. K is `[[1, 0, cx], [0, aspect, cy], [0, 0, 1]]`.
/// Source: the WoodScape data set (`radial_poly`).
///
/// Its domain ends at the first zero of the derivative of rho, or straight behind.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RadialPolynomial {
    k: [f64; 4],
    limit: Option<f64>,
    end: f64,
}

impl RadialPolynomial {
    /// A lens from k1, k2, k3, k4 in pixels per radian to the powers 1 to 4. `max_angle`, radians from the axis, makes
    /// the domain smaller.
    ///
    /// # Errors
    /// [`Error::LensCoefficients`](crate::Error::LensCoefficients) for another count than 4,
    /// [`Error::LensParameter`](crate::Error::LensParameter) for what is not finite, k1 that is not positive, or a limit
    /// that is none.
    pub fn new(given: &[f64], max_angle: Option<f64>) -> Result<Self> {
        const NAME: &str = "RadialPolynomial";
        let k = coefficients::<4>(NAME, "4 (k1, k2, k3, k4, in pixels)", &[4], given)?;
        parameter(NAME, "k1", "pixels per radian on the axis, above 0", k[0], k[0] > 0.0)?;
        let limit = limit(NAME, max_angle)?;
        let slope = [k[0], 2.0 * k[1], 3.0 * k[2], 4.0 * k[3]];
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
        let angle = polynomial::root_of_increasing(self.end, rho / k1, |t| {
            let value = t * (k1 + t * (k2 + t * (k3 + t * k4)));
            (value - rho, k1 + t * (2.0 * k2 + t * (3.0 * k3 + t * 4.0 * k4)))
        });
        Some(direction(m, rho, angle))
    }
}

impl Distort for RadialPolynomial {
    #[inline(always)]
    fn distort(&self, x: f64, y: f64, z: f64) -> (f64, f64) {
        let [k1, k2, k3, k4] = self.k;
        let r = (x * x + y * y).sqrt();
        let t = angle_from_axis(r, z);
        let t = if t <= self.end { t } else { f64::NAN };
        let rho = t * (k1 + t * (k2 + t * (k3 + t * k4)));
        let scale = if r > 0.0 { rho / r } else { rho };
        (x * scale, y * scale)
    }
}

impl std::fmt::Display for RadialPolynomial {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "RadialPolynomial([{}]{})", listed(&self.k), shown(self.limit))
    }
}
