//! The camera of another rendering of the same image: binned, turned, mirrored.

use super::{BrownConrady, Camera, FTheta, InverseBrownConrady, Lens, Mei, Ocam, ThinPrismFisheye};
use crate::error::{CameraError, Error, Result};
use crate::view::check_image_size;

/// Where the centre of a block of pixels lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Binning {
    /// In the middle of the block, `c' = (c + 0.5) / b - 0.5`: what averaging pixels does. The default.
    #[default]
    Area,
    /// At the first pixel, `c' = c / b`: what ROS's CameraInfo says of its `binning_x` and `binning_y`, and what taking
    /// every b-th pixel does.
    FirstPixel,
}

impl Camera {
    /// The camera of the image of which each `x` x `y` block of pixels became one; a last block that is not whole is
    /// left out.
    ///
    /// # Errors
    /// [`CameraError::Binning`] where a block has no pixels, or is larger than the image.
    pub fn binned(&self, x: u32, y: u32, rule: Binning) -> Result<Self> {
        let (width, height) = self.image_size();
        if x == 0 || y == 0 || x > width || y > height {
            return Err(Error::Camera(CameraError::Binning { x: x.into(), y: y.into(), width, height }));
        }
        let size = check_image_size("binned", (width / x).into(), (height / y).into())?;
        let (sx, sy) = (1.0 / f64::from(x), 1.0 / f64::from(y));
        let shift = |scale: f64| match rule {
            Binning::Area => 0.0,
            Binning::FirstPixel => 0.5 - 0.5 * scale,
        };
        Ok(self.with_image(self.model().scaled(sx, sy).shifted(shift(sx), shift(sy)), size))
    }

    /// The camera of the image turned by half a turn, `image[::-1, ::-1]`: a camera that hangs upside down.
    pub fn rotated180(&self) -> Self {
        let turned = self.lens().map(|lens| change(lens, -1.0, -1.0));
        self.changed([-1.0, -1.0], [1.0, 1.0, 1.0], turned)
    }

    /// The camera of the mirror image, `image[:, ::-1]`, in the mirrored world: what was at (x, y, z) is at (x, -y, z).
    ///
    /// No camera shows a mirror image of the world as it is: its x axis would point left, and its frame be left-handed.
    /// It shows one of the mirrored world, so labels that are to match a mirrored image are mirrored in y with it.
    pub fn mirrored(&self) -> Self {
        let mirrored = self.lens().map(|lens| change(lens, -1.0, 1.0));
        self.changed([-1.0, 1.0], [1.0, -1.0, 1.0], mirrored)
    }

    /// The camera whose axes x and y, whose lens and whose vehicle frame are turned over.
    fn changed(&self, image: [f64; 2], vehicle: [f64; 3], lens: Option<Lens>) -> Self {
        let (width, height) = self.image_size();
        let model = self.model().turned([(image[0], width), (image[1], height)]);
        let pose = self.camera_from_vehicle().with_axes([image[0], image[1], 1.0], vehicle);
        self.with_image(model, (width, height)).with_pose(pose).with_lens(lens)
    }
}

