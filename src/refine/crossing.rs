//! Where a picture of a drive shows the road that an earlier one shows.

use nalgebra::{Matrix3, RowVector3, Vector3};

use crate::camera::{Camera, Pinhole};
use crate::error::{Error, PointsError, Result, ViewError};
use crate::geometry::{OPTICAL_FROM_FLU, Pose, rotation_from_euler};
use crate::ground::Plane;
use crate::view::ImageView;

/// How many derivatives a place has: by roll, pitch, yaw and height of both pictures together, then by pitch and height of
/// the first and of the second alone.
pub const SLOPES: usize = 8;

/// Of a point's distance, how far beside it a lens is looked at for its slope: the error of a central difference is the
/// square of this, 1e-10 of the slope, and that of rounding 1e-11.
const BESIDE: f64 = 1e-5;

/// Whose motion lies between two pictures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Moves {
    /// The vehicle's: how the camera is mounted on it decides where it goes.
    Vehicle,
    /// The camera's own: only the road's plane below it is open.
    Camera,
}

/// Where the camera was on its vehicle as a picture was taken.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mounting {
    /// Roll, pitch and yaw, radians, as [`Camera::from_euler`] takes them.
    pub angles: [f64; 3],
    /// Of the optical centre in the vehicle frame, metres.
    pub position: [f64; 3],
}

impl Mounting {
    /// vehicle_from_camera.
    fn rotation(&self) -> Matrix3<f64> {
        let [roll, pitch, yaw] = self.angles;
        rotation_from_euler(roll, pitch, yaw) * OPTICAL_FROM_FLU.transpose()
    }

    /// The axes in the vehicle frame about which roll, pitch and yaw turn the camera, as columns.
    fn axes(&self) -> Matrix3<f64> {
        let ((sp, cp), (sy, cy)) = (self.angles[1].sin_cos(), self.angles[2].sin_cos());
        Matrix3::new(cy * cp, -sy, 0.0, sy * cp, cy, 0.0, -sp, 0.0, 1.0)
    }
}

/// Two pictures of a drive, of which the second is looked at where it shows what the first shows of the road.
#[derive(Debug, Clone, Copy)]
pub struct Crossing<'a> {
    /// Whose pictures they are; its pose is not looked at.
    pub camera: Camera,
    /// The second picture, halved `level` times: pixel areas are averaged, as a resize by half has it.
    pub picture: ImageView<'a, f32>,
    /// How often it was halved.
    pub level: u32,
    /// For each pixel of the whole picture, row-major, whether it shows the road; all do without.
    pub mask: Option<&'a [bool]>,
    /// second_from_first, of what moves.
    pub motion: Pose,
    /// What moves so.
    pub moves: Moves,
    /// The road in the vehicle frame.
    pub road: Plane,
}

/// What a picture shows of some places.
#[derive(Debug, Clone, PartialEq)]
pub struct Shown {
    /// Brightness; NaN where the picture does not show the place.
    pub values: Vec<f64>,
    /// Its derivatives, if asked for.
    pub slopes: Vec<[f64; SLOPES]>,
}

