//! Which cells of a row a camera cannot see, told without looking at each.

use std::ops::Range;

use nalgebra::Vector3;

use crate::camera::{Camera, Lens};
use crate::grid::BevGrid;

/// A box around what a camera sees, on the plane z = 1 of its frame: (min, max) along x and y.
pub(super) struct Window {
    x: (f64, f64),
    y: (f64, f64),
}

/// Samples are taken where the image ends: a pixel beyond the outermost centres, where the halo does, and half a pixel more.
const FRAME: f64 = 1.5;

/// Steps along each side of the image, through lenses.
const STEPS: u32 = 6;

/// A range with nothing in it.
const NOTHING: (f64, f64) = (f64::INFINITY, f64::NEG_INFINITY);

/// Smallest z of unit rays that the box is made of: beyond 84 degrees from the axis the plane is of no use.
const WIDEST: f64 = 0.1;

impl Window {
    /// The window of a camera; `None` where none that is finite would hold all that it sees.
    ///
    /// A lens is one-to-one, so what is seen lies inside the curve that the image's frame is on the plane: the window is the
    /// box around it. Where the frame, or a part of it, is outside the lens's domain, the box is
    /// that around the domain.
    pub(super) fn of(camera: &Camera) -> Option<Self> {
        let (width, height) = camera.image_size();
        let (right, bottom) = (f64::from(width - 1) + FRAME, f64::from(height - 1) + FRAME);
        let corners = [[-FRAME, -FRAME], [right, -FRAME], [right, bottom], [-FRAME, bottom]];
        let mut window = Self { x: NOTHING, y: NOTHING };
        for side in 0..4 {
            let Some(curve) = on_plane(camera, corners[side], corners[(side + 1) % 4]) else {
                let end = camera.lens().map(Lens::max_angle).filter(|end| end.cos() > WIDEST)?.tan() * (1.0 + 1e-6);
                return Some(Self { x: (-end, end), y: (-end, end) });
            };
            window.x = around(window.x, curve.map(|point| point[0]));
            window.y = around(window.y, curve.map(|point| point[1]));
        }
        Some(window)
    }

    /// Rows of this grid before it, whose points are `origin + step * y` in the camera frame.
    pub(super) fn over<'a>(&'a self, grid: &'a BevGrid, step: &Vector3<f64>) -> Rows<'a> {
        // y falls from column to column
        let ends = (grid.y_of_column(grid.columns() as f64), grid.y_of_column(-1.0));
        Rows { window: self, grid, ends, slopes: self.distances(step) }
    }

    /// What is positive for points between the sides of the window and before the camera. It is linear: the first four are
    /// distances from planes through the centre, times something.
    fn distances(&self, p: &Vector3<f64>) -> [f64; 5] {
        let ((left, right), (top, bottom)) = (self.x, self.y);
        [p.x - left * p.z, right * p.z - p.x, p.y - top * p.z, bottom * p.z - p.y, p.z]
    }
}

/// The rows of a grid before a window.
pub(super) struct Rows<'a> {
    window: &'a Window,
    grid: &'a BevGrid,
    /// y of a cell behind the last column and of one before the first.
    ends: (f64, f64),
    /// How distances grow with y.
    slopes: [f64; 5],
}

impl Rows<'_> {
    /// The columns of the row with this origin whose points may be seen, and a few more.
    pub(super) fn columns(&self, origin: &Vector3<f64>) -> Range<usize> {
        let (mut low, mut high) = self.ends;
        for (a, b) in self.window.distances(origin).into_iter().zip(self.slopes) {
            match (a + b * self.ends.0 > 0.0, a + b * self.ends.1 > 0.0) {
                (true, true) => {}
                (false, false) => return 0..0,
                (true, false) => high = high.min(-a / b),
                (false, true) => low = low.max(-a / b),
            }
        }
        let columns = self.grid.columns();
        if (low, high) == self.ends {
            return 0..columns; // most rows
        }
        // outwards to whole vectors, by a cell or more; where nothing is seen, the last is before the first
        let [first, last] = [high, low].map(|y| self.grid.cell_from_ground([0.0, y])[1]);
        let end = ((last + 2.0).max(0.0) as usize).next_multiple_of(8).min(columns);
        (((first - 1.0).max(0.0) as usize) / 8 * 8).min(end)..end
    }
}

/// Points on a line of the image, on the plane z = 1; `None` where one has no ray, or one far from the axis.
fn on_plane(camera: &Camera, from: [f64; 2], to: [f64; 2]) -> Option<[[f64; 2]; STEPS as usize + 1]> {
    let mut points = [[0.0; 2]; STEPS as usize + 1];
    for (step, point) in (0..).zip(&mut points) {
        let part = f64::from(step) / f64::from(STEPS);
        let ray = camera.ray([0, 1].map(|axis| from[axis] + part * (to[axis] - from[axis])))?;
        if ray.z <= WIDEST * ray.norm() {
            return None;
        }
        *point = [ray.x / ray.z, ray.y / ray.z];
    }
    Some(points)
}

