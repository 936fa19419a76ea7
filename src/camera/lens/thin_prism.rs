//! Fisheyes with tangential and thin prism terms.

use nalgebra::{Matrix2, Vector2, Vector3};

use super::angle::angle_from_axis;
use super::of_angle::at_angle;
use super::{Distort, coefficients, limit, listed, planar, polynomial, sees, shown};
use crate::error::Result;

const NAME: &str = "ThinPrismFisheye";
const ORDER: &str = "8 (k1, k2, p1, p2, k3, k4, sx1, sy1) or 12 (k1 to k6, p1, p2, s1, s2, s3, s4)";
/// Of the 12, the order of tangential and prism terms as [`ThinPrismFisheye`] keeps them.
const TERMS: usize = 12;

/// A fisheye whose sensor or elements are tilted. With `r = sqrt(X^2 + Y^2)`, `t = atan2(r, Z)`, `q = t (X, Y) / r` and
/// `w = q (1 + k1 t^2 + k2 t^4 + ...)`, `m = w + T`, in two forms:
///
/// ```text
/// 8 coefficients    T = (2 p1 x y + p2 (s + 2 x^2) + sx1 s,  p1 (s + 2 y^2) + 2 p2 x y + sy1 s)              of (x, y) = q
/// 12 coefficients   T = (p1 (s + 2 x^2) + 2 p2 x y + s1 s + s2 s^2,  2 p1 x y + p2 (s + 2 y^2) + s3 s + s4 s^2)  of (x, y) = w
/// ```
///
/// with `s = x^2 + y^2`. The first is COLMAP's `THIN_PRISM_FISHEYE` (ETH3D), the second its `RAD_TAN_THIN_PRISM_FISHEYE`,
/// Project Aria's FISHEYE624. Each has p1 and p2 as its source has them.
///
/// Its domain is the largest cone in which the Jacobian of m by q keeps a positive definite symmetric part, as
/// [`BrownConrady`](super::BrownConrady)'s, looked for in all directions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ThinPrismFisheye {
    given: [f64; TERMS],
    count: usize,
    k: [f64; 6],
    /// As OpenCV has them: p1 makes `2 p1 x y` of the first coordinate, p2 `p2 (s + 2 x^2)`.
    p: [f64; 2],
    /// Of s and s^2 in the first coordinate, and in the second.
    prism: [f64; 4],
    limit: Option<f64>,
    /// The validity limit, radians from the axis.
    end: f64,
}

impl ThinPrismFisheye {
    /// A lens from 8 or 12 coefficients. `max_angle`, radians from the axis, makes the domain smaller.
    ///
    /// # Errors
    /// [`LensError::Coefficients`](crate::error::LensError::Coefficients) for another count,
    /// [`LensError::Parameter`](crate::error::LensError::Parameter) for what is not finite or a limit that is none,
    /// [`LensError::Folds`](crate::error::LensError::Folds) where the image folds back at once.
    pub fn new(given: &[f64], max_angle: Option<f64>) -> Result<Self> {
        let c: [f64; TERMS] = coefficients(NAME, ORDER, &[8, 12], given)?;
        let (k, p, prism) = if given.len() == 8 {
            let [k1, k2, p1, p2, k3, k4, sx1, sy1, ..] = c;
            ([k1, k2, k3, k4, 0.0, 0.0], [p1, p2], [sx1, 0.0, sy1, 0.0])
        } else {
            let [k1, k2, k3, k4, k5, k6, p1, p2, s1, s2, s3, s4] = c;
            ([k1, k2, k3, k4, k5, k6], [p2, p1], [s1, s2, s3, s4])
        };
        let limit = limit(NAME, max_angle)?;
        let count = given.len();
        let mut lens = Self { given: c, count, k, p, prism, limit: max_angle, end: limit };
        lens.end = planar::circle_until(limit, |part| limit * part, |q| planar::grows(&lens.jacobian(&q.into())));
        sees(NAME, ORDER, lens.end, limit)?;
        Ok(lens)
    }

    /// The coefficients, as given.
    pub fn coefficients(&self) -> &[f64] {
        &self.given[..self.count]
    }

    /// The limit that was given.
    pub fn limit(&self) -> Option<f64> {
        self.limit
    }

    /// The validity limit, radians from the axis.
    pub fn max_angle(&self) -> f64 {
        self.end
    }

    /// Whether tangential and prism terms are of w, what the radial terms make of q.
    pub(crate) fn is_after(&self) -> bool {
        self.count == TERMS
    }

    /// 1 + k1 s + k2 s^2 + ...
    #[inline(always)]
    fn radial(&self, s: f64) -> f64 {
        let [k1, k2, k3, k4, k5, k6] = self.k;
        1.0 + s * (k1 + s * (k2 + s * (k3 + s * (k4 + s * (k5 + s * k6)))))
    }

    /// T of (x, y).
    #[inline(always)]
    fn beside(&self, x: f64, y: f64) -> (f64, f64) {
        let ([p1, p2], [s1, s2, s3, s4]) = (self.p, self.prism);
        let (s, along) = (x * x + y * y, 2.0 * (p1 * y + p2 * x));
        (x * along + s * (p2 + s1 + s2 * s), y * along + s * (p1 + s3 + s4 * s))
    }

