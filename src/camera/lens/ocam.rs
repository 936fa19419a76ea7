//! Scaramuzza's omnidirectional camera.

use nalgebra::Vector3;

use super::angle::angle_from_axis;
use super::fit::Fit;
use super::{Distort, limit, listed, parameter, polynomial, sees, shown};
use crate::error::{Error, LensError, Result};

/// Coefficients that the polynomial may have.
const MOST: usize = 12;
/// Entries of the table that a search begins with.
const STARTS: usize = 9;
/// The last step of a search, in parts of rho: the error after it is of the order of its square.
const SETTLED: f64 = 1e-9;
/// Pixels from the centre beyond which nothing is looked for.
const WIDEST: f64 = 1e5;

/// The polynomial of OCamCalib. The pixel at distance rho from the centre looks along `(x, y, f(rho))`,
/// `f = a0 + a1 rho + a2 rho^2 + ...`, in pixels; projection solves `rho / f(rho) = r / Z`, so that the two directions
/// agree to rounding (the inverse polynomial of the same file is a fit, off by up to a pixel, and is not used).
///
/// In the file, x counts rows down and y columns to the right, `row = c x + d y + xc`, `column = e x + y + yc`, and z
/// points out of the camera's back, so that a0 < 0; MATLAB's `fisheyeIntrinsics` has the same with a0 > 0. Either
/// sign is taken: the axis, rho = 0, looks forward. In the optical frame that is
/// `m = (X' + e Y', d X' + c Y')` with X' to the right and Y' down, and K is `[[1, 0, yc], [0, 1, xc], [0, 0, 1]]`.
/// Source: Scaramuzza, Martinelli and Siegwart 2006; OCamCalib's `cam2world` and `world2cam`.
///
/// Its domain ends where the angle stops growing with rho.
#[derive(Debug, Clone, Copy)]
pub struct Ocam {
    /// As given.
    polynomial: [f64; MOST],
    count: usize,
    /// c, d, e.
    affine: [f64; 3],
    limit: Option<f64>,
    /// f with z forward: the sign of a0 taken out.
    forward: [f64; MOST],
    /// Largest rho of the domain.
    end: f64,
    /// f there.
    f_end: f64,
    /// The angle there.
    angle_end: f64,
    /// rho at equal steps of the angle from 0 to the end: where the search begins.
    starts: [f64; STARTS],
    /// Where a draft begins.
    fit: Fit,
}

/// The signs of both conventions, and zeros behind, make no difference.
impl PartialEq for Ocam {
    fn eq(&self, other: &Self) -> bool {
        (self.forward, self.affine, self.end) == (other.forward, other.affine, other.end)
    }
}

