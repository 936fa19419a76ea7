//! Brown-Conrady: radial, tangential, thin prism and tilt.

use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

use super::{Distort, Line, OnLine, coefficients, limit, listed, planar, polynomial, sees, shown};
use crate::error::Result;

/// Tangent of the largest angle from the axis at which a lens that bends is asked: beyond 89.99994 degrees there is nothing.
const WIDEST: f64 = 1e6;

/// OpenCV's model, also called plumb_bob and radtan. With `x = X / Z`, `y = Y / Z`, `s = x^2 + y^2`:
///
/// ```text
/// L  = (1 + k1 s + k2 s^2 + k3 s^3) / (1 + k4 s + k5 s^2 + k6 s^3)
/// x' = x L + 2 p1 x y + p2 (s + 2 x^2) + s1 s + s2 s^2
/// y' = y L + p1 (s + 2 y^2) + 2 p2 x y + s3 s + s4 s^2
/// ```
///
/// and for a tilted sensor the homography of `tau_x`, `tau_y`. Source: OpenCV, calib3d, "Detailed Description"; Brown 1966.
///
/// Its domain is the largest circle around the axis in which the Jacobian of (x', y') keeps a positive definite
/// symmetric part (without thin prism terms the Jacobian is symmetric, so this is: a positive determinant). On a circle,
/// which is convex, such a map is one-to-one. For a radial lens it ends at the first zero of the radial derivative.
#[derive(Debug, Clone, Copy)]
pub struct BrownConrady {
    /// k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4 tau_x tau_y, zero where not given.
    c: [f64; 14],
    /// How many were given.
    count: usize,
    /// 5, 8, 12 or 14: coefficients beyond them are 0.
    terms: usize,
    limit: Option<f64>,
    /// Largest x^2 + y^2 of the domain.
    end: f64,
    tilt: Matrix3<f64>,
}

/// Lenses that do the same are equal, however many zeros were written out.
impl PartialEq for BrownConrady {
    fn eq(&self, other: &Self) -> bool {
        self.c == other.c && self.end == other.end
    }
}

/// [`BrownConrady`] of which the first N coefficients can be other than 0: 5, 8, 12 or 14.
pub(crate) struct Terms<const N: usize>(pub(crate) BrownConrady);

impl<const N: usize> Distort for Terms<N> {
    #[inline(always)]
    fn distort(&self, x: f64, y: f64, z: f64) -> (f64, f64) {
        let w = 1.0 / z;
        self.0.bend_inside::<N>(x * w, y * w, z > 0.0)
    }

    #[inline(always)]
    fn on_line(&self, line: Line, intrinsics: &Matrix3<f64>) -> Option<OnLine<impl Fn(f64) -> (f64, f64)>> {
        let lens = &self.0;
        let [k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, ..] = lens.c;
        let (foot, along) = (line.foot, line.along);
        // s = at_foot + growth m^2
        let (at_foot, growth) = (foot.norm_squared(), along.norm_squared());
        let [mut n0, n1, n2, n3] = polynomial::shifted([1.0, k1, k2, k3], at_foot, growth);
        let [d0, d1, d2, d3] = polynomial::shifted([1.0, k4, k5, k6], at_foot, growth);
        // 2 (p1 y + p2 x) = tangential + slope m
        let [mut tangential, slope] = [foot, along].map(|of| 2.0 * (p1 * of.y + p2 * of.x));
        if N < 8 {
            n0 += std::mem::take(&mut tangential);
        }
        // Rows of the matrix that takes (x', y', 1) to pixels, and of what it takes there: x L + p s + s1 s + s2 s^2
        let matrix = if N >= 14 { intrinsics * lens.tilt } else { *intrinsics };
        let rows: [_; 3] = std::array::from_fn(|row| {
            let of = Vector2::new(matrix[(row, 0)], matrix[(row, 1)]);
            let (linear, square) = (of.dot(&Vector2::new(p2 + s1, p1 + s3)), of.dot(&Vector2::new(s2, s4)));
            let [a, b, c, _] = polynomial::shifted([matrix[(row, 2)], linear, square, 0.0], at_foot, growth);
            (of.dot(&foot), of.dot(&along), [a, b, c])
        });
        let pixel = move |m: f64| {
            let q = m * m;
            let mut radial = n0 + q * (n1 + q * (n2 + q * n3));
            if N >= 8 {
                radial = radial / (d0 + q * (d1 + q * (d2 + q * d3))) + tangential;
            }
            let l = radial + slope * m;
            let [u, v, w] = rows.map(|(at_foot, along, [a, b, c])| {
                (at_foot + along * m) * l + (a + q * if N >= 12 { b + q * c } else { b })
            });
            if N >= 14 { (u / w, v / w) } else { (u, v) }
        };
        Some(OnLine { pixel, end: (lens.end - at_foot) / growth })
    }
}