    /// The image of q.
    #[inline(always)]
    fn bend<const AFTER: bool>(&self, x: f64, y: f64) -> (f64, f64) {
        let radial = self.radial(x * x + y * y);
        let (wx, wy) = (x * radial, y * radial);
        let (tx, ty) = if AFTER { self.beside(wx, wy) } else { self.beside(x, y) };
        (wx + tx, wy + ty)
    }

    /// The derivative of the image by q.
    fn jacobian(&self, q: &Vector2<f64>) -> Matrix2<f64> {
        let s = q.norm_squared();
        let slope = (1..=6).rev().fold(0.0, |sum, power| sum * s + power as f64 * self.k[power - 1]);
        let radial = Matrix2::identity() * self.radial(s) + q * q.transpose() * (2.0 * slope);
        let beside = |p: Vector2<f64>| {
            let ([p1, p2], [s1, s2, s3, s4], s) = (self.p, self.prism, p.norm_squared());
            let (a, b) = (2.0 * (s1 + 2.0 * s2 * s), 2.0 * (s3 + 2.0 * s4 * s));
            let mixed = 2.0 * (p1 * p.x + p2 * p.y);
            Matrix2::new(
                2.0 * p1 * p.y + 6.0 * p2 * p.x + a * p.x,
                mixed + a * p.y,
                mixed + b * p.x,
                6.0 * p1 * p.y + 2.0 * p2 * p.x + b * p.y,
            )
        };
        if self.is_after() { radial + beside(q * self.radial(s)) * radial } else { radial + beside(*q) }
    }

    pub(super) fn undistort(&self, m: [f64; 2]) -> Option<Vector3<f64>> {
        let target = Vector2::from(m);
        let length = target.norm();
        // radial terms alone, for a start
        let error = |t: f64| {
            let s = t * t;
            let slope = (0..=6).rev().fold(0.0, |sum, power: usize| {
                let k = if power == 0 { 1.0 } else { self.k[power - 1] };
                sum * s + (2 * power + 1) as f64 * k
            });
            (t * self.radial(s) - length, slope)
        };
        let t = polynomial::root_of_increasing(self.end, length, error);
        let start = if length > 0.0 { target * (t / length) } else { target };
        let error = |q: &Vector2<f64>| {
            let (u, v) = if self.is_after() { self.bend::<true>(q.x, q.y) } else { self.bend::<false>(q.x, q.y) };
            Vector2::new(u, v) - target
        };
        let q = planar::root(start, self.end, length, error, |q| self.jacobian(q));
        Some(at_angle(q.into(), q.norm(), q.norm()))
    }
}

/// [`ThinPrismFisheye`], of which `AFTER` says [`ThinPrismFisheye::is_after`].
pub(crate) struct Prisms<const AFTER: bool>(pub(crate) ThinPrismFisheye);

impl<const AFTER: bool> Distort for Prisms<AFTER> {
    #[inline(always)]
    fn distort(&self, x: f64, y: f64, z: f64) -> (f64, f64) {
        let Self(lens) = self;
        let r = (x * x + y * y).sqrt();
        let t = angle_from_axis(r, z);
        let t = if t <= lens.end { t } else { f64::NAN };
        // on the axis itself both are 0
        let scale = if r > 0.0 { t / r } else { t };
        lens.bend::<AFTER>(x * scale, y * scale)
    }
}

impl Distort for ThinPrismFisheye {
    fn distort(&self, x: f64, y: f64, z: f64) -> (f64, f64) {
        if self.is_after() { Prisms::<true>(*self).distort(x, y, z) } else { Prisms::<false>(*self).distort(x, y, z) }
    }
}

impl std::fmt::Display for ThinPrismFisheye {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "ThinPrismFisheye([{}]{})", listed(self.coefficients()), shown(self.limit))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_jacobian_is_that_of_differences() {
        let first = [0.02, -0.01, 1e-2, -2e-2, 3e-3, -1e-3, 0.01, -0.02];
        let second = [0.02, -0.01, 4e-3, -1e-3, 2e-4, -1e-5, 1e-2, -2e-2, 0.01, -0.005, 0.02, 0.003];
        for c in [&first[..], &second[..]] {
            let lens = ThinPrismFisheye::new(c, None).unwrap();
            for i in 0..400 {
                let (x, y) = (f64::from(i % 20) * 0.13 - 1.25, f64::from(i / 20) * 0.13 - 1.25);
                let h = 1e-5;
                let at = |x, y| {
                    let (u, v) = if lens.is_after() { lens.bend::<true>(x, y) } else { lens.bend::<false>(x, y) };
                    Vector2::new(u, v)
                };
                let along_x = (at(x + h, y) - at(x - h, y)) / (2.0 * h);
                let along_y = (at(x, y + h) - at(x, y - h)) / (2.0 * h);
                let numeric = Matrix2::from_columns(&[along_x, along_y]);
                assert!((numeric - lens.jacobian(&Vector2::new(x, y))).abs().max() < 1e-8, "{x} {y}");
            }
        }
    }
}
