//! Scaramuzza's omnidirectional camera.

use nalgebra::Vector3;

use super::angle::angle_from_axis;
use super::{Distort, limit, listed, parameter, polynomial, sees, shown};
use crate::error::{Error, Result};

/// Coefficients that the polynomial may have.
const MOST: usize = 12;
/// Entries of the table that a search begins with.
const STARTS: usize = 17;
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
    /// [`Error::LensCoefficients`] for no coefficients or more than 12, [`Error::LensParameter`] for what is not finite,
    /// a0 = 0, an affine map that is singular or turns the image over, or a limit that is none, [`Error::LensFolds`] where
    /// the image folds back at once.
    pub fn new(given: &[f64], affine: [f64; 3], max_angle: Option<f64>) -> Result<Self> {
        const NAME: &str = "Ocam";
        if given.is_empty() || given.len() > MOST {
            let expected = "1 to 12 (a0, a1, a2, ..., of the direct mapping, constant first)";
            return Err(Error::LensCoefficients { lens: NAME, expected, got: given.len() });
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
        let mut lens =
            Self { polynomial, count, affine, limit: max_angle, forward, end, f_end: 0.0, angle_end: 0.0, starts };
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
        Ok(lens)
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
        // Newton from nearby ends after three or four steps, but for the edge, where the safe search takes over. The error
        // after a step is of the order of its square.
        let mut rho = start;
        for _ in 0..8 {
            let (value, slope) = error(rho);
            let step = value / slope;
            rho -= step;
            if step.abs() <= 1e-9 * rho && rho <= self.end {
                return rho;
            }
        }
        polynomial::root_of_increasing(self.end, start, error)
    }

    pub(super) fn undistort(&self, m: [f64; 2]) -> Option<Vector3<f64>> {
        let [c, d, e] = self.affine;
        let det = c - d * e;
        let (x, y) = ((c * m[0] - e * m[1]) / det, (m[1] - d * m[0]) / det);
        let rho = x.hypot(y);
        (rho <= self.end * (1.0 + 1e-12)).then(|| Vector3::new(x, y, self.f(rho)))
    }
}

impl Distort for Ocam {
    #[inline]
    fn distort(&self, x: f64, y: f64, z: f64) -> (f64, f64) {
        let r = (x * x + y * y).sqrt();
        let length = (r * r + z * z).sqrt();
        let inside = self.end * z - self.f_end * r >= 0.0 && length > 0.0 && (r > 0.0 || z > 0.0);
        if !inside {
            return (f64::NAN, f64::NAN);
        }
        let (sin, cos) = (r / length, z / length);
        let scale = if r > 0.0 { self.radius(sin, cos, self.start(sin, cos)) / r } else { 0.0 };
        let (x, y) = (x * scale, y * scale);
        let [c, d, e] = self.affine;
        (x + e * y, d * x + c * y)
    }
}

impl std::fmt::Display for Ocam {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [c, d, e] = self.affine;
        write!(f, "Ocam([{}], affine=({c:?}, {d:?}, {e:?}){})", listed(self.polynomial()), shown(self.limit))
    }
}