impl Distort for BrownConrady {
    fn distort(&self, x: f64, y: f64, z: f64) -> (f64, f64) {
        match self.terms() {
            5 => Terms::<5>(*self).distort(x, y, z),
            8 => Terms::<8>(*self).distort(x, y, z),
            12 => Terms::<12>(*self).distort(x, y, z),
            _ => Terms::<14>(*self).distort(x, y, z),
        }
    }
}

impl BrownConrady {
    /// A lens from `k1, k2, p1, p2[, k3[, k4, k5, k6[, s1, s2, s3, s4[, tau_x, tau_y]]]]`, the order of OpenCV and ROS.
    /// `max_angle`, radians from the axis, makes the domain smaller.
    ///
    /// # Errors
    /// [`LensError::Coefficients`](crate::error::LensError::Coefficients) for another count than 4, 5, 8, 12 or 14,
    /// [`LensError::Parameter`](crate::error::LensError::Parameter) for what is not finite, a tilt of 90 degrees or
    /// more, or a limit that is none, [`LensError::Folds`](crate::error::LensError::Folds) where the image folds back
    /// at once.
    pub fn new(given: &[f64], max_angle: Option<f64>) -> Result<Self> {
        const NAME: &str = "BrownConrady";
        let expected = "4, 5, 8, 12 or 14 (k1, k2, p1, p2[, k3[, k4, k5, k6[, s1, s2, s3, s4[, tau_x, tau_y]]]])";
        let c = coefficients::<14>(NAME, expected, &[4, 5, 8, 12, 14], given)?;
        for angle in [c[12], c[13]] {
            let holds = angle.abs() < std::f64::consts::FRAC_PI_2;
            super::parameter(NAME, "tau", "a tilt in radians between -pi/2 and pi/2", angle, holds)?;
        }
        let last = c.iter().rposition(|&value| value != 0.0).map_or(0, |index| index + 1);
        let terms = [5, 8, 12, 14].into_iter().find(|&count| count >= last).unwrap_or(14);
        let (count, tilt) = (given.len(), tilt(c[12], c[13]));
        let mut lens = Self { c, count, terms, limit: max_angle, end: f64::INFINITY, tilt };
        let limit = limit(NAME, max_angle)?;
        let end = if limit < std::f64::consts::FRAC_PI_2 { limit.tan() } else { f64::INFINITY };
        lens.end = lens.radius().min(end).powi(2);
        sees(NAME, expected, lens.max_angle(), limit)?;
        Ok(lens)
    }

    /// k1, k2, p1, p2, ... as given.
    pub fn coefficients(&self) -> &[f64] {
        &self.c[..self.count]
    }

    /// All 14, zero where not given.
    pub fn all_coefficients(&self) -> &[f64; 14] {
        &self.c
    }

    /// The limit that was given.
    pub fn limit(&self) -> Option<f64> {
        self.limit
    }

    /// The validity limit, radians from the axis.
    pub fn max_angle(&self) -> f64 {
        self.end.sqrt().atan()
    }

    /// Largest radius of the domain on the plane z = 1.
    pub(super) fn max_radius(&self) -> f64 {
        self.end.sqrt()
    }

    /// 5, 8, 12 or 14: coefficients beyond them are 0.
    pub(crate) fn terms(&self) -> usize {
        self.terms
    }

    /// Where the ray through (x, y, 1) is seen, if it is `seen` at all; NaN outside the domain.
    #[inline(always)]
    pub(super) fn bend_inside<const N: usize>(&self, x: f64, y: f64, seen: bool) -> (f64, f64) {
        let seen = seen & (x * x + y * y <= self.end);
        let (u, v) = self.bend::<N>(x, y);
        if seen { (u, v) } else { (f64::NAN, f64::NAN) }
    }