impl Crossing<'_> {
    /// What the second picture shows where the first looks along some rays of its optical frame.
    ///
    /// # Errors
    /// [`ViewError::MaskSize`] for a mask that is not of the camera's size, [`PointsError::Unfit`] for a picture of several
    /// channels.
    pub fn shown(&self, rays: &[[f64; 3]], mountings: [Mounting; 2], with_slopes: bool) -> Result<Shown> {
        let expected = (self.camera.image_size().0 as usize, self.camera.image_size().1 as usize);
        if let Some(mask) = self.mask
            && mask.len() != expected.0 * expected.1
        {
            return Err(Error::View(ViewError::MaskSize { expected, got: mask.len() }));
        }
        if self.picture.channels() != 1 {
            let got = format!("{} channels", self.picture.channels());
            return Err(Error::Points(PointsError::Unfit { what: "picture", expected: "one channel", got }));
        }
        let (between, scale) = (Between::new(self, mountings), 0.5_f64.powi(self.level.min(64) as i32));
        let mut shown = Shown { values: Vec::with_capacity(rays.len()), slopes: Vec::new() };
        if !with_slopes {
            for ray in rays {
                let at = between.meets(ray);
                shown.values.push(self.pixel(&at.seen).map_or(f64::NAN, |pixel| self.brightness(pixel, scale)));
            }
            return Ok(shown);
        }
        shown.slopes.reserve(rays.len());
        for ray in rays {
            let at = between.meets(ray);
            let found = self.pixel(&at.seen).map(|pixel| self.brightness_with_slope(pixel, scale));
            let (value, steep) = found.unwrap_or((f64::NAN, [f64::NAN; 2]));
            let by_pixel = self.by_pixel(&at.seen);
            shown.values.push(value);
            shown.slopes.push(between.slopes(
                ray,
                &at,
                &(RowVector3::from(by_pixel[0]) * steep[0] + RowVector3::from(by_pixel[1]) * steep[1]),
            ));
        }
        Ok(shown)
    }

    /// The pixel of the whole picture that shows a point of the optical frame, if the mask does not hide it.
    #[inline]
    fn pixel(&self, seen: &Vector3<f64>) -> Option<[f64; 2]> {
        let [u, v] = self.camera.pixel_of(seen)?;
        let (width, height) = self.camera.image_size();
        let is_shown = self.mask.is_none_or(|mask| {
            let [x, y] =
                [(u, width), (v, height)].map(|(at, size)| at.round_ties_even().clamp(0.0, f64::from(size - 1)));
            mask[y as usize * width as usize + x as usize]
        });
        is_shown.then_some([u, v])
    }

    /// The derivatives of the pixel's two coordinates by the point.
    #[inline]
    fn by_pixel(&self, seen: &Vector3<f64>) -> [[f64; 3]; 2] {
        if self.camera.lens().is_none() {
            return by_point(self.camera.model(), seen);
        }
        let step = BESIDE * seen.norm();
        let mut slopes = [[0.0; 3]; 2];
        for axis in 0..3 {
            let mut offset = Vector3::zeros();
            offset[axis] = step;
            let ends = [seen + offset, seen - offset].map(|end| self.camera.pixel_of(&end).unwrap_or([f64::NAN; 2]));
            for (slope, (plus, minus)) in slopes.iter_mut().zip(ends[0].into_iter().zip(ends[1])) {
                slope[axis] = (plus - minus) / (2.0 * step);
            }
        }
        slopes
    }

    /// The brightness at a pixel of the whole picture, of which the halved one is a `scale`; NaN outside.
    #[inline]
    fn brightness(&self, [u, v]: [f64; 2], scale: f64) -> f64 {
        let (x, y) = (u * scale + (0.5 * scale - 0.5), v * scale + (0.5 * scale - 0.5));
        let (width, height) = (self.picture.width() as f64, self.picture.height() as f64);
        let inside = x >= 0.0 && y >= 0.0 && x <= width - 1.0 && y <= height - 1.0;
        if inside { sampled(&self.picture, x, y) } else { f64::NAN }
    }

    /// The brightness at a pixel of the whole picture, and how it changes along x and y, over a pixel of the halved one.
    #[inline]
    fn brightness_with_slope(&self, [u, v]: [f64; 2], scale: f64) -> (f64, [f64; 2]) {
        let (x, y) = (u * scale + (0.5 * scale - 0.5), v * scale + (0.5 * scale - 0.5));
        let (width, height) = (self.picture.width() as f64, self.picture.height() as f64);
        if !(x >= 0.5 && y >= 0.5 && x <= width - 1.5 && y <= height - 1.5) {
            return (f64::NAN, [f64::NAN; 2]);
        }
        let at = |x, y| sampled(&self.picture, x, y);
        let along = scale * (at(x + 0.5, y) - at(x - 0.5, y));
        (at(x, y), [along, scale * (at(x, y + 0.5) - at(x, y - 0.5))])
    }
}

/// A picture between its pixels, for places inside it.
#[inline]
fn sampled(picture: &ImageView<'_, f32>, x: f64, y: f64) -> f64 {
    let (left, top) = (x as usize, y as usize);
    let (right, below) = ((left + 1).min(picture.width() - 1), (top + 1).min(picture.height() - 1));
    let (a, b) = (x - left as f64, y - top as f64);
    let (upper, lower) = (picture.row_start(top), picture.row_start(below));
    let data = picture.data();
    let at = |index: usize| f64::from(data[index]);
    let (p, q, r, s) = (at(upper + left), at(upper + right), at(lower + left), at(lower + right));
    let (above, under) = (p + a * (q - p), r + a * (s - r));
    above + b * (under - above)
}

/// The derivatives of a pinhole's pixel by the point.
#[inline]
fn by_point(model: &Pinhole, seen: &Vector3<f64>) -> [[f64; 3]; 2] {
    let k = model.matrix();
    let inverse = seen.z.recip();
    let (x, y) = (seen.x * inverse, seen.y * inverse);
    [
        [k[(0, 0)] * inverse, k[(0, 1)] * inverse, -(k[(0, 0)] * x + k[(0, 1)] * y) * inverse],
        [0.0, k[(1, 1)] * inverse, -k[(1, 1)] * y * inverse],
    ]
}

