//! NVIDIA's f-theta lens.

use nalgebra::Vector3;

use super::angle::angle_from_axis;
use super::fit::Fit;
use super::of_angle::{OfAngle, at_angle};
use super::{Distort, limit, listed, parameter, sees, shown};
use crate::error::{Error, LensError, Result};

/// Powers that the polynomial may have, and its coefficients with the constant.
const POWERS: usize = 11;
const MOST: usize = POWERS + 1;
/// The last step of a search, in parts of rho: the error after it is of the order of its square.
const SETTLED: f64 = 1e-9;
/// Pixels from the centre beyond which nothing is looked for.
const WIDEST: f64 = 1e5;
const NAME: &str = "FTheta";
const ORDER: &str = "2 to 12 (a0 = 0, a1, a2, ..., constant first)";

/// Which way the polynomial of [`FTheta`] goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FThetaForm {
    /// From the angle in radians to the distance in pixels: `angle-to-pixeldistance`, `fw_poly`.
    Forward,
    /// From the distance in pixels to the angle in radians: `pixeldistance-to-angle`, `bw_poly`.
    Backward,
}

/// The f-theta lens of NVIDIA's DriveWorks: a polynomial of any degree up to 11 between the angle t from the axis and the
/// distance rho from the centre in pixels, `rho = a1 t + a2 t^2 + ...` ([`FThetaForm::Forward`]) or `t = a1 rho + a2 rho^2 +
/// ...` ([`FThetaForm::Backward`]), which projection inverts to rounding. Then (c, d, e): `m = (c X' + d Y', e X' + Y')` of
/// `(X', Y') = (X, Y) rho / r`. K is `[[1, 0, cx], [0, 1, cy], [0, 0, 1]]`. Source: DriveWorks' rig format (`ftheta` with
/// `polynomial`, `polynomial-type`, `linear-c`, `linear-d`, `linear-e`).
///
/// Its domain ends where the polynomial stops growing.
#[derive(Debug, Clone, Copy)]
pub struct FTheta {
    polynomial: [f64; MOST],
    count: usize,
    form: FThetaForm,
    /// c, d, e.
    linear: [f64; 3],
    limit: Option<f64>,
    /// The polynomial without its constant.
    curve: OfAngle<POWERS, 1>,
    /// The validity limit, radians from the axis, and rho there.
    end: (f64, f64),
    /// Where a search for rho begins, by the angle.
    fit: Fit,
}

/// Zeros behind make no difference.
impl PartialEq for FTheta {
    fn eq(&self, other: &Self) -> bool {
        (self.polynomial, self.form, self.linear, self.end) == (other.polynomial, other.form, other.linear, other.end)
    }
}

impl FTheta {
    /// A lens from its polynomial a0, a1, a2, ..., constant first, which is 0, and (c, d, e). `max_angle`, radians from the
    /// axis, makes the domain smaller.
    ///
    /// # Errors
    /// [`LensError::Coefficients`] for fewer than 2 coefficients or more than 12, [`LensError::Parameter`] for what is not
    /// finite, a0 that is not 0, a1 that is not positive, a linear map that is singular or turns the image over, or a limit
    /// that is none, [`LensError::Folds`] where the image folds back at once.
    pub fn new(given: &[f64], form: FThetaForm, linear: [f64; 3], max_angle: Option<f64>) -> Result<Self> {
        if !(2..=MOST).contains(&given.len()) {
            return Err(Error::Lens(LensError::Coefficients { lens: NAME, expected: ORDER, got: given.len() }));
        }
        let mut polynomial = [0.0; MOST];
        for (own, &value) in polynomial.iter_mut().zip(given) {
            *own = parameter(NAME, "polynomial", "finite numbers", value, value.is_finite())?;
        }
        for value in linear {
            parameter(NAME, "linear", "(c, d, e), finite numbers", value, value.is_finite())?;
        }
        let [c, d, e] = linear;
        let expected = "0, because the axis is one pixel; the constant comes first";
        parameter(NAME, "a0", expected, polynomial[0], polynomial[0] == 0.0)?;
        let expected = match form {
            FThetaForm::Forward => "pixels per radian on the axis, above 0; is the polynomial reversed?",
            FThetaForm::Backward => "radians per pixel on the axis, above 0; is the polynomial reversed?",
        };
        parameter(NAME, "a1", expected, polynomial[1], polynomial[1] > 0.0)?;
        // which form it is shows: a lens has from 10 to a million pixels per radian
        let other = match form {
            FThetaForm::Forward => polynomial[1] < 0.1,
            FThetaForm::Backward => polynomial[1] > 10.0,
        };
        let expected = match form {
            FThetaForm::Forward => "pixels per radian; these are radians per pixel, form=\"backward\"",
            FThetaForm::Backward => "radians per pixel; these are pixels per radian, form=\"forward\"",
        };
        parameter(NAME, "a1", expected, polynomial[1], !other)?;
        let expected = "c - d e above 0 (the order is c, d, e)";
        parameter(NAME, "linear", expected, c - d * e, c - d * e > 0.0)?;
        let limit = limit(NAME, max_angle)?;
        let powers: [f64; POWERS] = std::array::from_fn(|i| polynomial[i + 1]);
        let (count, fit) = (given.len(), Fit::NONE);
        let lens = |curve, end| Self { polynomial, count, form, linear, limit: max_angle, curve, end, fit };
        match form {
            FThetaForm::Forward => {
                let curve = OfAngle::new(NAME, ORDER, powers, limit)?;
                Ok(lens(curve, (curve.end(), curve.radius(curve.end()))))
            }
            FThetaForm::Backward => {
                let curve = OfAngle::new(NAME, ORDER, powers, WIDEST).map_err(|error| match error {
                    // the same in radians
                    Error::Lens(LensError::Folds { lens, expected, angle }) => {
                        Error::Lens(LensError::Folds { lens, expected, angle: angle * polynomial[1] })
                    }
                    other => other,
                })?;
                let all = (curve.radius(curve.end()), curve.end());
                let end = if limit < all.0 { (limit, curve.angle(limit)) } else { all };
                sees(NAME, ORDER, end.0, limit)?;
                let mut lens = lens(curve, end);
                lens.fit = Fit::widest(
                    |part| lens.end.0 * part,
                    |angle| lens.searched(angle),
                    |fit, angle| lens.drafted(fit, angle).1,
                );
                Ok(lens)
            }
        }
    }

