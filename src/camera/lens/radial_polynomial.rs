//! WoodScape's radial polynomial.

use super::of_angle::{Curve, OfAngle};
use super::{listed, parameter, shown};
use crate::error::Result;

/// A polynomial of the angle in pixels. With `r = sqrt(X^2 + Y^2)` and `t = atan2(r, Z)`:
/// `rho = k1 t + k2 t^2 + k3 t^3 + k4 t^4` pixels, `m = (X, Y) rho / r`. K is `[[1, 0, cx], [0, aspect, cy], [0, 0, 1]]`.
/// Source: the WoodScape data set (`radial_poly`).
///
/// Its domain ends at the first zero of the derivative of rho, or straight behind.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RadialPolynomial(Curve);

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
        let slope = |k: &[f64; 4]| {
            parameter(NAME, "k1", "pixels per radian on the axis, above 0", k[0], k[0] > 0.0)?;
            Ok([k[0], 2.0 * k[1], 3.0 * k[2], 4.0 * k[3]])
        };
        Curve::new(NAME, "4 (k1, k2, k3, k4, in pixels)", given, max_angle, slope).map(Self)
    }

    /// k1, k2, k3, k4.
    pub fn coefficients(&self) -> &[f64; 4] {
        &self.0.k
    }

    /// The limit that was given.
    pub fn limit(&self) -> Option<f64> {
        self.0.limit
    }

    /// The validity limit, radians from the axis.
    pub fn max_angle(&self) -> f64 {
        self.0.end
    }
}

impl OfAngle for RadialPolynomial {
    #[inline(always)]
    fn curve(&self) -> &Curve {
        &self.0
    }

    #[inline(always)]
    fn radius(&self, t: f64) -> f64 {
        let [k1, k2, k3, k4] = self.0.k;
        t * (k1 + t * (k2 + t * (k3 + t * k4)))
    }

    #[inline(always)]
    fn slope(&self, t: f64) -> f64 {
        let [k1, k2, k3, k4] = self.0.k;
        k1 + t * (2.0 * k2 + t * (3.0 * k3 + t * 4.0 * k4))
    }
}

impl std::fmt::Display for RadialPolynomial {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "RadialPolynomial([{}]{})", listed(&self.0.k), shown(self.0.limit))
    }
}
