//! Kannala-Brandt: an odd polynomial of the angle.

use nalgebra::Vector3;

use super::of_angle::OfAngle;
use super::{Distort, coefficients, limit, listed, shown};
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
    rho: OfAngle<5, 2>,
}

impl KannalaBrandt {
    /// A lens from k1, k2, k3, k4. `max_angle`, radians from the axis, makes the domain smaller.
    ///
    /// # Errors
    /// [`LensError::Coefficients`](crate::error::LensError::Coefficients) for another count than 4,
    /// [`LensError::Parameter`](crate::error::LensError::Parameter) for what is not finite or a limit that is none,
    /// [`LensError::Folds`](crate::error::LensError::Folds) where the image folds back at once.
    pub fn new(given: &[f64], max_angle: Option<f64>) -> Result<Self> {
        const NAME: &str = "KannalaBrandt";
        const ORDER: &str = "4 (k1, k2, k3, k4)";
        let k @ [k1, k2, k3, k4] = coefficients(NAME, ORDER, &[4], given)?;
        let rho = OfAngle::new(NAME, ORDER, [1.0, k1, k2, k3, k4], limit(NAME, max_angle)?)?;
        Ok(Self { k, limit: max_angle, rho })
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
        self.rho.end()
    }

    pub(super) fn undistort(&self, m: [f64; 2]) -> Option<Vector3<f64>> {
        Some(self.rho.undistort(m))
    }
}

impl Distort for KannalaBrandt {
    #[inline(always)]
    fn distort(&self, x: f64, y: f64, z: f64) -> (f64, f64) {
        self.rho.distort(x, y, z)
    }
}

impl std::fmt::Display for KannalaBrandt {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "KannalaBrandt([{}]{})", listed(&self.k), shown(self.limit))
    }
}