/// The road between two pictures, with the camera where it was at either.
struct Between {
    moves: Moves,
    /// vehicle_from_camera at the first and at the second picture.
    rotations: [Matrix3<f64>; 2],
    positions: [Vector3<f64>; 2],
    axes: [Matrix3<f64>; 2],
    turn: Matrix3<f64>,
    shift: Vector3<f64>,
    normal: Vector3<f64>,
    /// How far the road is below the camera, along its normal, with the sign of `normal . ray`.
    below: f64,
}

/// Where a ray meets the road.
struct Meeting {
    /// The ray in the vehicle frame.
    direction: Vector3<f64>,
    /// `normal . direction`.
    slant: f64,
    /// How many of them it is to the road; NaN where the ray misses it.
    distance: f64,
    /// From the second camera to the place, in the vehicle frame at the second picture, where the vehicle moves.
    away: Vector3<f64>,
    /// The place in the second camera's optical frame.
    seen: Vector3<f64>,
}

impl Between {
    fn new(crossing: &Crossing<'_>, mountings: [Mounting; 2]) -> Self {
        let normal = crossing.road.normal();
        let positions = mountings.map(|mounting| Vector3::from(mounting.position));
        Self {
            moves: crossing.moves,
            rotations: mountings.map(|mounting| mounting.rotation()),
            positions,
            axes: mountings.map(|mounting| mounting.axes()),
            turn: *crossing.motion.rotation(),
            shift: *crossing.motion.translation(),
            normal,
            below: normal.z * crossing.road.coefficients()[0] - normal.dot(&positions[0]),
        }
    }

    #[inline]
    fn meets(&self, ray: &[f64; 3]) -> Meeting {
        let ray = Vector3::from(*ray);
        let direction = self.rotations[0] * ray;
        let slant = self.normal.dot(&direction);
        let distance = self.below / slant;
        let distance = if distance > 0.0 { distance } else { f64::NAN };
        let (away, seen) = match self.moves {
            Moves::Camera => (Vector3::zeros(), self.turn * (ray * distance) + self.shift),
            Moves::Vehicle => {
                let road = self.positions[0] + direction * distance;
                let away = self.turn * road + self.shift - self.positions[1];
                (away, self.rotations[1].tr_mul(&away))
            }
        };
        Meeting { direction, slant, distance, away, seen }
    }

