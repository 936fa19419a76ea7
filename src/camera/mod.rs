//! A calibrated camera: intrinsics, lens model, image size and pose.

pub(crate) mod error;
mod horizon;
pub(crate) mod lens;
mod on_ground;
mod pinhole;
mod plausibility;
mod polyline;
mod range;
mod trace;
mod vanishing;
mod views;

pub use lens::{
    BrownConrady, Cylindrical, Division, DoubleSphere, Equirectangular, Eucm, FTheta, FThetaForm, Fov,
    InverseBrownConrady, KannalaBrandt, Lens, Mei, Ocam, RadialPolynomial, ThinPrismFisheye,
};
pub use pinhole::Pinhole;
pub use range::RangeError;
pub use views::Binning;

use nalgebra::{Matrix3, Vector3};

use crate::error::{CameraError, Error, Result, finite, radians};
use crate::geometry::{OPTICAL_FROM_FLU, Pose, euler_from_rotation, rotation_from_euler};
use crate::view::check_image_size;

/// Where a point falls on the image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Projection {
    /// (u, v) in pixels, (0, 0) the centre of the top-left pixel; NaN where the point has no image.
    pub pixel: [f64; 2],
    /// z in the camera frame, metres; negative behind the camera, which a lens of more than 180 degrees still sees.
    pub depth: f64,
    /// In front of the camera, in the lens's domain and inside the rectangle of pixel centres, `[0, width - 1] x [0, height - 1]`.
    pub valid: bool,
}

/// A calibrated camera. Immutable; vehicle frame ISO 8855 (x forward, y left, z up), camera frame optical (x right,
/// y down, z forward), metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    model: Pinhole,
    lens: Option<Lens>,
    image_size: (u32, u32),
    camera_from_vehicle: Pose,
    vehicle_from_camera: Pose,
}

impl Camera {
    /// A pinhole camera from its parts; `image_size` is (width, height). [`Camera::with_lens`] gives it a lens.
    ///
    /// # Errors
    /// [`ViewError::ImageSize`](crate::error::ViewError::ImageSize) where the image has no pixels or too many to be addressed.
    pub fn new(model: Pinhole, image_size: (u32, u32), camera_from_vehicle: Pose) -> Result<Self> {
        check_image_size("image_size", image_size.0.into(), image_size.1.into())?;
        let vehicle_from_camera = camera_from_vehicle.inverse();
        Ok(Self { model, lens: None, image_size, camera_from_vehicle, vehicle_from_camera })
    }

    /// A pinhole camera from where it stands and how it is turned: `R = (Rz(yaw) Ry(pitch) Rx(roll))^T`, `t = -R position`, then
    /// the optical axes. Angles in radians; positive pitch looks down. Source: Cityscapes csCalibration.pdf.
    ///
    /// # Errors
    /// [`Error::NotFinite`], [`Error::Angle`] beyond a turn, which is degrees, and those of [`Camera::new`].
    pub fn from_euler(
        model: Pinhole,
        image_size: (u32, u32),
        position: [f64; 3],
        roll: f64,
        pitch: f64,
        yaw: f64,
    ) -> Result<Self> {
        for (what, value) in [("roll", roll), ("pitch", pitch), ("yaw", yaw)] {
            radians(what, value)?;
        }
        for value in position {
            finite("position", value)?;
        }
        let rotation = OPTICAL_FROM_FLU * rotation_from_euler(roll, pitch, yaw).transpose();
        let pose = Pose::new(rotation, -(rotation * Vector3::from(position)))?;
        Self::new(model, image_size, pose)
    }

    /// The pose of a camera that stands at the vehicle's origin and looks along +x.
    pub fn forward_pose() -> Pose {
        Pose::new(OPTICAL_FROM_FLU, Vector3::zeros()).expect("a permutation of axes is rigid")
    }

    /// The same camera behind another lens; `None` is a pinhole.
    pub fn with_lens(&self, lens: impl Into<Option<Lens>>) -> Self {
        Self { lens: lens.into(), ..*self }
    }