    /// Where the ray through (x, y, 1) is seen, whether or not it is in the domain.
    #[inline(always)]
    pub(super) fn bend<const N: usize>(&self, x: f64, y: f64) -> (f64, f64) {
        let [k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, ..] = self.c;
        let s = x * x + y * y;
        let mut radial = 1.0 + s * (k1 + s * (k2 + s * k3));
        if N >= 8 {
            radial /= 1.0 + s * (k4 + s * (k5 + s * k6));
        }
        // p1 (s + 2 y^2) + 2 p2 x y = p1 s + 2 y (p1 y + p2 x)
        let along = radial + (2.0 * p1 * y + 2.0 * p2 * x);
        let mut u = x * along + p2 * s;
        let mut v = y * along + p1 * s;
        if N >= 12 {
            u += s * (s1 + s2 * s);
            v += s * (s3 + s4 * s);
        }
        if N >= 14 {
            let t = &self.tilt;
            let w = 1.0 / (t[(2, 0)] * u + t[(2, 1)] * v + t[(2, 2)]);
            (u, v) = ((t[(0, 0)] * u + t[(0, 1)] * v + t[(0, 2)]) * w, (t[(1, 0)] * u + t[(1, 1)] * v + t[(1, 2)]) * w);
        }
        (u, v)
    }

    /// L and its derivative by s.
    fn radial(&self, s: f64) -> (f64, f64) {
        let [k1, k2, _, _, k3, k4, k5, k6, ..] = self.c;
        let numerator = 1.0 + s * (k1 + s * (k2 + s * k3));
        let denominator = 1.0 + s * (k4 + s * (k5 + s * k6));
        let radial = numerator / denominator;
        let slope = |a: f64, b: f64, c: f64| a + s * (2.0 * b + s * 3.0 * c);
        (radial, (slope(k1, k2, k3) - radial * slope(k4, k5, k6)) / denominator)
    }

    /// The derivative of (x', y'), before the tilt, by (x, y).
    pub(super) fn jacobian(&self, x: f64, y: f64) -> Matrix2<f64> {
        let [_, _, p1, p2, _, _, _, _, s1, s2, s3, s4, ..] = self.c;
        let s = x * x + y * y;
        let (l, slope) = self.radial(s);
        let (a, b) = (2.0 * (s1 + 2.0 * s2 * s), 2.0 * (s3 + 2.0 * s4 * s));
        let mixed = 2.0 * (x * y * slope + p1 * x + p2 * y);
        Matrix2::new(
            l + 2.0 * x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x + a * x,
            mixed + a * y,
            mixed + b * x,
            l + 2.0 * y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x + b * y,
        )
    }

    /// How far the image of (x, y, 1) moves by rounding of it and of the quotient: before a pole the quotient is of small
    /// differences, and both grow as the Jacobian does.
    pub(super) fn rounding(&self, x: f64, y: f64) -> f64 {
        /// Units in the last place: what a direction loses when it is made a unit vector and divided by its z again.
        const ULPS: f64 = 32.0;
        if self.terms < 8 {
            return 0.0; // a polynomial has no pole
        }
        let stretch = self.jacobian(x, y).norm() * (x.hypot(y) + 1.0);
        if stretch.is_finite() { ULPS * f64::EPSILON * stretch } else { 0.0 }
    }

    /// The ray (x, y, 1) that is seen at m, or a guess that must be checked.
    pub(super) fn unbend(&self, m: [f64; 2]) -> Option<[f64; 2]> {
        if self.c == [0.0; 14] {
            return Some(m); // a pinhole, whose domain goes beyond what is looked through below
        }
        let target = if self.c[12..] == [0.0, 0.0] {
            Vector2::from(m)
        } else {
            let untilted = self.tilt.try_inverse()? * Vector3::new(m[0], m[1], 1.0);
            Vector2::new(untilted.x / untilted.z, untilted.y / untilted.z)
        };
        let length = target.norm();
        if length == 0.0 || !length.is_finite() {
            return (length == 0.0).then_some([0.0; 2]); // the axis stays where it is
        }
        // the radial part alone, which is solved for sure
        let end = self.end.sqrt().min(WIDEST);
        let radial_alone = |target: Vector2<f64>| {
            let length = target.norm();
            let r = polynomial::root_of_increasing(end, length, |r| {
                let (l, slope) = self.radial(r * r);
                (r * l - length, l + 2.0 * r * r * slope)
            });
            if length > 0.0 { target * (r / length) } else { target }
        };
        let mut p = radial_alone(target);
        let [_, _, p1, p2, _, _, _, _, prism @ ..] = self.c;
        if p1 == 0.0 && p2 == 0.0 && prism[..4] == [0.0; 4] {
            return Some(p.into());
        }
        let [s1, s2, s3, s4, ..] = prism;
        // what is not radial
        let beside = |p: &Vector2<f64>| {
            let (s, across) = (p.norm_squared(), 2.0 * (p1 * p.y + p2 * p.x));
            Vector2::new(p.x * across + p2 * s + s * (s1 + s2 * s), p.y * across + p1 * s + s * (s3 + s4 * s))
        };
        let error = |p: &Vector2<f64>| p * self.radial(p.norm_squared()).0 + beside(p) - target;
        // Before a pole the radial part grows without bound and the rest hardly at all, so that taking the rest off the
        // target and solving again gets there, where Newton's straight steps would lead through the pole. Polynomials have
        // none, and Newton alone takes two fifths of the time.
        let most = if self.terms < 8 { 0 } else { 20 };
        for _ in 0..most {
            let next = radial_alone(target - beside(&p));
            if error(&next).norm() >= 0.5 * error(&p).norm() {
                break;
            }
            p = next;
        }
        // then all of it
        let p = planar::root(p, end, length, error, |p| self.jacobian(p.x, p.y));
        Some(p.into())
    }