impl Ocam {
    /// A lens from the forward polynomial `a0, a1, a2, ...` ("ss", the direct mapping function, `cam2world`) and the
    /// affine parameters (c, d, e). `max_angle`, radians from the axis, makes the domain smaller.
    ///
    /// # Errors
    /// [`LensError::Coefficients`] for no coefficients or more than 12, [`LensError::Parameter`] for what is not
    /// finite, a0 = 0, an affine map that is singular or turns the image over, or a limit that is none,
    /// [`LensError::Folds`] where the image folds back at once.
    pub fn new(given: &[f64], affine: [f64; 3], max_angle: Option<f64>) -> Result<Self> {
        const NAME: &str = "Ocam";
        if given.is_empty() || given.len() > MOST {
            let expected = "1 to 12 (a0, a1, a2, ..., of the direct mapping, constant first)";
            return Err(Error::Lens(LensError::Coefficients { lens: NAME, expected, got: given.len() }));
        }
        let mut polynomial = [0.0; MOST];
        for (own, &value) in polynomial.iter_mut().zip(given) {
            *own = parameter(NAME, "polynomial", "finite numbers", value, value.is_finite())?;
        }
        for value in affine {
            parameter(NAME, "affine", "(c, d, e), finite numbers", value, value.is_finite())?;
        }
        let expected = "other than 0, the focal length in pixels up to its sign; is the polynomial reversed?";
        parameter(NAME, "a0", expected, polynomial[0], polynomial[0] != 0.0)?;
        let [c, d, e] = affine;
        let expected = "c - d e above 0 (the order is c, d, e)";
        parameter(NAME, "affine", expected, c - d * e, c - d * e > 0.0)?;
        let limit = limit(NAME, max_angle)?;
        let forward = polynomial.map(|a| a * polynomial[0].signum());
        // the angle grows with rho as long as f - rho f' is positive
        let growth: [f64; MOST] = std::array::from_fn(|power| (1.0 - power as f64) * forward[power]);
        let end = polynomial::positive_until(&growth, WIDEST).unwrap_or(WIDEST);
        let (count, starts) = (given.len(), [0.0; STARTS]);
        let fit = Fit::NONE;
        let mut lens =
            Self { polynomial, count, affine, limit: max_angle, forward, end, f_end: 0.0, angle_end: 0.0, starts, fit };
        if limit < lens.max_angle() {
            let (sin, cos) = limit.sin_cos();
            lens.end = lens.radius(sin, cos, 0.0);
        }
        lens.f_end = lens.f(lens.end);
        lens.angle_end = lens.max_angle();
        sees(NAME, "1 to 12 (a0, a1, a2, ..., constant first)", lens.angle_end, limit)?;
        let step = lens.angle_end / (STARTS - 1) as f64;
        for i in 1..STARTS {
            let (sin, cos) = (step * i as f64).sin_cos();
            lens.starts[i] = lens.radius(sin, cos, lens.starts[i - 1]);
        }
        lens.fit = lens.fitted();
        Ok(lens)
    }

    /// Where drafts begin, by the tangent of half the angle: a tangent takes one division, the angle a series of eleven terms
    /// too.
    fn fitted(&self) -> Fit {
        let largest = |part: f64| (0.5 * self.angle_end * part).tan();
        let exact = |tangent: f64| {
            let (sin, cos) = (2.0 * tangent.atan()).sin_cos();
            self.radius(sin, cos, self.start(sin, cos))
        };
        Fit::widest(largest, exact, |fit, t| {
            let lens = Self { fit: *fit, ..*self };
            lens.drafted::<MOST>(2.0 * t, 0.0, (1.0 - t) * (1.0 + t)).0 != f64::INFINITY
        })
    }

    /// The image of a direction by [`Fit`] and two steps of Newton's, with the first `N` coefficients: any others are 0. The
    /// first number is infinite where that has not come to rest as a search would ([`Ocam::radius`]).
    #[inline(always)]
    fn drafted<const N: usize>(&self, x: f64, y: f64, z: f64) -> (f64, f64) {
        let r = (x * x + y * y).sqrt();
        let length = (r * r + z * z).sqrt();
        let inside = (self.end * z - self.f_end * r >= 0.0) & ((r > 0.0) | (z > 0.0));
        let (rho, good) = self.fit.at(r / (length + z));
        // a closure that is called twice, and not a loop around a loop: of that the compiler makes no vectors
        let step = |rho: f64| {
            let (mut f, mut slope) = (0.0, 0.0);
            let mut power = N;
            while power > 0 {
                power -= 1;
                slope = slope * rho + f;
                f = f * rho + self.forward[power];
            }
            (rho * z - f * r) / (z - slope * r)
        };
        let rho = rho - step(rho);
        let step = step(rho);
        let rho = rho - step;
        let settled = good & (step.abs() <= SETTLED * rho) & (rho <= self.end);
        let scale = if r > 0.0 { rho / r } else { 0.0 };
        let scale = if inside { scale } else { f64::NAN };
        let (x, y) = (x * scale, y * scale);
        let [c, d, e] = self.affine;
        (if settled | !inside { x + e * y } else { f64::INFINITY }, d * x + c * y)
    }

    /// a0, a1, ... as given.
    pub fn polynomial(&self) -> &[f64] {
        &self.polynomial[..self.count]
    }

    /// (c, d, e).
    pub fn affine(&self) -> [f64; 3] {
        self.affine
    }

    /// The limit that was given.
    pub fn limit(&self) -> Option<f64> {
        self.limit
    }