    /// The intrinsics: what takes the lens's plane, or a pinhole's `(X / Z, Y / Z)`, to pixels.
    pub fn model(&self) -> &Pinhole {
        &self.model
    }

    /// The lens model beyond the pinhole.
    pub fn lens(&self) -> Option<&Lens> {
        self.lens.as_ref()
    }

    /// Whether its image is a panorama of 360 degrees, whose first column of pixels follows the last: the angle between
    /// columns is a whole turn by the number of columns, to a millionth of a turn.
    pub fn is_panorama(&self) -> bool {
        let k = self.intrinsics();
        let turn = std::f64::consts::TAU * k[(0, 0)] / f64::from(self.image_size.0);
        matches!(self.lens, Some(Lens::Cylindrical(_) | Lens::Equirectangular(_)))
            && k[(0, 1)] == 0.0
            && (turn - 1.0).abs() < 1e-6
    }

    /// (width, height) of the image in pixels.
    pub fn image_size(&self) -> (u32, u32) {
        self.image_size
    }

    /// The pose, as given.
    pub fn camera_from_vehicle(&self) -> &Pose {
        &self.camera_from_vehicle
    }

    /// The inverse of the pose.
    pub fn vehicle_from_camera(&self) -> &Pose {
        &self.vehicle_from_camera
    }

    /// The optical centre in the vehicle frame, metres.
    pub fn position(&self) -> Vector3<f64> {
        *self.vehicle_from_camera.translation()
    }

    /// Unit vector of the optical axis in the vehicle frame.
    pub fn optical_axis(&self) -> Vector3<f64> {
        (self.vehicle_from_camera.rotation() * Vector3::z()).normalize()
    }

    /// Where a point of the vehicle frame falls on the image.
    pub fn project(&self, point: &Vector3<f64>) -> Projection {
        let in_camera = self.camera_from_vehicle.transform(point);
        match self.pixel_of(&in_camera) {
            Some(pixel) => Projection { pixel, depth: in_camera.z, valid: self.sees(pixel) },
            None => Projection { pixel: [f64::NAN; 2], depth: in_camera.z, valid: false },
        }
    }

    /// The pixel of a point of the camera frame.
    pub(crate) fn pixel_of(&self, in_camera: &Vector3<f64>) -> Option<[f64; 2]> {
        match &self.lens {
            None => self.model.project(in_camera),
            Some(lens) => lens.project(in_camera).and_then(|seen| self.model.pixel(seen)),
        }
    }

    /// The unit direction, in the vehicle frame, that a pixel looks along; `None` where the lens has none, or the pixel
    /// is not finite.
    pub fn unproject(&self, pixel: [f64; 2]) -> Option<Vector3<f64>> {
        Some((self.vehicle_from_camera.rotation() * self.ray(pixel)?).normalize())
    }

    /// A direction in the camera frame that a pixel looks along.
    pub(crate) fn ray(&self, pixel: [f64; 2]) -> Option<Vector3<f64>> {
        let ray = self.model.ray(pixel);
        match &self.lens {
            None => (ray.x.is_finite() && ray.y.is_finite()).then_some(ray),
            Some(lens) => lens.unproject([ray.x, ray.y]),
        }
    }

    /// The same camera with its image resampled to another size. Pixel areas scale, so
    /// `c' = (c + 0.5) s - 0.5`, per axis, as `cv2.resize` does to the picture.
    ///
    /// # Errors
    /// [`ViewError::ImageSize`](crate::error::ViewError::ImageSize).
    pub fn resized(&self, width: u32, height: u32) -> Result<Self> {
        check_image_size("resized", width.into(), height.into())?;
        let scale = |new: u32, old: u32| f64::from(new) / f64::from(old);
        let model = self.model.scaled(scale(width, self.image_size.0), scale(height, self.image_size.1));
        Ok(Self { model, image_size: (width, height), ..*self })
    }