    pub(super) fn undistort(&self, m: [f64; 2]) -> Option<Vector3<f64>> {
        self.unbend(m).map(|[x, y]| Vector3::new(x, y, 1.0))
    }

    /// Where the domain ends on the plane z = 1, whatever the caller's limit.
    fn radius(&self) -> f64 {
        let [k1, k2, p1, p2, k3, k4, k5, k6, prism @ ..] = self.c;
        if self.c == [0.0; 14] {
            return f64::INFINITY;
        }
        // polynomials of r, not of r^2, because the tangential terms are odd
        let n = [1.0, 0.0, k1, 0.0, k2, 0.0, k3];
        let d = [1.0, 0.0, k4, 0.0, k5, 0.0, k6];
        // short of a pole of L by more than rounding
        let before_pole = polynomial::positive_until(&d, WIDEST).map_or(WIDEST, |pole| pole * (1.0 - 1e-9));
        if prism.iter().any(|&value| value != 0.0) {
            return self.radius_by_scan(before_pole);
        }
        let (nd, dd) = (polynomial::product(&n, &d), polynomial::product(&d, &d));
        // L D^2 = N D; the derivative of r L, times D^2, is N D + r (N' D - N D')
        let cross = polynomial::sum(
            1.0,
            &polynomial::product(&polynomial::derivative(&n), &d),
            -1.0,
            &polynomial::product(&n, &polynomial::derivative(&d)),
        );
        let slope = polynomial::sum(1.0, &nd, 1.0, &polynomial::product(&[0.0, 1.0], &cross));
        // In the frame of radius and tangent the Jacobian of radial and tangential terms, with a = r hypot(p1, p2) and
        // an angle t, is [[g + 6 a cos t, 2 a sin t], [2 a sin t, L + 2 a cos t]], g the radial derivative. Its
        // determinant is smallest at t = pi, (g - 6 a)(L - 2 a), as long as g + 3 L > 16 a.
        let a = polynomial::product(&[0.0, p1.hypot(p2)], &dd);
        let conditions = [
            polynomial::sum(1.0, &slope, -6.0, &a),
            polynomial::sum(1.0, &nd, -2.0, &a),
            polynomial::sum(1.0, &polynomial::sum(1.0, &slope, 3.0, &nd), -16.0, &a),
        ];
        let ends = conditions.iter().filter_map(|condition| polynomial::positive_until(condition, WIDEST));
        ends.fold(before_pole, f64::min)
    }

    /// Where thin prism terms fold the image or a tilt takes it through infinity, looked for in all directions.
    fn radius_by_scan(&self, end: f64) -> f64 {
        let t = &self.tilt;
        let widest = end.atan();
        planar::circle_until(
            end,
            |part| (widest * part).tan(),
            |[x, y]| {
                let (u, v) = self.bend::<12>(x, y);
                planar::grows(&self.jacobian(x, y)) && t[(2, 0)] * u + t[(2, 1)] * v + t[(2, 2)] > 0.0
            },
        )
    }
}

/// The homography of a tilted sensor, as OpenCV has it: `[[R33, 0, -R13], [0, R33, -R23], [0, 0, 1]] R`,
/// `R = Ry(tau_y) Rx(tau_x)` with the signs of a change of frame.
fn tilt(tau_x: f64, tau_y: f64) -> Matrix3<f64> {
    let ((sx, cx), (sy, cy)) = (tau_x.sin_cos(), tau_y.sin_cos());
    let about_x = Matrix3::new(1.0, 0.0, 0.0, 0.0, cx, sx, 0.0, -sx, cx);
    let about_y = Matrix3::new(cy, 0.0, -sy, 0.0, 1.0, 0.0, sy, 0.0, cy);
    let r = about_y * about_x;
    Matrix3::new(r[(2, 2)], 0.0, -r[(0, 2)], 0.0, r[(2, 2)], -r[(1, 2)], 0.0, 0.0, 1.0) * r
}