    /// The validity limit, radians from the axis.
    pub fn max_angle(&self) -> f64 {
        self.end.atan2(self.f(self.end))
    }

    /// f with z forward, 12 coefficients.
    pub fn forward(&self) -> &[f64] {
        &self.forward
    }

    #[inline]
    fn f(&self, rho: f64) -> f64 {
        polynomial::value(&self.forward[..self.count], rho)
    }

    /// Where to look for rho of the direction at sin and cos from the axis.
    #[inline]
    fn start(&self, sin: f64, cos: f64) -> f64 {
        let steps = angle_from_axis(sin, cos) * (STARTS - 1) as f64 / self.angle_end;
        let below = (steps as usize).min(STARTS - 2);
        let (low, high) = (self.starts[below], self.starts[below + 1]);
        low + (high - low) * (steps - below as f64)
    }

    /// rho of the direction at sin and cos from the axis.
    #[inline]
    fn radius(&self, sin: f64, cos: f64, start: f64) -> f64 {
        let error = |rho: f64| {
            let (mut f, mut slope) = (0.0, 0.0);
            for &a in self.forward[..self.count].iter().rev() {
                slope = slope * rho + f;
                f = f * rho + a;
            }
            (rho * cos - f * sin, cos - slope * sin)
        };
        // Newton from nearby ends after three or four steps, but for the edge, where the safe search takes over
        let mut rho = start;
        for _ in 0..8 {
            let (value, slope) = error(rho);
            let step = value / slope;
            rho -= step;
            if step.abs() <= SETTLED * rho && rho <= self.end {
                return rho;
            }
        }
        polynomial::root_of_increasing(self.end, start, error)
    }

    /// The image of a direction inside the domain, by a search.
    #[cold]
    fn searched(&self, x: f64, y: f64, z: f64) -> (f64, f64) {
        let r = (x * x + y * y).sqrt();
        let length = (r * r + z * z).sqrt();
        let (sin, cos) = (r / length, z / length);
        let scale = if r > 0.0 { self.radius(sin, cos, self.start(sin, cos)) / r } else { 0.0 };
        let (x, y) = (x * scale, y * scale);
        let [c, d, e] = self.affine;
        (x + e * y, d * x + c * y)
    }

    pub(super) fn undistort(&self, m: [f64; 2]) -> Option<Vector3<f64>> {
        let [c, d, e] = self.affine;
        let det = c - d * e;
        let (x, y) = ((c * m[0] - e * m[1]) / det, (m[1] - d * m[0]) / det);
        let rho = x.hypot(y);
        (rho <= self.end * (1.0 + 1e-12)).then(|| Vector3::new(x, y, self.f(rho)))
    }
}

/// [`Ocam`], of whose coefficients only the first `N` are other than 0. Which `N` it is changes no bit.
pub(crate) struct Radii<const N: usize>(pub(crate) Ocam);

impl<const N: usize> Distort for Radii<N> {
    const DRAFTS: bool = true;

    #[inline(always)]
    fn draft(&self, x: f64, y: f64, z: f64) -> (f64, f64) {
        self.0.drafted::<N>(x, y, z)
    }

    #[inline]
    fn distort(&self, x: f64, y: f64, z: f64) -> (f64, f64) {
        self.0.distort(x, y, z)
    }
}

impl Distort for Ocam {
    #[inline]
    fn distort(&self, x: f64, y: f64, z: f64) -> (f64, f64) {
        let drafted = if self.count <= 5 { self.drafted::<5>(x, y, z) } else { self.drafted::<MOST>(x, y, z) };
        if drafted.0 == f64::INFINITY { self.searched(x, y, z) } else { drafted }
    }
}

