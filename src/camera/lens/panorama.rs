//! Panoramas: cylindrical and equirectangular.

use nalgebra::Vector3;

use super::angle::angle_from_axis;
use super::{Distort, parameter, shown};
use crate::error::Result;

/// A panorama's limit, by its cosine; -2 where there is none, because a panorama has an image straight behind.
fn cos_end(lens: &'static str, max_angle: Option<f64>) -> Result<f64> {
    let Some(angle) = max_angle else { return Ok(-2.0) };
    let expected = "an angle from the axis in radians, above 0 and up to pi (np.radians of degrees)";
    parameter(lens, "max_angle", expected, angle, angle > 0.0 && angle <= std::f64::consts::PI)?;
    Ok(if angle == std::f64::consts::PI { -2.0 } else { angle.cos() })
}

/// The angle of (x, z) from the z axis, to the right; 0 straight above and below.
#[inline(always)]
fn longitude(x: f64, z: f64) -> f64 {
    let z = if (x == 0.0) & (z == 0.0) { 1.0 } else { z };
    angle_from_axis(x.abs(), z).copysign(x)
}

macro_rules! panorama {
    ($(#[$doc:meta])* $model:ident, $name:literal,
     |$y:ident, $level:ident| $down:expr, |$v:ident| $back:expr) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub struct $model {
            limit: Option<f64>,
            cos_end: f64,
        }

        impl $model {
            /// The lens. `max_angle`, radians from the axis, makes the domain smaller.
            ///
            /// # Errors
            /// [`LensError::Parameter`](crate::error::LensError::Parameter) where the limit is none.
            pub fn new(max_angle: Option<f64>) -> Result<Self> {
                Ok(Self { limit: max_angle, cos_end: cos_end($name, max_angle)? })
            }

            /// The limit that was given.
            pub fn limit(&self) -> Option<f64> {
                self.limit
            }

            /// The validity limit, radians from the axis.
            pub fn max_angle(&self) -> f64 {
                self.limit.unwrap_or(std::f64::consts::PI)
            }

            pub(super) fn undistort(&self, [x, y]: [f64; 2]) -> Option<Vector3<f64>> {
                let (sin, cos) = x.sin_cos();
                // a seam has two sides, and what lies beyond it is the other one's
                let $v = y;
                let (across, down) = $back?;
                (x.abs() <= std::f64::consts::PI).then(|| Vector3::new(sin * across, down, cos * across))
            }
        }

        impl Distort for $model {
            #[inline(always)]
            fn distort(&self, x: f64, y: f64, z: f64) -> (f64, f64) {
                let square = x * x + z * z;
                let inside = (z >= self.cos_end * (square + y * y).sqrt()) & (square + y * y > 0.0);
                let ($y, $level) = (y, square.sqrt());
                let (across, down) = (longitude(x, z), $down);
                (if inside { across } else { f64::NAN }, if inside { down } else { f64::NAN })
            }
        }

        impl std::fmt::Display for $model {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                write!(f, "{}({})", $name, shown(self.limit).trim_start_matches(", "))
            }
        }
    };
}

panorama! {
    /// A cylinder around the camera's y axis: `m = (atan2(X, Z), Y / sqrt(X^2 + Z^2))`, upright lines straight. K holds pixels
    /// per radian. What lies straight above and below has no image.
    Cylindrical, "Cylindrical", |y, level| y / level, |v| Some((1.0, v))
}

panorama! {
    /// A sphere: `m = (atan2(X, Z), atan2(Y, sqrt(X^2 + Z^2)))`, longitude to the right and latitude downwards, radians. K
    /// holds pixels per radian; of a whole sphere, `width / (2 pi)` and `height / pi`.
    Equirectangular, "Equirectangular",
    |y, level| std::f64::consts::FRAC_PI_2.copysign(y) - angle_from_axis(level, y.abs()).copysign(y),
    |v| (v.abs() <= std::f64::consts::FRAC_PI_2).then(|| (v.cos(), v.sin()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_is_told_as_it_was_given() {
        // of the smallest the cosine is 1
        for angle in [1e-9, 0.7, std::f64::consts::PI] {
            assert_eq!(Equirectangular::new(Some(angle)).unwrap().max_angle(), angle);
            assert_eq!(Cylindrical::new(Some(angle)).unwrap().max_angle(), angle);
        }
        assert_eq!(Cylindrical::new(None).unwrap().max_angle(), std::f64::consts::PI);
    }
}