impl std::fmt::Display for BrownConrady {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "BrownConrady([{}]{})", listed(self.coefficients()), shown(self.limit))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const KITTI: [f64; 5] = [-3.691481e-01, 1.968681e-01, 1.353473e-03, 5.677587e-04, -6.770705e-02];
    const ALL: [f64; 14] = [0.1, 0.02, 1e-3, -2e-3, 3e-3, 0.2, 0.1, 0.01, 1e-3, 2e-3, -1e-3, 3e-4, 0.0, 0.0];

    #[test]
    fn the_jacobian_is_that_of_differences() {
        for c in [&KITTI[..], &ALL[..12]] {
            let lens = BrownConrady::new(c, None).unwrap();
            for i in 0..400 {
                let (x, y) = (f64::from(i % 20) * 0.13 - 1.25, f64::from(i / 20) * 0.13 - 1.25);
                let h = 1e-5;
                let at = |x, y| Vector2::from(<[f64; 2]>::from(lens.bend::<14>(x, y)));
                let along_x = (at(x + h, y) - at(x - h, y)) / (2.0 * h);
                let along_y = (at(x, y + h) - at(x, y - h)) / (2.0 * h);
                let numeric = Matrix2::from_columns(&[along_x, along_y]);
                assert!((numeric - lens.jacobian(x, y)).abs().max() < 1e-8, "{x} {y}");
            }
        }
    }

    #[test]
    fn inside_the_domain_the_jacobian_is_positive_and_at_its_edge_it_is_zero() {
        let folds = [&KITTI[..], &[-0.3, 0.02, 0.02, -0.03], &[-0.2, 0.0, 0.0, 0.0, 0.0, 0.3, 0.0, 0.0]];
        let prisms = [&[-0.3, 0.02, 0.01, -0.02, 0.0, 0.0, 0.0, 0.0, 0.03, 0.01, -0.05, 0.0][..]];
        for c in folds.into_iter().chain(prisms) {
            let lens = BrownConrady::new(c, None).unwrap();
            let least = |r: f64| {
                let azimuths = (0..3600).map(|i| (f64::from(i) / 3600.0 * std::f64::consts::TAU).sin_cos());
                azimuths
                    .map(|(s, c)| {
                        let j = lens.jacobian(r * c, r * s);
                        (j + j.transpose()).symmetric_eigenvalues().min() / 2.0
                    })
                    .fold(f64::INFINITY, f64::min)
            };
            let end = lens.max_radius();
            assert!(end > 0.3 && end < 5.0, "{c:?} {end}");
            for i in 0..100 {
                assert!(least(end * f64::from(i) / 100.0) > 0.0, "{c:?}");
            }
            assert!(least(end).abs() < 1e-4 && least(end * 1.001) < 0.0, "{c:?} {}", least(end));
        }
    }

    #[test]
    fn the_limits_that_were_published() {
        // radial derivative alone: KITTI raw camera 2, see the fold-over hazard
        let radial = BrownConrady::new(&[KITTI[0], KITTI[1], 0.0, 0.0, KITTI[4]], None).unwrap();
        assert!((radial.max_angle().to_degrees() - 50.44).abs() < 0.005, "{}", radial.max_angle().to_degrees());
        let all = BrownConrady::new(&KITTI, None).unwrap();
        assert!(all.max_angle() < radial.max_angle() && all.max_angle() > radial.max_angle() - 0.002);
    }

    #[test]
    fn a_pole_of_the_rational_form_ends_the_domain() {
        let lens = BrownConrady::new(&[0.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0], None).unwrap();
        assert!((lens.max_radius() - 1.0).abs() < 1e-8); // 1 - s, and up to it the radius grows
    }

    #[test]
    fn no_distortion_is_a_pinhole() {
        let lens = BrownConrady::new(&[0.0; 5], None).unwrap();
        assert_eq!(lens.distort(3e9, -1.0, 2.0), (1.5e9, -0.5));
        assert_eq!(lens.max_angle(), std::f64::consts::FRAC_PI_2);
        assert_eq!(lens, BrownConrady::new(&[0.0; 14], None).unwrap());
    }
}