/// The lens whose image is that of `lens` turned over along x (-1) and y (-1).
fn change(lens: &Lens, x: f64, y: f64) -> Lens {
    const WHY: &str = "a lens turned over is one";
    // p1 shifts along y what p2 shifts along x, and prisms and tilts go the same way
    let brown = |c: &[f64]| {
        let signs = [1.0, 1.0, y, x, 1.0, 1.0, 1.0, 1.0, x, x, y, y, y, x];
        c.iter().zip(signs).map(|(c, sign)| c * sign).collect::<Vec<_>>()
    };
    match lens {
        Lens::BrownConrady(lens) => BrownConrady::new(&brown(lens.coefficients()), lens.limit()).expect(WHY).into(),
        Lens::Mei(lens) => Mei::new(lens.xi(), &brown(lens.coefficients()), lens.limit()).expect(WHY).into(),
        Lens::Ocam(lens) => {
            let [c, d, e] = lens.affine();
            Ocam::new(lens.polynomial(), [c, d * x * y, e * x * y], lens.limit()).expect(WHY).into()
        }
        Lens::FTheta(lens) => {
            let [c, d, e] = lens.linear();
            let linear = [c, d * x * y, e * x * y];
            FTheta::new(lens.polynomial(), lens.form(), linear, lens.limit()).expect(WHY).into()
        }
        Lens::InverseBrownConrady(lens) => {
            InverseBrownConrady::new(&brown(lens.coefficients()), lens.limit()).expect(WHY).into()
        }
        Lens::ThinPrismFisheye(lens) => {
            // p and s stand elsewhere there, and those of 12 coefficients the other way round
            let signs: &[f64] = match lens.coefficients().len() {
                8 => &[1.0, 1.0, y, x, 1.0, 1.0, x, y],
                _ => &[1.0, 1.0, 1.0, 1.0, 1.0, 1.0, x, y, x, x, y, y],
            };
            let turned: Vec<_> = lens.coefficients().iter().zip(signs).map(|(c, sign)| c * sign).collect();
            ThinPrismFisheye::new(&turned, lens.limit()).expect(WHY).into()
        }
        // these bend alike to all sides
        Lens::KannalaBrandt(_)
        | Lens::DoubleSphere(_)
        | Lens::Eucm(_)
        | Lens::RadialPolynomial(_)
        | Lens::Fov(_)
        | Lens::Division(_)
        | Lens::Cylindrical(_)
        | Lens::Equirectangular(_) => *lens,
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::camera::{DoubleSphere, Equirectangular, FThetaForm, KannalaBrandt, Pinhole};

    fn cameras() -> Vec<Camera> {
        let model = Pinhole::new(400.0, 410.0, 330.0, 200.0, 2.5).unwrap();
        let camera = Camera::from_euler(model, (640, 480), [1.5, 0.3, 1.4], 0.1, 0.2, -0.3).unwrap();
        let brown = [-0.1, 0.02, 0.01, -0.02, 0.001, 0.01, 0.002, 0.0, 0.003, -0.001, 0.004, 0.002, 0.03, -0.02];
        let ocam = Ocam::new(&[-300.0, 0.0, 1e-3, 1e-7], [1.01, 0.02, -0.01], None).unwrap();
        let pixels = Pinhole::new(1.0, 1.0, 330.0, 200.0, 0.0).unwrap();
        let in_pixels = Camera::from_euler(pixels, (640, 480), [1.5, 0.3, 1.4], 0.1, 0.2, -0.3).unwrap();
        vec![
            camera,
            camera.with_lens(Lens::from(BrownConrady::new(&brown, None).unwrap())),
            camera.with_lens(Lens::from(Mei::new(1.2, &[0.05, -0.01, 0.02, 0.01], None).unwrap())),
            camera.with_lens(Lens::from(KannalaBrandt::new(&[0.02, 0.0, 0.0, 0.0], None).unwrap())),
            camera.with_lens(Lens::from(DoubleSphere::new(-0.2, 0.6, None).unwrap())),
            in_pixels.with_lens(Lens::from(ocam)),
            in_pixels.with_lens(Lens::from(
                FTheta::new(&[0.0, 300.0, 3.0], FThetaForm::Forward, [1.01, 0.02, -0.01], None).unwrap(),
            )),
            camera.with_lens(Lens::from(InverseBrownConrady::new(&[0.1, 0.02, 0.01, -0.02], None).unwrap())),
            camera.with_lens(Lens::from(
                ThinPrismFisheye::new(&[0.01, -0.02, 1e-2, -2e-2, 3e-3, -1e-3, 4e-2, -5e-2], None).unwrap(),
            )),
            camera.with_lens(Lens::from(
                ThinPrismFisheye::new(&[0.01, 0., 0., 0., 0., 0., 1e-2, -2e-2, 3e-2, 1e-2, -1e-2, 2e-2], None).unwrap(),
            )),
            camera.with_lens(Lens::from(Equirectangular::new(None).unwrap())),
        ]
    }

    fn points() -> impl Iterator<Item = Vector3<f64>> {
        (0..200).map(|k| {
            let (k, angle) = (f64::from(k), f64::from(k) * 0.7);
            Vector3::new(5.0 + k * 0.1, 4.0 * angle.sin(), 1.0 + 2.0 * angle.cos())
        })
    }

    /// Every point falls where `expected` says from where the camera itself puts it.
    fn check(camera: &Camera, view: &Camera, mirror: f64, expected: impl Fn([f64; 2]) -> [f64; 2]) {
        let mut seen = 0;
        for point in points() {
            let before = camera.project(&point);
            let after = view.project(&Vector3::new(point.x, mirror * point.y, point.z));
            assert_eq!(before.pixel[0].is_nan(), after.pixel[0].is_nan());
            if before.pixel[0].is_nan() {
                continue;
            }
            let expected = expected(before.pixel);
            assert!((after.pixel[0] - expected[0]).abs() < 1e-9 && (after.pixel[1] - expected[1]).abs() < 1e-9);
            assert_eq!(before.depth, after.depth);
            seen += usize::from(before.valid);
        }
        assert!(seen > 30, "{seen}");
    }

    #[test]
    fn half_a_turn_and_a_mirror_turn_every_pixel_over() {
        for camera in cameras() {
            let (turned, mirrored) = (camera.rotated180(), camera.mirrored());
            check(&camera, &turned, 1.0, |[u, v]| [639.0 - u, 479.0 - v]);
            check(&camera, &mirrored, -1.0, |[u, v]| [639.0 - u, v]);
            check(&camera, &mirrored.rotated180(), -1.0, |[u, v]| [u, 479.0 - v]);
            assert_eq!(turned.rotated180(), camera);
            assert_eq!(mirrored.mirrored(), camera);
            assert_eq!(turned.position(), camera.position());
        }
    }

    #[test]
    fn blocks_of_pixels_keep_their_middle_or_their_first() {
        for camera in cameras() {
            let binned = camera.binned(3, 2, Binning::Area).unwrap();
            assert_eq!(binned.image_size(), (213, 240));
            check(&camera, &binned, 1.0, |[u, v]| [(u + 0.5) / 3.0 - 0.5, (v + 0.5) / 2.0 - 0.5]);
            let first = camera.binned(3, 2, Binning::FirstPixel).unwrap();
            check(&camera, &first, 1.0, |[u, v]| [u / 3.0, v / 2.0]);
        }
        let camera = cameras()[0];
        assert_eq!(camera.binned(1, 1, Binning::Area).unwrap(), camera);
        for (x, y) in [(0, 1), (1, 0), (641, 1), (1, 481)] {
            assert!(matches!(camera.binned(x, y, Binning::Area), Err(Error::Camera(CameraError::Binning { .. }))));
        }
    }
}