impl std::fmt::Display for Ocam {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [c, d, e] = self.affine;
        write!(f, "Ocam([{}], affine=({c:?}, {d:?}, {e:?}){})", listed(self.polynomial()), shown(self.limit))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Lenses of OCamCalib's samples and of MATLAB's, one with a fold, one with all coefficients, one that wriggles.
    fn lenses() -> Vec<Ocam> {
        let lens = |given: &[f64], affine, limit| Ocam::new(given, affine, limit).unwrap();
        vec![
            lens(&[-340.0, 0.0, 8e-4, -3e-7, 1.2e-9], [1.0, 1e-3, -5e-4], None),
            lens(&[-259.4, 0.0, 9.1e-4, -2.2e-6, 5.2e-9], [0.9998, 1e-4, 2e-4], Some(1.7)),
            lens(&[-300.0, 0.0, 1e-3, -1e-6, 1e-9], [1.001, 2e-3, -3e-3], None),
            lens(&[348.4, 0.0, -7e-4, 4.5e-8, -2e-10], [1.0, 0.0, 0.0], Some(1.6)),
            lens(&[-1.0, 0.0, 0.3, -0.05, 0.02], [1.01, 0.02, -0.01], None),
            lens(&[-400.0], [1.0, 0.0, 0.0], None),
            lens(&[-300.0, 0.0, 1e-3, -1e-6, 1e-9, 1e-13, -1e-16, 0.0, 1e-22, 0.0, 0.0, 1e-31], [1.0, 0.0, 0.0], None),
            lens(&[-300.0, 0.05, 1e-3, -9e-6, 3e-8, -3e-11, 1e-14], [1.0, 0.0, 0.0], None),
        ]
    }

    /// rho by bisection, which needs no start and no slope.
    fn bisected(lens: &Ocam, sin: f64, cos: f64) -> f64 {
        let (mut low, mut high) = (0.0, lens.end);
        for _ in 0..200 {
            let middle = 0.5 * (low + high);
            if middle * cos - lens.f(middle) * sin < 0.0 { low = middle } else { high = middle }
        }
        0.5 * (low + high)
    }

    #[test]
    fn images_are_those_of_the_exact_radius() {
        for lens in lenses() {
            let steps = 5000;
            let mut open = 0;
            for i in 1..steps {
                let angle = lens.angle_end * f64::from(i) / f64::from(steps);
                let (sin, cos) = angle.sin_cos();
                let expected = bisected(&lens, sin, cos);
                for length in [1.0, 3e-7, 2e9] {
                    let (x, y) = lens.distort(0.6 * sin * length, 0.8 * sin * length, cos * length);
                    let [c, d, e] = lens.affine;
                    let det = c - d * e;
                    let (x, y) = ((c * x - e * y) / det, (y - d * x) / det);
                    // an angle is known to rounding: near a fold, that is far from rounding of rho
                    let slope: f64 = (1..MOST).map(|n| n as f64 * lens.forward[n] * expected.powi(n as i32 - 1)).sum();
                    let condition = lens.f(expected).hypot(expected) / (cos - slope * sin).abs();
                    let tolerance = 2e-15 * (condition + expected);
                    assert!((x.hypot(y) - expected).abs() <= tolerance, "{lens} {angle}: {} {expected}", x.hypot(y));
                }
                let drafted = lens.drafted::<MOST>(0.6 * sin, 0.8 * sin, cos);
                open += u32::from(drafted.0 == f64::INFINITY && angle < 1.7_f64.min(0.9 * lens.angle_end));
                if lens.count <= 5 {
                    assert_eq!(lens.drafted::<5>(0.6 * sin, 0.8 * sin, cos), drafted);
                }
            }
            // a draft settles, but for where rho runs off behind, and before a fold
            let most = if lens.count <= 5 { 0 } else { steps / 4 };
            assert!(open <= most, "{lens}: {open} of {steps} open, {} to {}", lens.fit.scale(), lens.angle_end);
        }
    }

    #[test]
    fn on_the_axis_and_outside() {
        for lens in lenses() {
            assert_eq!(lens.distort(0.0, 0.0, 2.0), (0.0, 0.0));
            for (x, y, z) in [(0.0, 0.0, 0.0), (0.0, 0.0, -1.0), (1e-9, 0.0, -1.0), (f64::NAN, 0.0, 1.0)] {
                let image = lens.distort(x, y, z);
                assert!(image.0.is_nan() && image.1.is_nan(), "{lens} {x} {y} {z}: {image:?}");
                assert!(lens.drafted::<MOST>(x, y, z).0.is_nan());
            }
        }
    }
}
