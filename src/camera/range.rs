//! How far pixels see, and how far off that may be.

use nalgebra::{Rotation3, Unit, Vector3};

use super::Camera;
use crate::geometry::{OPTICAL_FROM_FLU, euler_from_rotation};
use crate::ground::Ground;

/// By how many metres a range is off.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RangeError {
    /// For a pixel that is off.
    pub pixel: f64,
    /// For a camera whose pitch is off.
    pub pitch: f64,
}

impl Camera {
    /// The range of a pixel: metres from the camera to the road point it sees, measured level (in x and y). NaN where it
    /// sees no road.
    pub fn ground_range(&self, pixel: [f64; 2], ground: &Ground) -> f64 {
        self.ground_from_pixel(pixel, ground).map_or(f64::NAN, |point| self.range_to(&point))
    }

    /// How far off the range of a pixel is where the pixel is off by `pixels` in the direction that tells most, and where the camera's pitch is off by `pitch` radians: the larger of both directions, infinite where one of them
    /// sees no road any more. NaN where the pixel itself sees none.
    ///
    /// Found by looking there, not by a derivative: near the horizon ranges grow without bound within a pixel.
    pub fn range_error(&self, pixel: [f64; 2], ground: &Ground, pixels: f64, pitch: f64) -> RangeError {
        let Some(point) = self.ground_from_pixel(pixel, ground) else {
            return RangeError { pixel: f64::NAN, pitch: f64::NAN };
        };
        let range = self.range_to(&point);
        let off =
            |other: Option<Vector3<f64>>| other.map_or(f64::INFINITY, |other| (self.range_to(&other) - range).abs());
        let outwards = self.outwards(pixel, &point);
        let shifted = |sign: f64| [0, 1].map(|axis| pixel[axis] + sign * pixels * outwards[axis]);
        let by_pixel = [1.0, -1.0].map(|sign| off(self.ground_from_pixel(shifted(sign), ground)));

        let eye = self.position();
        let ray = point - eye;
        let axis = self.pitch_axis();
        let turned = |sign: f64| Rotation3::from_axis_angle(&axis, sign * pitch) * ray;
        let by_pitch = [1.0, -1.0].map(|sign| off(ground.intersect(&eye, &turned(sign))));
        RangeError { pixel: by_pixel[0].max(by_pixel[1]), pitch: by_pitch[0].max(by_pitch[1]) }
    }

    /// Metres from the camera to a point, level.
    fn range_to(&self, point: &Vector3<f64>) -> f64 {
        let eye = self.position();
        (point.x - eye.x).hypot(point.y - eye.y)
    }

    /// The direction in the image in which the range of a road point grows fastest: at right angles to the image of the
    /// circle of equal range around the camera.
    fn outwards(&self, pixel: [f64; 2], point: &Vector3<f64>) -> [f64; 2] {
        /// Of the range: small enough to be straight, large enough to be more than rounding.
        const STEP: f64 = 1e-4;
        let eye = self.position();
        let away = Vector3::new(point.x - eye.x, point.y - eye.y, 0.0) * STEP;
        let around = Vector3::new(-away.y, away.x, 0.0);
        let moved = |by: Vector3<f64>| {
            let moved = self.project(&(point + by)).pixel;
            [moved[0] - pixel[0], moved[1] - pixel[1]]
        };
        let (radial, tangential) = (moved(away), moved(around));
        let length = tangential[0].hypot(tangential[1]);
        let across = [tangential[1] / length, -tangential[0] / length];
        let sign = (across[0] * radial[0] + across[1] * radial[1]).signum();
        // straight below the camera every direction is away
        if length > 0.0 && !sign.is_nan() { across.map(|value| sign * value) } else { [0.0, -1.0] }
    }

    /// The axis about which pitch turns the camera: level, to the left of where it heads.
    fn pitch_axis(&self) -> Unit<Vector3<f64>> {
        let (_, _, yaw) = euler_from_rotation(&(self.vehicle_from_camera().rotation() * OPTICAL_FROM_FLU));
        Unit::new_normalize(Vector3::new(-yaw.sin(), yaw.cos(), 0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{KannalaBrandt, Lens, Pinhole};

    const HEIGHT: f64 = 1.4;
    const FOCAL: f64 = 1000.0;

    fn camera(pitch: f64, yaw: f64) -> Camera {
        let model = Pinhole::new(FOCAL, FOCAL, 640.0, 360.0, 0.0).unwrap();
        Camera::from_euler(model, (1280, 720), [1.5, 0.3, HEIGHT], 0.0, pitch, yaw).unwrap()
    }

    #[test]
    fn level_camera_in_closed_form() {
        let (camera, ground) = (camera(0.0, 0.0), Ground::default());
        for row in [365.0_f64, 380.0, 500.0, 700.0] {
            // h f / (v - c), and the same one row on
            let range = |row: f64| HEIGHT * FOCAL / (row - 360.0);
            assert!((camera.ground_range([640.0, row], &ground) - range(row)).abs() < 1e-9);
            let error = camera.range_error([640.0, row], &ground, 1.0, 0.1_f64.to_radians());
            assert!((error.pixel - (range(row - 1.0) - range(row))).abs() < 1e-6, "{row} {error:?}");
            let angle = (HEIGHT / range(row)).atan() - 0.1_f64.to_radians();
            assert!((error.pitch - (HEIGHT / angle.tan() - range(row))).abs() < 1e-6, "{row} {error:?}");
        }
        let near_horizon = camera.range_error([640.0, 360.5], &ground, 1.0, 0.1_f64.to_radians());
        assert_eq!((near_horizon.pixel, near_horizon.pitch), (f64::INFINITY, f64::INFINITY));
        assert!(camera.ground_range([640.0, 300.0], &ground).is_nan());
        assert!(camera.range_error([640.0, 300.0], &ground, 1.0, 0.01).pixel.is_nan());
    }

    #[test]
    fn small_errors_are_those_of_a_camera_turned_and_of_the_neighbouring_pixel() {
        let ground = Ground::default();
        let fisheye: Lens = KannalaBrandt::new(&[0.02, -0.01, 0.0, 0.0], None).unwrap().into();
        for (pitch, yaw) in [(0.1, 0.0), (0.3, 1.3), (0.25, -2.0)] {
            for lens in [None, Some(fisheye)] {
                let camera = camera(pitch, yaw).with_lens(lens);
                for pixel in [[640.0, 600.0], [200.0, 500.0], [1100.0, 650.0]] {
                    let range = camera.ground_range(pixel, &ground);
                    let tiny = 1e-5;
                    let error = camera.range_error(pixel, &ground, tiny, tiny);
                    // the steepest change of the range over the image
                    let slope = |du: f64, dv: f64| {
                        (camera.ground_range([pixel[0] + du, pixel[1] + dv], &ground)
                            - camera.ground_range([pixel[0] - du, pixel[1] - dv], &ground))
                            / 2.0
                    };
                    let steepest = slope(tiny, 0.0).hypot(slope(0.0, tiny));
                    assert!((error.pixel - steepest).abs() < 2e-3 * steepest, "{error:?} {steepest}");
                    let turned = self::camera(pitch + tiny, yaw).with_lens(lens);
                    let moved = (turned.ground_range(pixel, &ground) - range).abs();
                    assert!((error.pitch - moved).abs() < 1e-3 * moved, "{error:?} {moved}");
                }
            }
        }
    }
}
