//! The enhanced unified camera model.

use nalgebra::Vector3;

use super::{Distort, limit, one_over_shifted, parameter, shifted_sphere_z, shown};
use crate::error::Result;

/// An ellipsoid, then a pinhole. With `d = sqrt(beta (X^2 + Y^2) + Z^2)`: `m = (X, Y) / (alpha d + (1 - alpha) Z)`.
/// Source: Khomutenko, Garcia and Martinet 2016 (Kalibr and basalt `eucm`).
///
/// Its domain is `Z > -w d`, `w = alpha / (1 - alpha)` up to alpha = 1/2, its inverse beyond.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Eucm {
    alpha: f64,
    beta: f64,
    limit: Option<f64>,
    w: f64,
    cos_end: f64,
}

impl Eucm {
    /// A lens from alpha and beta. `max_angle`, radians from the axis, makes the domain smaller.
    ///
    /// # Errors
    /// [`LensError::Parameter`](crate::error::LensError::Parameter) where alpha is not from 0 to 1, beta not above 0,
    /// or the limit is none.
    pub fn new(alpha: f64, beta: f64, max_angle: Option<f64>) -> Result<Self> {
        const NAME: &str = "Eucm";
        let expected = "a number from 0 to 1 (the order is alpha, beta)";
        parameter(NAME, "alpha", expected, alpha, (0.0..=1.0).contains(&alpha))?;
        parameter(NAME, "beta", "a finite number above 0", beta, beta.is_finite() && beta > 0.0)?;
        let w = if alpha <= 0.5 { alpha / (1.0 - alpha) } else { (1.0 - alpha) / alpha };
        Ok(Self { alpha, beta, limit: max_angle, w, cos_end: limit(NAME, max_angle)?.cos() })
    }

    /// The pinhole's shift.
    pub fn alpha(&self) -> f64 {
        self.alpha
    }

    /// The ellipsoid's shape.
    pub fn beta(&self) -> f64 {
        self.beta
    }

    /// The limit that was given.
    pub fn limit(&self) -> Option<f64> {
        self.limit
    }

    /// The validity limit, radians from the axis.
    pub fn max_angle(&self) -> f64 {
        // Z = -w d: tan^2 of the angle behind is (1 - w^2) / (w^2 beta)
        let behind = ((1.0 - self.w * self.w).max(0.0) / self.beta).sqrt().atan2(self.w);
        (std::f64::consts::PI - behind).min(self.cos_end.acos())
    }

    pub(super) fn undistort(&self, [x, y]: [f64; 2]) -> Option<Vector3<f64>> {
        let Self { alpha, beta, .. } = *self;
        let s = beta * (x * x + y * y);
        let z = shifted_sphere_z(alpha, s)?;
        Some(Vector3::new(x, y, z))
    }
}

impl Distort for Eucm {
    #[inline(always)]
    fn distort(&self, x: f64, y: f64, z: f64) -> (f64, f64) {
        let s = x * x + y * y;
        let t = self.beta * s;
        let d = (t + z * z).sqrt();
        let inside = (z > -self.w * d) & (z > self.cos_end * (s + z * z).sqrt());
        let w = one_over_shifted(self.alpha, d, z, t);
        let w = if inside { w } else { f64::NAN };
        (x * w, y * w)
    }
}

impl std::fmt::Display for Eucm {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Eucm({:?}, {:?}{})", self.alpha, self.beta, shown(self.limit))
    }
}
