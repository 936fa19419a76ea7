//! Brown-Conrady the other way: from what is seen to where it is.

use nalgebra::{Vector2, Vector3};

use super::{BrownConrady, Distort, coefficients, limit, listed, planar, polynomial, sees, shown};
use crate::error::{Error, LensError, Result};

const NAME: &str = "InverseBrownConrady";
const ORDER: &str = "4 or 5 (k1, k2, p1, p2[, k3])";
/// Radius on the image's plane beyond which nothing is looked for.
const WIDEST: f64 = 1e6;
/// Steps of a draft.
const STEPS: usize = 4;
/// The last step of a draft, in parts of m: the error after it is of the order of its square.
const SETTLED: f64 = 1e-9;

/// [`BrownConrady`]'s formula from the image to the ray: what is seen at m looks along `(B(m), 1)`, with `s = |m|^2` and
///
/// ```text
/// B = (x (1 + k1 s + k2 s^2 + k3 s^3) + 2 p1 x y + p2 (s + 2 x^2),
///      y (1 + k1 s + k2 s^2 + k3 s^3) + p1 (s + 2 y^2) + 2 p2 x y)        of (x, y) = m
/// ```
///
/// which projection inverts to rounding. Source: librealsense's `RS2_DISTORTION_INVERSE_BROWN_CONRADY` as `rs_types.h`
/// defines it.
///
/// Its domain is the largest cone within what B makes of the circle around the centre in which it is one-to-one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InverseBrownConrady {
    /// The formula, and where it folds.
    brown: BrownConrady,
    limit: Option<f64>,
    /// Largest |m|.
    end: f64,
    /// Tangent of the validity limit.
    tan_end: f64,
}

impl InverseBrownConrady {
    /// A lens from k1, k2, p1, p2 and perhaps k3. `max_angle`, radians from the axis, makes the domain smaller.
    ///
    /// # Errors
    /// [`LensError::Coefficients`] for another count than 4 or 5, [`LensError::Parameter`] for what is not finite or a limit
    /// that is none, [`LensError::Folds`] where the image folds back at once.
    pub fn new(given: &[f64], max_angle: Option<f64>) -> Result<Self> {
        coefficients::<5>(NAME, ORDER, &[4, 5], given)?;
        let limit = limit(NAME, max_angle)?;
        let brown = BrownConrady::new(given, None).map_err(|error| match error {
            Error::Lens(LensError::Folds { angle, .. }) => {
                Error::Lens(LensError::Folds { lens: NAME, expected: ORDER, angle })
            }
            other => other,
        })?;
        let end = brown.max_radius().min(WIDEST);
        let tan_limit = if limit < std::f64::consts::FRAC_PI_2 { limit.tan() } else { f64::INFINITY };
        let mut lens = Self { brown, limit: max_angle, end, tan_end: f64::INFINITY };
        lens.tan_end = lens.reach().min(tan_limit);
        sees(NAME, ORDER, lens.max_angle(), limit)?;
        Ok(lens)
    }

    /// The distance from the axis of what is nearest to it of the image of the circle of radius `end`, on the plane z = 1.
    fn reach(&self) -> f64 {
        const AZIMUTHS: u32 = 720;
        let [_, _, p1, p2, ..] = *self.brown.all_coefficients();
        let at = |azimuth: f64| {
            let (sin, cos) = azimuth.sin_cos();
            let (x, y) = self.brown.bend::<5>(self.end * cos, self.end * sin);
            x.hypot(y)
        };
        if p1 == 0.0 && p2 == 0.0 {
            return at(0.0);
        }
        // Between two directions it is smaller by less than this part of it: the step's square times what p1 and p2, which
        // are less than 1/6 of the rest before a fold, can add.
        let margin = 1.0 - 0.5 * (std::f64::consts::TAU / f64::from(AZIMUTHS)).powi(2);
        let all = (0..AZIMUTHS).map(|i| at(f64::from(i) / f64::from(AZIMUTHS) * std::f64::consts::TAU));
        all.fold(f64::INFINITY, f64::min) * margin
    }

    /// k1, k2, p1, p2, ... as given.
    pub fn coefficients(&self) -> &[f64] {
        self.brown.coefficients()
    }

