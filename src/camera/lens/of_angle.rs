//! Lenses whose image lies at a distance from the centre that is a polynomial of the angle from the axis.

use nalgebra::Vector3;

use super::angle::angle_from_axis;
use super::{Distort, coefficients, limit, polynomial, sees};
use crate::error::Result;

/// What such a lens is made of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Curve {
    /// The coefficients, as given.
    pub(super) k: [f64; 4],
    /// The limit that was given.
    pub(super) limit: Option<f64>,
    /// The validity limit, radians from the axis.
    pub(super) end: f64,
}

impl Curve {
    /// Coefficients and a limit, checked; `slope` makes of them the derivative of rho by the angle, constant first, which
    /// is positive on the axis.
    pub(super) fn new<const N: usize>(
        lens: &'static str,
        order: &'static str,
        given: &[f64],
        max_angle: Option<f64>,
        slope: impl Fn(&[f64; 4]) -> Result<[f64; N]>,
    ) -> Result<Self> {
        let k = coefficients(lens, order, &[4], given)?;
        let limit = limit(lens, max_angle)?;
        let end = polynomial::positive_until(&slope(&k)?, limit).unwrap_or(limit);
        sees(lens, order, end, limit)?;
        Ok(Self { k, limit: max_angle, end })
    }
}

/// A lens that a curve makes, rho of the angle.
pub(super) trait OfAngle {
    /// What it is made of.
    fn curve(&self) -> &Curve;

    /// rho at the angle t.
    fn radius(&self, t: f64) -> f64;

    /// The derivative of rho at the angle t.
    fn slope(&self, t: f64) -> f64;

    /// The direction whose image is (x, y), or a guess that must be checked.
    fn undistort(&self, [x, y]: [f64; 2]) -> Option<Vector3<f64>> {
        let rho = x.hypot(y);
        let start = rho / self.slope(0.0);
        let angle = polynomial::root_of_increasing(self.curve().end, start, |t| (self.radius(t) - rho, self.slope(t)));
        if rho == 0.0 {
            return Some(Vector3::z());
        }
        let (sin, cos) = angle.sin_cos();
        Some(Vector3::new(x / rho * sin, y / rho * sin, cos))
    }
}

impl<L: OfAngle> Distort for L {
    #[inline(always)]
    fn distort(&self, x: f64, y: f64, z: f64) -> (f64, f64) {
        let r = (x * x + y * y).sqrt();
        let t = angle_from_axis(r, z);
        let t = if t <= self.curve().end { t } else { f64::NAN };
        let rho = self.radius(t);
        // on the axis itself both are 0
        let scale = if r > 0.0 { rho / r } else { rho };
        (x * scale, y * scale)
    }
}