    /// The camera of the `width` x `height` crop whose top-left pixel is (x, y): only the principal point moves.
    ///
    /// # Errors
    /// [`CameraError::Crop`] where the rectangle is empty or leaves the image.
    pub fn cropped(&self, x: u32, y: u32, width: u32, height: u32) -> Result<Self> {
        let (image_width, image_height) = self.image_size;
        let fits =
            |start: u32, length: u32, size: u32| length > 0 && u64::from(start) + u64::from(length) <= u64::from(size);
        if !fits(x, width, image_width) || !fits(y, height, image_height) {
            return Err(Error::Camera(CameraError::Crop {
                x: x.into(),
                y: y.into(),
                crop_width: width.into(),
                crop_height: height.into(),
                width: image_width,
                height: image_height,
            }));
        }
        let model = self.model.shifted(-f64::from(x), -f64::from(y));
        Ok(Self { model, image_size: (width, height), ..*self })
    }

    /// The same camera with other intrinsics and another image size.
    fn with_image(&self, model: Pinhole, image_size: (u32, u32)) -> Self {
        Self { model, image_size, ..*self }
    }

    /// The same camera elsewhere.
    pub fn with_pose(&self, camera_from_vehicle: Pose) -> Self {
        Self { camera_from_vehicle, vehicle_from_camera: camera_from_vehicle.inverse(), ..*self }
    }

    /// The 3x3 intrinsic matrix.
    pub fn intrinsics(&self) -> Matrix3<f64> {
        self.model.matrix()
    }

    fn sees(&self, [u, v]: [f64; 2]) -> bool {
        let (width, height) = self.image_size;
        u >= 0.0 && v >= 0.0 && u <= f64::from(width - 1) && v <= f64::from(height - 1)
    }
}

/// Where it stands and looks, in metres and degrees.
impl std::fmt::Display for Camera {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (width, height) = self.image_size;
        let k = self.intrinsics();
        let position = self.position();
        let (roll, pitch, yaw) = euler_from_rotation(&(self.vehicle_from_camera.rotation() * OPTICAL_FROM_FLU));
        let turned = |angle: f64, positive, negative| {
            let degrees = angle.to_degrees();
            // what prints as 0.00 has no side
            format!("{:.2} deg {}", degrees.abs(), if degrees < -0.005 { negative } else { positive })
        };
        let metres = |value: f64| (value * 1e3).round() / 1e3 + 0.0; // never -0.000
        write!(
            f,
            "Camera({width}x{height}, fx {:.2}, fy {:.2}, cx {:.2}, cy {:.2}, at x {:.3}, y {:.3}, z {:.3} m, looks {}, {}, {}",
            k[(0, 0)],
            k[(1, 1)],
            k[(0, 2)],
            k[(1, 2)],
            metres(position.x),
            metres(position.y),
            metres(position.z),
            turned(pitch, "down", "up"),
            turned(yaw, "to the left", "to the right"),
            turned(roll, "left side up", "right side up"),
        )?;
        self.lens.as_ref().map_or(Ok(()), |lens| write!(f, ", {lens}"))?;
        write!(f, ")")
    }
}

