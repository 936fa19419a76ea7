//! WoodScape's radial polynomial.

use nalgebra::Vector3;

use super::of_angle::OfAngle;
use super::{Distort, coefficients, limit, listed, parameter, shown};
use crate::error::Result;

/// A polynomial of the angle in pixels. With `r = sqrt(X^2 + Y^2)` and `t = atan2(r, Z)`:
/// `rho = k1 t + k2 t^2 + k3 t^3 + k4 t^4` pixels, `m = (X, Y) rho / r`. K is `[[1, 0, cx], [0, aspect, cy], [0, 0, 1]]`.
/// Source: the WoodScape data set (`radial_poly`).
///
/// Its domain ends at the first zero of the derivative of rho, or straight behind.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RadialPolynomial {
    limit: Option<f64>,
    rho: OfAngle<4, 1>,
}

impl RadialPolynomial {
    /// A lens from k1, k2, k3, k4 in pixels per radian to the powers 1 to 4. `max_angle`, radians from the axis, makes
    /// the domain smaller.
    ///
    /// # Errors
    /// [`LensError::Coefficients`](crate::error::LensError::Coefficients) for another count than 4,
    /// [`LensError::Parameter`](crate::error::LensError::Parameter) for what is not finite, k1 that is not positive, or
    /// a limit that is none, [`LensError::Folds`](crate::error::LensError::Folds) where the image folds back at once.
    pub fn new(given: &[f64], max_angle: Option<f64>) -> Result<Self> {
        const NAME: &str = "RadialPolynomial";
        const ORDER: &str = "4 (k1, k2, k3, k4, in pixels)";
        let k = coefficients(NAME, ORDER, &[4], given)?;
        parameter(NAME, "k1", "pixels per radian on the axis, above 0", k[0], k[0] > 0.0)?;
        Ok(Self { limit: max_angle, rho: OfAngle::new(NAME, ORDER, k, limit(NAME, max_angle)?)? })
    }

    /// k1, k2, k3, k4.
    pub fn coefficients(&self) -> &[f64; 4] {
        self.rho.coefficients()
    }

    /// The limit that was given.
    pub fn limit(&self) -> Option<f64> {
        self.limit
    }

    /// The validity limit, radians from the axis.
    pub fn max_angle(&self) -> f64 {
        self.rho.end()
    }

    pub(super) fn undistort(&self, m: [f64; 2]) -> Option<Vector3<f64>> {
        Some(self.rho.undistort(m))
    }
}

impl Distort for RadialPolynomial {
    #[inline(always)]
    fn distort(&self, x: f64, y: f64, z: f64) -> (f64, f64) {
        self.rho.distort(x, y, z)
    }
}

impl std::fmt::Display for RadialPolynomial {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "RadialPolynomial([{}]{})", listed(self.coefficients()), shown(self.limit))
    }
}