    /// The derivatives of brightness by the mountings, from those by the point in the second optical frame.
    #[inline]
    fn slopes(&self, ray: &[f64; 3], at: &Meeting, by_seen: &RowVector3<f64>) -> [f64; SLOPES] {
        let by_seen = by_seen.transpose();
        let (by_turns, by_heights) = match self.moves {
            Moves::Camera => {
                let along = self.turn.tr_mul(&by_seen).dot(&Vector3::from(*ray)) / at.slant;
                let by_turn = at.direction.cross(&self.normal) * (-along * at.distance);
                ([by_turn, Vector3::zeros()], [-along * self.normal.z, 0.0])
            }
            Moves::Vehicle => {
                let later = self.rotations[1] * by_seen; // by the place in the vehicle frame at the second picture
                let earlier = self.turn.tr_mul(&later); // and at the first
                // as far as the place stays on the road
                let across = earlier - self.normal * (earlier.dot(&at.direction) / at.slant);
                let by_turns = [at.direction.cross(&across) * at.distance, later.cross(&at.away)];
                (by_turns, [across.z, -later.z])
            }
        };
        let angles = [0, 1].map(|k| self.axes[k].tr_mul(&by_turns[k]));
        let both = angles[0] + angles[1];
        let height = by_heights[0] + by_heights[1];
        [both.x, both.y, both.z, height, angles[0].y, by_heights[0], angles[1].y, by_heights[1]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::KannalaBrandt;

    const AT: Mounting = Mounting { angles: [0.01, 0.06, -0.012], position: [0.8, 0.1, 1.4] };

    /// A picture whose brightness is a plane over its pixels: its derivatives are exact.
    fn picture() -> Vec<f32> {
        (0..200 * 300).map(|index| 0.3 * (index % 300) as f32 - 0.7 * (index / 300) as f32).collect()
    }

    fn crossing(picture: &[f32], moves: Moves, is_fisheye: bool) -> Crossing<'_> {
        let model = Pinhole::new(210.0, 205.0, 149.5, 60.0, 0.0).unwrap();
        let camera = Camera::new(model, (300, 200), Camera::forward_pose()).unwrap();
        let lens = is_fisheye.then(|| KannalaBrandt::new(&[0.03, -0.01, 0.002, -0.0004], None).unwrap().into());
        let turn = rotation_from_euler(0.01, -0.02, 0.05);
        let motion = match moves {
            Moves::Vehicle => Pose::new(turn, Vector3::new(-1.3, 0.1, 0.02)),
            Moves::Camera => Pose::new(
                OPTICAL_FROM_FLU * turn * OPTICAL_FROM_FLU.transpose(),
                OPTICAL_FROM_FLU * Vector3::new(-1.3, 0.1, 0.02),
            ),
        };
        Crossing {
            camera: camera.with_lens(lens),
            picture: ImageView::new(picture, (300, 200), 1).unwrap(),
            level: 0,
            mask: None,
            motion: motion.unwrap(),
            moves,
            road: Plane::from_angles(0.02, 0.01, 0.0).unwrap(),
        }
    }

    fn rays(crossing: &Crossing<'_>) -> Vec<[f64; 3]> {
        let pixels = [[120.0, 90.0], [150.0, 95.0], [200.0, 120.0], [149.5, 59.0], [120.0, 20.0]];
        pixels.iter().map(|&pixel| crossing.camera.ray(pixel).unwrap().into()).collect()
    }

    #[test]
    fn derivatives_are_those_of_the_brightness() {
        let picture = picture();
        for (moves, is_fisheye) in [(Moves::Vehicle, false), (Moves::Vehicle, true), (Moves::Camera, false)] {
            let crossing = crossing(&picture, moves, is_fisheye);
            let rays = rays(&crossing);
            let found = crossing.shown(&rays, [AT; 2], true).unwrap();
            assert!(found.values[..3].iter().all(|value| value.is_finite()), "{found:?}");
            assert!(
                found.values[4].is_nan() && found.slopes[4][..4].iter().all(|slope| slope.is_nan()),
                "above the horizon"
            );
            assert_eq!(crossing.shown(&rays, [AT; 2], false).unwrap().values[..3], found.values[..3]);
            for column in 0..SLOPES {
                let moved = |step: f64| {
                    let mut at = [AT; 2];
                    match column {
                        0..3 => at.iter_mut().for_each(|each| each.angles[column] += step),
                        3 => at.iter_mut().for_each(|each| each.position[2] += step),
                        4 | 6 => at[column / 2 - 2].angles[1] += step,
                        _ => at[column / 2 - 2].position[2] += step,
                    }
                    crossing.shown(&rays, at, false).unwrap().values
                };
                let (plus, minus) = (moved(1e-4), moved(-1e-4));
                for place in 0..3 {
                    let expected = (plus[place] - minus[place]) / 2e-4;
                    let got = found.slopes[place][column];
                    assert!((got - expected).abs() < 1e-4 * (1.0 + expected.abs()), "{column}: {got} {expected}");
                }
            }
        }
    }

    #[test]
    fn a_halved_picture_is_the_same_picture() {
        let whole = picture();
        let half: Vec<f32> = (0..100 * 150)
            .map(|index| {
                let (x, y) = (2 * (index % 150), 2 * (index / 150));
                let corners = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(i, j)| whole[(y + j) * 300 + x + i]);
                corners.iter().sum::<f32>() / 4.0
            })
            .collect();
        let fine = crossing(&whole, Moves::Vehicle, false);
        let picture = ImageView::new(&half, (150, 100), 1).unwrap();
        let coarse = Crossing { picture, level: 1, ..fine };
        let rays = rays(&fine);
        let [one, other] = [fine, coarse].map(|each| each.shown(&rays, [AT; 2], true).unwrap());
        for place in 0..3 {
            assert!((one.values[place] - other.values[place]).abs() < 1e-4);
            for (a, b) in one.slopes[place].iter().zip(other.slopes[place]) {
                assert!((a - b).abs() < 1e-3 * (1.0 + a.abs()));
            }
        }
    }

    #[test]
    fn what_the_mask_hides_is_not_shown() {
        let picture = picture();
        let plain = crossing(&picture, Moves::Vehicle, false);
        let rays = rays(&plain);
        let hidden = vec![false; 300 * 200];
        let masked = Crossing { mask: Some(&hidden), ..plain };
        assert!(masked.shown(&rays, [AT; 2], false).unwrap().values.iter().all(|value| value.is_nan()));
        let wrong = Crossing { mask: Some(&hidden[1..]), ..plain };
        assert!(matches!(wrong.shown(&rays, [AT; 2], false), Err(Error::View(ViewError::MaskSize { .. }))));
        let coloured = ImageView::new(&picture[..300 * 66 * 3], (300, 66), 3).unwrap();
        let wrong = Crossing { picture: coloured, mask: None, ..wrong };
        assert!(matches!(wrong.shown(&rays, [AT; 2], false), Err(Error::Points(PointsError::Unfit { .. }))));
    }
}
