//! Double sphere.

use nalgebra::Vector3;

use super::{Distort, limit, one_over_shifted, parameter, sees, shifted_sphere_z, shown};
use crate::error::Result;

/// Two unit spheres, xi apart, then a pinhole shifted by `alpha / (1 - alpha)`. With `d1 = |P|`, `k = xi d1 + Z`,
/// `d2 = sqrt(X^2 + Y^2 + k^2)`: `m = (X, Y) / (alpha d2 + (1 - alpha) k)`. Source: Usenko, Demmel and Cremers 2018
/// (basalt and Kalibr `ds`).
///
/// Its domain is theirs, `Z > -w2 d1`, `w1 = alpha / (1 - alpha)` up to alpha = 1/2, its inverse beyond,
/// `w2 = (w1 + xi) / sqrt(2 w1 xi + xi^2 + 1)`, and where xi < 0 takes that beyond the fold, what the fold leaves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DoubleSphere {
    xi: f64,
    alpha: f64,
    limit: Option<f64>,
    cos_end: f64,
    /// xi^2, xi^2 - 1, both with the sign of xi.
    squares: [f64; 2],
}

impl DoubleSphere {
    /// A lens from xi and alpha. `max_angle`, radians from the axis, makes the domain smaller.
    ///
    /// # Errors
    /// [`LensError::Parameter`](crate::error::LensError::Parameter) where xi is not above -1 and up to 1, alpha is not
    /// from 0 to 1, or the limit is none, [`LensError::Folds`](crate::error::LensError::Folds) where the image folds
    /// back at once.
    pub fn new(xi: f64, alpha: f64, max_angle: Option<f64>) -> Result<Self> {
        const NAME: &str = "DoubleSphere";
        parameter(NAME, "xi", "a number above -1 and up to 1", xi, xi > -1.0 && xi <= 1.0)?;
        let expected = "a number from 0 to 1 (the order is xi, alpha)";
        parameter(NAME, "alpha", expected, alpha, (0.0..=1.0).contains(&alpha))?;
        let w1 = if alpha <= 0.5 { alpha / (1.0 - alpha) } else { (1.0 - alpha) / alpha };
        let w2 = (w1 + xi) / (2.0 * w1 * xi + xi * xi + 1.0).sqrt();
        // The image ends or folds where k = -w1 d2, which on the unit sphere is this cosine. The paper's w2 takes the
        // point at that angle from the second sphere's surface instead: a little inside, but for some xi < 0 outside.
        let v = 1.0 - w1 * w1;
        let fold = -xi * v - w1 * (1.0 - xi * xi * v).max(0.0).sqrt();
        let limit = limit(NAME, max_angle)?;
        let cos_end = (-w2).max(fold).max(limit.cos());
        sees(NAME, "2 (xi, alpha)", cos_end.acos(), limit)?;
        let squares = [xi * xi.abs(), (xi - 1.0) * (xi + 1.0) * xi.signum()];
        Ok(Self { xi, alpha, limit: max_angle, cos_end, squares })
    }

    /// The distance of the spheres' centres.
    pub fn xi(&self) -> f64 {
        self.xi
    }

    /// The pinhole's shift, `alpha / (1 - alpha)`.
    pub fn alpha(&self) -> f64 {
        self.alpha
    }

    /// The limit that was given.
    pub fn limit(&self) -> Option<f64> {
        self.limit
    }

    /// The validity limit, radians from the axis.
    pub fn max_angle(&self) -> f64 {
        self.cos_end.acos()
    }

    /// Whether xi is so near to 1 or -1 that `k = xi d1 + Z` would lose digits straight behind or straight ahead: 2e-16 of
    /// 1 - |xi|. What keeps them makes a table take 1.2 times as long, and real lenses have |xi| < 0.6.
    pub(crate) fn is_near(&self) -> bool {
        self.xi.abs() > 0.9
    }

    pub(super) fn undistort(&self, [x, y]: [f64; 2]) -> Option<Vector3<f64>> {
        let Self { xi, alpha, .. } = *self;
        let s = x * x + y * y;
        let z = shifted_sphere_z(alpha, s)?;
        let root = (z * z + (1.0 - xi) * (1.0 + xi) * s).sqrt();
        // two forms of one number, each a sum of one sign
        let length =
            if z * xi < 0.0 { (1.0 - xi) * (1.0 + xi) / (root - z * xi) } else { (z * xi + root) / (z * z + s) };
        Some(Vector3::new(length * x, length * y, length * z - xi))
    }
}

/// [`DoubleSphere`], of which `NEAR` says [`DoubleSphere::is_near`].
pub(crate) struct Spheres<const NEAR: bool>(pub(crate) DoubleSphere);

impl<const NEAR: bool> Distort for Spheres<NEAR> {
    #[inline(always)]
    fn distort(&self, x: f64, y: f64, z: f64) -> (f64, f64) {
        let Self(lens) = self;
        let s = x * x + y * y;
        let d1 = (s + z * z).sqrt();
        let far = lens.xi * d1;
        let w = if NEAR {
            // The sum k of two numbers of one size and two signs is (xi^2 d1^2 - z^2) / (xi d1 - z), of which the divisor
            // scales all that follows instead, up to the end.
            let [xx, rest] = lens.squares;
            let opposed = far * z < 0.0;
            let k = if opposed { xx * s + rest * (z * z) } else { far + z };
            let scale = if opposed { (far - z).abs() } else { 1.0 };
            let t = s * (scale * scale);
            scale * one_over_shifted(lens.alpha, (t + k * k).sqrt(), k, t)
        } else {
            let k = far + z;
            one_over_shifted(lens.alpha, (s + k * k).sqrt(), k, s)
        };
        let w = if z > lens.cos_end * d1 { w } else { f64::NAN };
        (x * w, y * w)
    }
}

impl Distort for DoubleSphere {
    fn distort(&self, x: f64, y: f64, z: f64) -> (f64, f64) {
        if self.is_near() { Spheres::<true>(*self).distort(x, y, z) } else { Spheres::<false>(*self).distort(x, y, z) }
    }
}

impl std::fmt::Display for DoubleSphere {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "DoubleSphere({:?}, {:?}{})", self.xi, self.alpha, shown(self.limit))
    }
}
