//! The pinhole model.

use nalgebra::{Matrix3, Vector3};

use crate::error::{CameraError, Error, Result};

/// Pinhole intrinsics in pixels: `u = fx X/Z + skew Y/Z + cx`, `v = fy Y/Z + cy`, with (0, 0) the centre of the
/// top-left pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pinhole {
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    skew: f64,
}

impl Pinhole {
    /// Intrinsics from their numbers.
    ///
    /// # Errors
    /// [`CameraError::Intrinsics`] where a number is not finite or a focal length not positive.
    pub fn new(fx: f64, fy: f64, cx: f64, cy: f64, skew: f64) -> Result<Self> {
        Self::from_matrix(&Matrix3::new(fx, skew, cx, 0.0, fy, cy, 0.0, 0.0, 1.0))
    }

    /// Intrinsics from `[[fx, skew, cx], [0, fy, cy], [0, 0, 1]]`.
    ///
    /// # Errors
    /// [`CameraError::Intrinsics`].
    pub fn from_matrix(k: &Matrix3<f64>) -> Result<Self> {
        let refuse = |problem| {
            let got = std::array::from_fn(|row| std::array::from_fn(|column| k[(row, column)]));
            Err(Error::Camera(CameraError::Intrinsics { got, problem }))
        };
        if k.iter().any(|value| !value.is_finite()) {
            return refuse("an entry is NaN or infinite");
        }
        if k[(1, 0)] != 0.0 || k[(2, 0)] != 0.0 || k[(2, 1)] != 0.0 || k[(2, 2)] != 1.0 {
            return refuse("the lower triangle is not 0, 0, 0 with a 1 below the principal point; is it transposed?");
        }
        if k[(0, 0)] <= 0.0 || k[(1, 1)] <= 0.0 {
            return refuse("a focal length is zero or negative; is the camera calibrated?");
        }
        Ok(Self { fx: k[(0, 0)], fy: k[(1, 1)], cx: k[(0, 2)], cy: k[(1, 2)], skew: k[(0, 1)] })
    }

    /// `[[fx, skew, cx], [0, fy, cy], [0, 0, 1]]`.
    pub fn matrix(&self) -> Matrix3<f64> {
        Matrix3::new(self.fx, self.skew, self.cx, 0.0, self.fy, self.cy, 0.0, 0.0, 1.0)
    }

    /// The pixel of a point in the camera frame; `None` behind the camera, in its plane, or where the point or its
    /// pixel is not finite.
    #[inline]
    pub fn project(&self, point: &Vector3<f64>) -> Option<[f64; 2]> {
        if !(point.z > 0.0 && point.z < f64::INFINITY) {
            return None;
        }
        self.pixel([point.x / point.z, point.y / point.z])
    }

    /// The pixel of (x, y) on the plane that the matrix takes to pixels; `None` where it is not finite.
    #[inline]
    pub(super) fn pixel(&self, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
        let pixel = [self.fx * x + self.skew * y + self.cx, self.fy * y + self.cy];
        (pixel[0].is_finite() && pixel[1].is_finite()).then_some(pixel)
    }

    /// The direction that a pixel looks along, in the camera frame with z = 1.
    #[inline]
    pub fn ray(&self, [u, v]: [f64; 2]) -> Vector3<f64> {
        let y = (v - self.cy) / self.fy;
        Vector3::new((u - self.cx - self.skew * y) / self.fx, y, 1.0)
    }

    /// The intrinsics of an image whose pixel areas are scaled by (sx, sy).
    pub(super) fn scaled(&self, sx: f64, sy: f64) -> Self {
        Self {
            fx: self.fx * sx,
            fy: self.fy * sy,
            cx: (self.cx + 0.5) * sx - 0.5,
            cy: (self.cy + 0.5) * sy - 0.5,
            skew: self.skew * sx,
        }
    }

    /// The intrinsics of an image turned over (-1) along an axis of so many pixels, and not (1) along another.
    pub(super) fn turned(&self, [(x, width), (y, height)]: [(f64, u32); 2]) -> Self {
        let over =
            |centre: f64, sign: f64, pixels: u32| if sign < 0.0 { f64::from(pixels - 1) - centre } else { centre };
        Self { cx: over(self.cx, x, width), cy: over(self.cy, y, height), skew: self.skew * x * y, ..*self }
    }

    /// The intrinsics after the image's origin moved.
    pub(super) fn shifted(&self, dx: f64, dy: f64) -> Self {
        Self { cx: self.cx + dx, cy: self.cy + dy, ..*self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ray_undoes_project_with_skew() {
        let model = Pinhole::new(800.0, 700.0, 320.5, 239.5, 3.0).unwrap();
        let point = Vector3::new(0.3, -0.7, 1.0);
        assert!((model.ray(model.project(&(point * 9.0)).unwrap()) - point).abs().max() < 1e-15);
    }

    #[test]
    fn refuses_what_is_no_pinhole_matrix() {
        let good = Matrix3::new(800.0, 0.0, 320.0, 0.0, 800.0, 240.0, 0.0, 0.0, 1.0);
        assert!(Pinhole::from_matrix(&good).is_ok());
        for (index, value) in [((0, 0), 0.0), ((1, 1), -5.0), ((0, 2), f64::NAN), ((2, 2), 2.0), ((1, 0), 0.1)] {
            let mut bad = good;
            bad[index] = value;
            assert!(
                matches!(Pinhole::from_matrix(&bad), Err(Error::Camera(CameraError::Intrinsics { .. }))),
                "{index:?} {value}"
            );
        }
        assert!(Pinhole::from_matrix(&good.transpose()).is_err());
    }
}