    /// a0, a1, ... as given.
    pub fn polynomial(&self) -> &[f64] {
        &self.polynomial[..self.count]
    }

    /// a0, a1, ..., zero where not given.
    pub fn all_coefficients(&self) -> &[f64] {
        &self.polynomial
    }

    /// Which way the polynomial goes.
    pub fn form(&self) -> FThetaForm {
        self.form
    }

    /// (c, d, e).
    pub fn linear(&self) -> [f64; 3] {
        self.linear
    }

    /// The limit that was given.
    pub fn limit(&self) -> Option<f64> {
        self.limit
    }

    /// The validity limit, radians from the axis.
    pub fn max_angle(&self) -> f64 {
        self.end.0
    }

    /// Pixels per radian on the axis.
    pub(super) fn unit(&self) -> f64 {
        match self.form {
            FThetaForm::Forward => self.polynomial[1],
            FThetaForm::Backward => 1.0 / self.polynomial[1],
        }
    }

    /// rho at the angle t by a fit and two steps of Newton's, and whether they came to rest.
    #[inline(always)]
    fn drafted(&self, fit: &Fit, t: f64) -> (f64, bool) {
        let (rho, good) = fit.at(t);
        let q = self.curve.coefficients();
        let step = |rho: f64| {
            let (mut value, mut slope) = (0.0, 0.0);
            let mut power = q.len();
            while power > 0 {
                power -= 1;
                slope = slope * rho + value;
                value = value * rho + q[power];
            }
            // of rho q(rho)
            (rho * value - t) / (rho * slope + value)
        };
        let rho = rho - step(rho);
        let last = step(rho);
        let rho = rho - last;
        (rho, good & (last.abs() <= SETTLED * rho) & (rho <= self.end.1))
    }

    /// rho at the angle t, by a search.
    #[cold]
    fn searched(&self, t: f64) -> f64 {
        self.curve.angle(t).min(self.end.1)
    }

    pub(super) fn undistort(&self, m: [f64; 2]) -> Option<Vector3<f64>> {
        let [c, d, e] = self.linear;
        let det = c - d * e;
        let (x, y) = ((m[0] - d * m[1]) / det, (c * m[1] - e * m[0]) / det);
        match self.form {
            FThetaForm::Forward => Some(self.curve.undistort([x, y])),
            FThetaForm::Backward => {
                let rho = x.hypot(y);
                (rho <= self.end.1 * (1.0 + 1e-12)).then(|| at_angle([x, y], rho, self.curve.radius(rho)))
            }
        }
    }
}

/// [`FTheta`], of which `BACKWARD` says the form.
pub(crate) struct Way<const BACKWARD: bool>(pub(crate) FTheta);

impl<const BACKWARD: bool> Distort for Way<BACKWARD> {
    const DRAFTS: bool = BACKWARD;

    #[inline(always)]
    fn draft(&self, x: f64, y: f64, z: f64) -> (f64, f64) {
        let Self(lens) = self;
        if !BACKWARD {
            let (x, y) = lens.curve.distort(x, y, z);
            return linear(lens.linear, x, y);
        }
        let r = (x * x + y * y).sqrt();
        let t = angle_from_axis(r, z);
        let inside = t <= lens.end.0;
        let (rho, settled) = lens.drafted(&lens.fit, t);
        let scale = if r > 0.0 { rho / r } else { 0.0 };
        let scale = if inside { scale } else { f64::NAN };
        let (u, v) = linear(lens.linear, x * scale, y * scale);
        (if settled | !inside | (r == 0.0) { u } else { f64::INFINITY }, v)
    }

    #[inline(always)]
    fn distort(&self, x: f64, y: f64, z: f64) -> (f64, f64) {
        let drafted = self.draft(x, y, z);
        // forward there is nothing to search, and a branch would keep the compiler from vectors
        if !BACKWARD || drafted.0 != f64::INFINITY {
            return drafted;
        }
        let r = (x * x + y * y).sqrt();
        let scale = self.0.searched(angle_from_axis(r, z)) / r;
        linear(self.0.linear, x * scale, y * scale)
    }
}

impl Distort for FTheta {
    fn distort(&self, x: f64, y: f64, z: f64) -> (f64, f64) {
        match self.form {
            FThetaForm::Forward => Way::<false>(*self).distort(x, y, z),
            FThetaForm::Backward => Way::<true>(*self).distort(x, y, z),
        }
    }
}

#[inline(always)]
fn linear([c, d, e]: [f64; 3], x: f64, y: f64) -> (f64, f64) {
    (c * x + d * y, e * x + y)
}

impl std::fmt::Display for FThetaForm {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Forward => "forward",
            Self::Backward => "backward",
        })
    }
}

impl std::fmt::Display for FTheta {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [c, d, e] = self.linear;
        let (polynomial, form, limit) = (listed(self.polynomial()), self.form, shown(self.limit));
        write!(f, "FTheta([{polynomial}], '{form}', linear=({c:?}, {d:?}, {e:?}){limit})")
    }
}
