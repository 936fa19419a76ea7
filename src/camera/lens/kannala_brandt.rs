//! Kannala-Brandt: an odd polynomial of the angle.

use super::of_angle::{Curve, OfAngle};
use super::{listed, shown};
use crate::error::Result;

/// The equidistant fisheye, also called KB4. With `r = sqrt(X^2 + Y^2)` and `t = atan2(r, Z)`:
/// `rho = t (1 + k1 t^2 + k2 t^4 + k3 t^6 + k4 t^8)`, `m = (X, Y) rho / r`, right beyond 90 degrees too (OpenCV's
/// `fisheye.projectPoints` takes atan(r / Z) there, of the mirrored ray). Source: Kannala and Brandt 2006; OpenCV,
/// calib3d, "Fisheye camera model".
///
/// Its domain ends at the first zero of the derivative of rho, or straight behind.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KannalaBrandt(Curve);

impl KannalaBrandt {
    /// A lens from k1, k2, k3, k4. `max_angle`, radians from the axis, makes the domain smaller.
    ///
    /// # Errors
    /// [`LensError::Coefficients`](crate::error::LensError::Coefficients) for another count than 4,
    /// [`LensError::Parameter`](crate::error::LensError::Parameter) for what is not finite or a limit that is none,
    /// [`LensError::Folds`](crate::error::LensError::Folds) where the image folds back at once.
    pub fn new(given: &[f64], max_angle: Option<f64>) -> Result<Self> {
        let slope = |k: &[f64; 4]| Ok([1.0, 0.0, 3.0 * k[0], 0.0, 5.0 * k[1], 0.0, 7.0 * k[2], 0.0, 9.0 * k[3]]);
        Curve::new("KannalaBrandt", "4 (k1, k2, k3, k4)", given, max_angle, slope).map(Self)
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

impl OfAngle for KannalaBrandt {
    #[inline(always)]
    fn curve(&self) -> &Curve {
        &self.0
    }

    #[inline(always)]
    fn radius(&self, t: f64) -> f64 {
        let [k1, k2, k3, k4] = self.0.k;
        let u = t * t;
        t * (1.0 + u * (k1 + u * (k2 + u * (k3 + u * k4))))
    }

    #[inline(always)]
    fn slope(&self, t: f64) -> f64 {
        let [k1, k2, k3, k4] = self.0.k;
        let u = t * t;
        1.0 + u * (3.0 * k1 + u * (5.0 * k2 + u * (7.0 * k3 + u * 9.0 * k4)))
    }
}

impl std::fmt::Display for KannalaBrandt {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "KannalaBrandt([{}]{})", listed(&self.0.k), shown(self.0.limit))
    }
}
