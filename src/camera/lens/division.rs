//! The division model.

use nalgebra::Vector3;

use super::{Distort, limit, parameter, sees, shown};
use crate::error::Result;

/// The division model with one parameter: what is seen at m looks along `(m, 1 + k |m|^2)`, beyond 90 degrees too if k < 0.
/// Source: Fitzgibbon 2001; COLMAP `DIVISION`. With more terms it is Scaramuzza's ([`Ocam`](super::Ocam)).
///
/// Its domain ends where the angle stops growing with |m|, `Z = 2 sqrt(k) r` if k > 0, or straight behind.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Division {
    k: f64,
    limit: Option<f64>,
    cos_end: f64,
}

impl Division {
    /// A lens from k. `max_angle`, radians from the axis, makes the domain smaller.
    ///
    /// # Errors
    /// [`LensError::Parameter`](crate::error::LensError::Parameter) where k is not finite or the limit is none,
    /// [`LensError::Folds`](crate::error::LensError::Folds) where the image folds back at once.
    pub fn new(k: f64, max_angle: Option<f64>) -> Result<Self> {
        const NAME: &str = "Division";
        parameter(NAME, "k", "a finite number", k, k.is_finite())?;
        let limit = limit(NAME, max_angle)?;
        // k = 0 is a pinhole
        let fold = if k >= 0.0 { 1.0f64.atan2(2.0 * k.sqrt()) } else { std::f64::consts::PI };
        sees(NAME, "1 (k)", fold, limit)?;
        Ok(Self { k, limit: max_angle, cos_end: fold.min(limit).cos() })
    }

    /// The parameter.
    pub fn k(&self) -> f64 {
        self.k
    }

    /// The limit that was given.
    pub fn limit(&self) -> Option<f64> {
        self.limit
    }

    /// The validity limit, radians from the axis.
    pub fn max_angle(&self) -> f64 {
        self.cos_end.acos()
    }

    pub(super) fn undistort(&self, [x, y]: [f64; 2]) -> Option<Vector3<f64>> {
        let shift = self.k * (x * x + y * y);
        // beyond that the angle falls again
        (shift <= 1.0 + 1e-12).then(|| Vector3::new(x, y, 1.0 + shift))
    }
}

impl Distort for Division {
    #[inline(always)]
    fn distort(&self, x: f64, y: f64, z: f64) -> (f64, f64) {
        let s = x * x + y * y;
        let inside = z >= self.cos_end * (s + z * z).sqrt();
        // |m| r^-1 = w solves k s w^2 - z w + 1 = 0; two forms of its root, each a sum of one sign
        let root = (z * z - 4.0 * self.k * s).max(0.0).sqrt();
        let behind = z < 0.0;
        let numerator = if behind { root - z } else { 2.0 };
        let denominator = if behind { -2.0 * self.k * s } else { z + root };
        let w = numerator / denominator;
        let w = if inside { w } else { f64::NAN };
        (x * w, y * w)
    }
}

impl std::fmt::Display for Division {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Division({:?}{})", self.k, shown(self.limit))
    }
}