/// Refuses a margin or a tolerance that no curve can be drawn with.
fn check_tracing(margin: f64, tolerance: f64) -> Result<()> {
    /// Pixels; finer than any picture, and coarser than rounding.
    const FINEST: f64 = 1e-3;
    /// Farther out pixels lose the digits of the image's own.
    const WIDEST: f64 = 1e9;
    if (0.0..=WIDEST).contains(&margin) && (FINEST..=WIDEST).contains(&tolerance) {
        return Ok(());
    }
    Err(Error::Camera(CameraError::Tracing { margin, tolerance }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::ViewError;
    use crate::ground::Ground;

    fn seed() -> Camera {
        let model =
            Pinhole::new(2263.54773399985, 2250.3728170599807, 1079.0175620000632, 515.006600600019, 0.0).unwrap();
        let position = [1.7, 0.026239999999999368, 1.212400000000026];
        Camera::from_euler(model, (2048, 1024), position, 0.0, 0.03842560000000292, -0.009726800000000934).unwrap()
    }

    #[test]
    fn projects_the_cityscapes_seed_points() {
        // golden: cityscapes_seed, verified with cv2.projectPoints and the dataset's own code
        for (point, pixel, depth, valid) in [
            ([10.0, 0.0, 0.0], [1064.2284062502101, 755.8620516829769], 8.340311599301199, true),
            ([10.0, 3.0, 0.0], [247.16330874797774, 757.0105787363667], 8.311153199258536, true),
            ([50.0, -10.0, 0.0], [1525.870259408624, 484.8975460926834], 48.40608856369829, true),
            ([7.0, 10.0, 0.0], [-3246.941493537947, 949.0108977698844], 5.245473260173206, false),
        ] {
            let got = seed().project(&Vector3::from(point));
            assert!((got.pixel[0] - pixel[0]).abs() < 1e-9 && (got.pixel[1] - pixel[1]).abs() < 1e-9, "{got:?}");
            assert!((got.depth - depth).abs() < 1e-12);
            assert_eq!(got.valid, valid);
        }
    }

    #[test]
    fn a_point_behind_or_at_the_camera_has_no_image() {
        for x in [1.6, -50.0, f64::NAN] {
            let got = seed().project(&Vector3::new(x, 0.0, 0.0));
            assert!(got.pixel[0].is_nan() && got.pixel[1].is_nan() && !got.valid);
        }
        let centre = seed().position();
        assert!(!seed().project(&centre).valid);
    }

    #[test]
    fn pixel_to_ground_and_back() {
        let (camera, ground) = (seed(), Ground::height(-0.33).unwrap());
        for pixel in [[0.0, 600.0], [1024.0, 1023.0], [2047.0, 450.0]] {
            let point = camera.ground_from_pixel(pixel, &ground).unwrap();
            assert_eq!(point.z, -0.33);
            let back = camera.project(&point).pixel;
            assert!((back[0] - pixel[0]).abs() < 1e-8 && (back[1] - pixel[1]).abs() < 1e-8);
        }
        assert_eq!(camera.ground_from_pixel([1024.0, 200.0], &ground), None, "above the horizon");
    }

    #[test]
    fn says_where_it_stands_and_looks() {
        let text = seed().to_string();
        assert!(text.contains("at x 1.700, y 0.026, z 1.212 m"), "{text}");
        assert!(text.contains("looks 2.20 deg down, 0.56 deg to the right"), "{text}");
    }

    #[test]
    fn crops_and_resizes_follow_the_pixels() {
        let camera = seed();
        let point = Vector3::new(15.0, 1.0, 0.3);
        let [u, v] = camera.project(&point).pixel;
        let cropped = camera.cropped(100, 50, 1500, 900).unwrap();
        let [cu, cv] = cropped.project(&point).pixel;
        assert!((cu - (u - 100.0)).abs() < 1e-9 && (cv - (v - 50.0)).abs() < 1e-9);
        let half = camera.resized(1024, 256).unwrap();
        let [hu, hv] = half.project(&point).pixel;
        assert!((hu - ((u + 0.5) * 0.5 - 0.5)).abs() < 1e-9 && (hv - ((v + 0.5) * 0.25 - 0.5)).abs() < 1e-9);
        for (x, y, w, h) in [(0, 0, 0, 5), (2000, 0, 49, 5), (0, 1024, 1, 1), (u32::MAX, 0, u32::MAX, 1)] {
            assert!(matches!(camera.cropped(x, y, w, h), Err(Error::Camera(CameraError::Crop { .. }))));
        }
        assert!(matches!(camera.resized(0, 5), Err(Error::View(ViewError::ImageSize { .. }))));
        assert!(matches!(camera.resized(1 << 16, 1 << 16), Err(Error::View(ViewError::ImageSize { .. }))));
    }
}
