//! Mei: a sphere, then a pinhole, then radtan.

use nalgebra::Vector3;

use super::{BrownConrady, Distort, limit, listed, parameter, sees, shown};
use crate::error::{Error, LensError, Result};

/// The unified omnidirectional model with radtan distortion, as KITTI-360, Kalibr (`omni`) and `cv2.omnidir` have it.
/// `(x, y) = (X, Y) / (Z + xi |P|)`, then [`BrownConrady`] with k1, k2, p1, p2. Source: Mei and Rives 2007.
///
/// Its domain is `Z > -w |P|`, `w = 1 / xi` if xi > 1 else xi, and ends sooner where radtan folds back.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mei {
    xi: f64,
    radtan: BrownConrady,
    limit: Option<f64>,
    /// Cosine of the angle at which the sphere's part ends, or of the caller's limit.
    cos_end: f64,
}

impl Mei {
    /// A lens from xi and k1, k2, p1, p2. `max_angle`, radians from the axis, makes the domain smaller.
    ///
    /// # Errors
    /// [`LensError::Coefficients`] for another count than 4, [`LensError::Parameter`] for what is not finite, a
    /// negative xi, or a limit that is none, [`LensError::Folds`] where the image folds back at once.
    pub fn new(xi: f64, given: &[f64], max_angle: Option<f64>) -> Result<Self> {
        const NAME: &str = "Mei";
        const EXPECTED: &str = "4 (k1, k2, p1, p2)";
        parameter(NAME, "xi", "a finite number of at least 0", xi, xi.is_finite() && xi >= 0.0)?;
        if given.len() != 4 {
            return Err(Error::Lens(LensError::Coefficients { lens: NAME, expected: EXPECTED, got: given.len() }));
        }
        for &value in given {
            parameter(NAME, "coefficients", "finite numbers", value, value.is_finite())?;
        }
        let w = if xi > 1.0 { 1.0 / xi } else { xi };
        let limit = limit(NAME, max_angle)?;
        let radtan = BrownConrady::new(given, None).map_err(|error| match error {
            Error::Lens(LensError::Folds { angle, .. }) => {
                Error::Lens(LensError::Folds { lens: NAME, expected: EXPECTED, angle })
            }
            other => other,
        })?;
        let lens = Self { xi, radtan, limit: max_angle, cos_end: (-w).max(limit.cos()) };
        sees(NAME, EXPECTED, lens.max_angle(), limit)?;
        Ok(lens)
    }

    /// The distance of the projection centre from the sphere's.
    pub fn xi(&self) -> f64 {
        self.xi
    }

    /// k1, k2, p1, p2.
    pub fn coefficients(&self) -> &[f64] {
        self.radtan.coefficients()
    }

    /// The limit that was given.
    pub fn limit(&self) -> Option<f64> {
        self.limit
    }

    /// The validity limit, radians from the axis.
    pub fn max_angle(&self) -> f64 {
        let radtan = lift(self.xi, [self.radtan.max_radius().min(1e150), 0.0]);
        radtan.map_or(f64::INFINITY, |ray| ray.x.atan2(ray.z)).min(self.cos_end.acos())
    }

    pub(super) fn undistort(&self, m: [f64; 2]) -> Option<Vector3<f64>> {
        lift(self.xi, self.radtan.unbend(m)?)
    }
}

/// The direction that the sphere takes to (x, y); `None` if none.
fn lift(xi: f64, [x, y]: [f64; 2]) -> Option<Vector3<f64>> {
    let s = x * x + y * y;
    let square = 1.0 + (1.0 - xi * xi) * s;
    if square < -1e-9 {
        return None;
    }
    // (eta x, eta y, eta - xi) has length 1
    let eta = (xi + square.max(0.0).sqrt()) / (s + 1.0);
    Some(Vector3::new(eta * x, eta * y, eta - xi))
}

impl Distort for Mei {
    #[inline(always)]
    fn distort(&self, x: f64, y: f64, z: f64) -> (f64, f64) {
        let length = (x * x + y * y + z * z).sqrt();
        // Z + xi |P| loses its digits behind; there it is the quotient of two sums of one sign, as far as xi allows
        let (far, xx) = (self.xi * length, self.xi * self.xi);
        let behind = z < 0.0;
        let numerator = if behind { far - z } else { 1.0 };
        let denominator = if behind { xx * (x * x + y * y) + (xx - 1.0) * (z * z) } else { z + far };
        let w = numerator / denominator;
        self.radtan.bend_inside::<5>(x * w, y * w, z > self.cos_end * length)
    }
}

impl std::fmt::Display for Mei {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Mei({:?}, [{}]{})", self.xi, listed(self.coefficients()), shown(self.limit))
    }
}