    /// All five, zero where not given.
    pub fn all_coefficients(&self) -> &[f64] {
        &self.brown.all_coefficients()[..5]
    }

    /// The limit that was given.
    pub fn limit(&self) -> Option<f64> {
        self.limit
    }

    /// The validity limit, radians from the axis.
    pub fn max_angle(&self) -> f64 {
        self.tan_end.atan()
    }

    pub(super) fn undistort(&self, [x, y]: [f64; 2]) -> Option<Vector3<f64>> {
        const ROUNDING: f64 = 1.0 + 1e-12;
        let (bent_x, bent_y) = self.brown.bend::<5>(x, y);
        let seen = x.hypot(y) <= self.end * ROUNDING && bent_x.hypot(bent_y) <= self.tan_end * ROUNDING;
        seen.then(|| Vector3::new(bent_x, bent_y, 1.0))
    }

    /// The image of a direction inside the domain, by a search.
    #[cold]
    fn searched(&self, x: f64, y: f64) -> (f64, f64) {
        let target = Vector2::new(x, y);
        let [k1, k2, _, _, k3, ..] = *self.brown.all_coefficients();
        let length = target.norm();
        let error = |r: f64| {
            let s = r * r;
            (r * (1.0 + s * (k1 + s * (k2 + s * k3))) - length, 1.0 + s * (3.0 * k1 + s * (5.0 * k2 + s * 7.0 * k3)))
        };
        let start = target * (polynomial::root_of_increasing(self.end, length, error) / length);
        let error = |p: &Vector2<f64>| Vector2::from(<[f64; 2]>::from(self.brown.bend::<5>(p.x, p.y))) - target;
        let m = planar::root(start, self.end, length, error, |p| self.brown.jacobian(p.x, p.y));
        (m.x, m.y)
    }
}

impl Distort for InverseBrownConrady {
    const DRAFTS: bool = true;

    /// Steps of Newton's from the ray itself.
    #[inline(always)]
    fn draft(&self, x: f64, y: f64, z: f64) -> (f64, f64) {
        let w = 1.0 / z;
        let (x, y) = (x * w, y * w);
        let length = (x * x + y * y).sqrt();
        let inside = (z > 0.0) & (length <= self.tan_end);
        let [k1, k2, p1, p2, k3, ..] = *self.brown.all_coefficients();
        // by (u, v), with what is left of B(u, v) - (x, y)
        let step = |u: f64, v: f64| {
            let s = u * u + v * v;
            let radial = 1.0 + s * (k1 + s * (k2 + s * k3));
            let slope = 2.0 * (k1 + s * (2.0 * k2 + s * 3.0 * k3));
            let across = 2.0 * (p1 * v + p2 * u);
            let (ex, ey) = (u * (radial + across) + p2 * s - x, v * (radial + across) + p1 * s - y);
            let mixed = u * v * slope + 2.0 * (p1 * u + p2 * v);
            let a = radial + u * u * slope + 2.0 * p1 * v + 6.0 * p2 * u;
            let d = radial + v * v * slope + 6.0 * p1 * v + 2.0 * p2 * u;
            let over = 1.0 / (a * d - mixed * mixed);
            ((d * ex - mixed * ey) * over, (a * ey - mixed * ex) * over)
        };
        let (mut u, mut v, mut last) = (x, y, 0.0);
        let mut steps = STEPS;
        while steps > 0 {
            steps -= 1;
            let (du, dv) = step(u, v);
            (u, v, last) = (u - du, v - dv, du * du + dv * dv);
        }
        let square = u * u + v * v;
        let settled = (last <= SETTLED * SETTLED * square) & (square <= self.end * self.end);
        let u = if inside { u } else { f64::NAN };
        (if settled | !inside { u } else { f64::INFINITY }, if inside { v } else { f64::NAN })
    }

    #[inline]
    fn distort(&self, x: f64, y: f64, z: f64) -> (f64, f64) {
        let drafted = self.draft(x, y, z);
        if drafted.0 == f64::INFINITY { self.searched(x / z, y / z) } else { drafted }
    }
}

impl std::fmt::Display for InverseBrownConrady {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "InverseBrownConrady([{}]{})", listed(self.coefficients()), shown(self.limit))
    }
}
