//! Polynomials of the angle from the axis, which say at what distance from the centre a direction's image lies.

use nalgebra::Vector3;

use super::angle::angle_from_axis;
use super::{Distort, polynomial, sees};
use crate::error::Result;

/// `rho = t (q0 + q1 u + q2 u^2 + ...)` of the angle t, with u = t to the power `STEP`, 1 or 2.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct OfAngle<const N: usize, const STEP: usize> {
    q: [f64; N],
    /// The validity limit, radians from the axis.
    end: f64,
}

impl<const N: usize, const STEP: usize> OfAngle<N, STEP> {
    /// The polynomial of these coefficients, q0 above 0, up to where it stops growing or `limit`.
    ///
    /// # Errors
    /// [`LensError::Folds`](crate::error::LensError::Folds) where that is on the axis.
    pub(super) fn new(lens: &'static str, order: &'static str, q: [f64; N], limit: f64) -> Result<Self> {
        let mut slope = vec![0.0; (N - 1) * STEP + 1];
        for (power, &coefficient) in q.iter().enumerate() {
            slope[power * STEP] = (power * STEP + 1) as f64 * coefficient;
        }
        let end = polynomial::positive_until(&slope, limit).unwrap_or(limit);
        sees(lens, order, end, limit)?;
        Ok(Self { q, end })
    }

    /// q0, q1, ...
    pub(super) fn coefficients(&self) -> &[f64; N] {
        &self.q
    }

    /// The validity limit, radians from the axis.
    pub(super) fn end(&self) -> f64 {
        self.end
    }

    /// rho at the angle t.
    #[inline(always)]
    pub(super) fn radius(&self, t: f64) -> f64 {
        let u = if STEP == 2 { t * t } else { t };
        let mut sum = self.q[N - 1];
        let mut power = N - 1;
        while power > 0 {
            power -= 1;
            sum = sum * u + self.q[power];
        }
        t * sum
    }

    /// The derivative of rho at the angle t.
    fn slope(&self, t: f64) -> f64 {
        let u = if STEP == 2 { t * t } else { t };
        (0..N).rev().fold(0.0, |sum, power| sum * u + (power * STEP + 1) as f64 * self.q[power])
    }

    /// The angle whose image lies at this distance from the centre; the validity limit for all that is farther.
    pub(super) fn angle(&self, rho: f64) -> f64 {
        let start = rho / self.q[0];
        polynomial::root_of_increasing(self.end, start, |t| (self.radius(t) - rho, self.slope(t)))
    }

    /// The direction whose image is (x, y), or a guess that must be checked.
    pub(super) fn undistort(&self, [x, y]: [f64; 2]) -> Vector3<f64> {
        let rho = x.hypot(y);
        at_angle([x, y], rho, self.angle(rho))
    }
}

/// The direction at this angle from the axis and on the side of (x, y), which is `rho` long.
pub(super) fn at_angle([x, y]: [f64; 2], rho: f64, angle: f64) -> Vector3<f64> {
    if rho == 0.0 {
        return Vector3::z();
    }
    let (sin, cos) = angle.sin_cos();
    Vector3::new(x / rho * sin, y / rho * sin, cos)
}

impl<const N: usize, const STEP: usize> Distort for OfAngle<N, STEP> {
    #[inline(always)]
    fn distort(&self, x: f64, y: f64, z: f64) -> (f64, f64) {
        let r = (x * x + y * y).sqrt();
        let t = angle_from_axis(r, z);
        let t = if t <= self.end { t } else { f64::NAN };
        let rho = self.radius(t);
        // on the axis itself both are 0
        let scale = if r > 0.0 { rho / r } else { rho };
        (x * scale, y * scale)
    }
}
