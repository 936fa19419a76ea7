//! The field-of-view model.

use nalgebra::Vector3;

use super::angle::angle_from_axis;
use super::of_angle::at_angle;
use super::{Distort, limit, parameter, shown};
use crate::error::Result;

/// The field-of-view model, also called arctangent, ATAN and in PTAM `w`. With `r = sqrt(X^2 + Y^2) / Z`:
/// `rho = atan(2 r tan(omega / 2)) / omega`, `m = (X, Y) / Z * rho / r`. Source: Devernay and Faugeras 2001; COLMAP `FOV`,
/// Kalibr `fov`, DSO.
///
/// Its domain is all that lies in front of the camera, `Z > 0`: the formula has no value elsewhere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fov {
    omega: f64,
    /// 2 tan(omega / 2).
    slope: f64,
    limit: Option<f64>,
    cos_end: f64,
}

impl Fov {
    /// A lens from omega, radians. `max_angle`, radians from the axis, makes the domain smaller.
    ///
    /// # Errors
    /// [`LensError::Parameter`](crate::error::LensError::Parameter) where omega is not above 0 and below pi, or the limit is none.
    pub fn new(omega: f64, max_angle: Option<f64>) -> Result<Self> {
        const NAME: &str = "Fov";
        let expected = "radians, above 0 and below pi (for 0, which bends nothing, leave the lens out)";
        parameter(NAME, "omega", expected, omega, omega > 1e-12 && omega < std::f64::consts::PI)?;
        let cos_end = limit(NAME, max_angle)?.cos().max(0.0);
        Ok(Self { omega, slope: 2.0 * (0.5 * omega).tan(), limit: max_angle, cos_end })
    }

    /// The parameter, radians.
    pub fn omega(&self) -> f64 {
        self.omega
    }

    /// The limit that was given.
    pub fn limit(&self) -> Option<f64> {
        self.limit
    }

    /// The validity limit, radians from the axis.
    pub fn max_angle(&self) -> f64 {
        self.cos_end.acos()
    }

    pub(super) fn undistort(&self, m: [f64; 2]) -> Option<Vector3<f64>> {
        let rho = m[0].hypot(m[1]);
        let angle = rho * self.omega;
        // tan(angle) is slope tan(t)
        let bent = at_angle(m, rho, angle);
        (angle < std::f64::consts::FRAC_PI_2).then(|| Vector3::new(bent.x, bent.y, bent.z * self.slope))
    }
}

impl Distort for Fov {
    #[inline(always)]
    fn distort(&self, x: f64, y: f64, z: f64) -> (f64, f64) {
        let r = (x * x + y * y).sqrt();
        let inside = (z > 0.0) & (z > self.cos_end * (r * r + z * z).sqrt());
        let rho = angle_from_axis(self.slope * r, z) / self.omega;
        let scale = if r > 0.0 { rho / r } else { 0.0 };
        let scale = if inside { scale } else { f64::NAN };
        (x * scale, y * scale)
    }
}

impl std::fmt::Display for Fov {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Fov({:?}{})", self.omega, shown(self.limit))
    }
}
