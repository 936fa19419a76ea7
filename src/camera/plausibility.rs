//! What no camera is, and what hardly any is.

use super::{Camera, Lens};
use crate::error::{CameraError, Error, Result};
use crate::finding::Finding;

/// Smallest focal length that is not odd, in widths of the image: a fisheye of 360 degrees across it has 0.16.
const SHORTEST: f64 = 0.05;
/// Columns or rows from which on an image is a picture, and not numbers to try something with.
const SMALLEST_PICTURE: u32 = 17;
/// Ratio of fx to fy, from anamorphic lenses of 1.5 and pixels of half a frame.
const RATIOS: std::ops::RangeInclusive<f64> = 0.6..=1.7;
/// Where the principal point lies, in widths and heights: lenses are shifted, pictures cropped.
const CENTRAL: std::ops::RangeInclusive<f64> = 0.2..=0.8;

impl Camera {
    /// What is odd about the intrinsics, which is usually a mistake; nothing for most cameras. What they derive from such
    /// a camera may rightly be odd: a crop moves the principal point out of the image.
    ///
    /// # Errors
    /// [`CameraError::FocalLength`] where the focal lengths are those of a placeholder or of a normalised matrix.
    pub fn plausibility(&self) -> Result<Vec<Finding>> {
        let k = self.intrinsics();
        let (width, height) = self.image_size();
        let unit = self.lens().map_or(1.0, Lens::unit);
        let (fx, fy) = (k[(0, 0)] * unit, k[(1, 1)] * unit);
        if width.max(height) > 64 && fx.max(fy) <= 1.5 {
            return Err(Error::Camera(CameraError::FocalLength { fx, fy, width, height }));
        }
        let mut findings = Vec::new();
        if width.max(height) < SMALLEST_PICTURE {
            return Ok(findings);
        }
        let shortest = fx.min(fy);
        if shortest < SHORTEST * f64::from(width) {
            findings.push(Finding::ShortFocalLength { focal_length: shortest, width });
        }
        if !RATIOS.contains(&(fx / fy)) {
            findings.push(Finding::FocalLengthsDiffer { fx, fy });
        }
        let principal_point = [k[(0, 2)], k[(1, 2)]];
        let [x, y] = [(principal_point[0], width), (principal_point[1], height)]
            .map(|(centre, size)| (centre + 0.5) / f64::from(size));
        if !CENTRAL.contains(&x) || !CENTRAL.contains(&y) {
            let image_size = self.image_size();
            findings.push(if principal_point.iter().all(|centre| centre.abs() <= 1.0) {
                Finding::PrincipalPointAsFraction { principal_point, image_size }
            } else {
                Finding::PrincipalPointOffCentre { principal_point, image_size }
            });
        }
        Ok(findings)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{KannalaBrandt, Ocam, Pinhole, RadialPolynomial};

    fn camera(k: [f64; 4], size: (u32, u32), lens: Option<Lens>) -> Camera {
        let model = Pinhole::new(k[0], k[1], k[2], k[3], 0.0).unwrap();
        Camera::new(model, size, Camera::forward_pose()).unwrap().with_lens(lens)
    }

    fn kinds(k: [f64; 4], size: (u32, u32)) -> Vec<std::mem::Discriminant<Finding>> {
        camera(k, size, None).plausibility().unwrap().iter().map(std::mem::discriminant).collect()
    }

    #[test]
    fn everyday_cameras_have_nothing_odd() {
        let fisheye = Lens::from(KannalaBrandt::new(&[0.02, -0.01, 0.0, 0.0], None).unwrap());
        let woodscape = Lens::from(RadialPolynomial::new(&[339.7, -31.99, 48.28, -7.2], None).unwrap());
        let ocam = Lens::from(Ocam::new(&[-243.0, 0.0, 1.7e-3, -1e-6, 4e-9], [1.0, 0.0, 0.0], None).unwrap());
        for (k, size, lens) in [
            ([1120.0, 1118.0, 958.0, 541.0], (1920, 1080), None),
            ([230.0, 230.0, 719.5, 719.5], (1440, 1440), Some(fisheye)), // 0.16 of the width
            ([1350.0, 900.0, 640.0, 360.0], (1280, 720), None),          // anamorphic
            ([721.5, 721.5, 609.6, 172.9], (1242, 375), None),
            ([90_000.0, 90_000.0, 960.0, 540.0], (1920, 1080), None), // a telescope
            ([1.0, 1.0, 643.3, 480.7], (1280, 966), Some(woodscape)),
            ([1.0, 1.0, 633.0, 407.0], (1280, 800), Some(ocam)),
            ([1.0, 1.0, 0.0, 0.0], (4, 3), None),
        ] {
            assert_eq!(camera(k, size, lens).plausibility().unwrap(), [], "{k:?}");
        }
    }

    #[test]
    fn what_is_odd_is_named() {
        let of = |finding: Finding| vec![std::mem::discriminant(&finding)];
        let (principal_point, image_size) = ([0.0; 2], (0, 0));
        let off = of(Finding::PrincipalPointOffCentre { principal_point, image_size });
        let fraction = of(Finding::PrincipalPointAsFraction { principal_point, image_size });
        let short = of(Finding::ShortFocalLength { focal_length: 0.0, width: 0 });
        let differ = of(Finding::FocalLengthsDiffer { fx: 0.0, fy: 0.0 });
        let size = (1280, 720);
        assert_eq!(kinds([8.0, 8.0, 640.0, 360.0], size), short);
        assert_eq!(kinds([900.0, 500.0, 640.0, 360.0], size), differ);
        assert_eq!(kinds([500.0, 900.0, 640.0, 360.0], size), differ);
        assert_eq!(kinds([900.0, 900.0, 0.51, 0.48], size), fraction);
        assert_eq!(kinds([900.0, 900.0, 0.0, 0.0], size), fraction);
        assert_eq!(kinds([900.0, 900.0, 1100.0, 360.0], size), off);
        assert_eq!(kinds([900.0, 900.0, 640.0, 90.0], size), off);
        assert_eq!(kinds([900.0, 900.0, -640.0, 360.0], size), off);
        assert_eq!(kinds([900.0, 900.0, 360.0, 640.0], size), off, "(cx, cy) for (height, width)");
    }

    #[test]
    fn placeholders_and_normalised_matrices_are_refused() {
        for k in [[1.0, 1.0, 0.0, 0.0], [0.9, 1.4, 0.5, 0.5]] {
            let refused = camera(k, (1280, 720), None).plausibility();
            assert!(matches!(refused, Err(Error::Camera(CameraError::FocalLength { .. }))), "{k:?}");
        }
        // a lens in pixels whose coefficients are normalised
        let lens = RadialPolynomial::new(&[1.05, -0.02, 0.01, 0.0], None).unwrap();
        let refused = camera([1.0, 1.0, 640.0, 360.0], (1280, 720), Some(lens.into())).plausibility();
        assert!(matches!(refused, Err(Error::Camera(CameraError::FocalLength { .. }))));
    }
}