/// A range with a curve as well, of which some values are given. What lies between them is beyond them by an eighth of how
/// they bend; all of it is taken.
fn around((min, max): (f64, f64), curve: [f64; STEPS as usize + 1]) -> (f64, f64) {
    let bend = curve.windows(3).map(|at| (at[0] - 2.0 * at[1] + at[2]).abs()).fold(0.0, f64::max);
    curve.into_iter().fold((min, max), |(min, max), value| (min.min(value - bend), max.max(value + bend)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{BrownConrady, DoubleSphere, KannalaBrandt, Pinhole};
    use crate::{Plane, SampleAt};

    fn cameras() -> Vec<Camera> {
        let lenses: Vec<Option<Lens>> = vec![
            None,
            Some(BrownConrady::new(&[-0.3, 0.12, 1e-3, -5e-4, -0.02], None).unwrap().into()),
            Some(BrownConrady::new(&[0.2, 0.1, -4e-3, 3e-3], Some(0.6)).unwrap().into()),
            Some(KannalaBrandt::new(&[0.02, -0.01, 3e-3, -5e-4], None).unwrap().into()),
            Some(DoubleSphere::new(-0.2, 0.6, None).unwrap().into()),
        ];
        let model = Pinhole::new(500.0, 510.0, 610.0, 250.0, 2.0).unwrap();
        let poses = (0..24).map(|i| {
            let turn = |step: i32| f64::from((i * step) % 24) / 24.0;
            ([turn(5) * 4.0 - 2.0, 0.5 - turn(7), 1.2 + turn(1)], [turn(11) * 0.6 - 0.3, turn(7) * 0.9, turn(1) * 6.3])
        });
        let camera = |(at, [roll, pitch, yaw]): ([f64; 3], [f64; 3])| {
            Camera::from_euler(model, (1280, 720), at, roll, pitch, yaw).unwrap()
        };
        poses.flat_map(|pose| lenses.iter().map(move |lens| camera(pose).with_lens(*lens))).collect()
    }

    #[test]
    fn what_is_left_out_is_not_seen_and_most_of_what_is_not_seen_is_left_out() {
        let grid = BevGrid::new((-20.0, 30.0), (-25.0, 25.0), (1.0, 0.25), SampleAt::Center).unwrap();
        let plane = Plane::from_angles(0.02, -0.03, 0.1).unwrap();
        let (mut seen, mut kept, mut windows) = (0, 0, 0);
        for camera in cameras() {
            let Some(window) = Window::of(&camera) else { continue };
            windows += 1;
            for row in 0..grid.rows() {
                let x = grid.x_of_row(row as f64);
                let at = |y: f64| camera.camera_from_vehicle().transform(&Vector3::new(x, y, plane.height_at(x, y)));
                let columns = window.over(&grid, &(at(1.0) - at(0.0))).columns(&at(0.0));
                kept += columns.len();
                for column in 0..grid.columns() {
                    let y = grid.y_of_column(column as f64);
                    let [u, v] = camera.project(&Vector3::new(x, y, plane.height_at(x, y))).pixel;
                    if u > -1.0 && u < 1280.0 && v > -1.0 && v < 720.0 {
                        seen += 1;
                        assert!(columns.contains(&column), "{camera:?}: {column} of {row}, {columns:?}");
                    }
                }
            }
        }
        assert!(windows > 80 && seen > 100_000, "{windows} {seen}");
        assert!(kept < 2 * seen, "{kept} {seen}");
    }

    #[test]
    fn a_camera_that_sees_beyond_the_plane_has_no_window() {
        let model = Pinhole::new(300.0, 300.0, 640.0, 360.0, 0.0).unwrap();
        let camera = Camera::from_euler(model, (1280, 720), [0.0, 0.0, 1.5], 0.0, 0.2, 0.0).unwrap();
        assert!(Window::of(&camera).is_some());
        assert!(Window::of(&camera.with_lens(Lens::from(KannalaBrandt::new(&[0.0; 4], None).unwrap()))).is_none());
        let narrow = KannalaBrandt::new(&[0.0; 4], Some(1.2)).unwrap();
        let Some(Window { x, y }) = Window::of(&camera.with_lens(Lens::from(narrow))) else {
            panic!("a domain has one")
        };
        assert_eq!(x, y);
        assert!((x.1 - 1.2f64.tan()).abs() < 1e-5 && x.0 == -x.1);
    }
}
