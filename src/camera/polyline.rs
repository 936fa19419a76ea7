//! Polylines of the vehicle frame on the image.

use nalgebra::Vector3;

use super::trace::Tracer;
use super::{Camera, check_tracing};
use crate::error::Result;
use crate::ground::Ground;
use crate::parallel::check_interrupt;
use crate::view::buffer;

/// Angle, radians, seen from the camera, that a part of a line behind a lens has at most: it is asked for at both ends
/// and at three places between, so nothing that is wider than a quarter of it is overlooked.
const PART: f64 = 0.2;

/// Parts of a line on a height map for each row and column of nodes that it crosses.
const PARTS_A_NODE: f64 = 2.0;

impl Camera {
    /// The image of a polyline of the vehicle frame, cut and clipped: pieces inside the rectangle of pixel centres grown
    /// by `margin` pixels, bent as the lens bends them to `tolerance` pixels. What lies behind the camera or outside the
    /// lens's domain is cut off where that begins; nothing wraps. A vertex that is not finite is a gap.
    ///
    /// # Errors
    /// [`CameraError::Tracing`](crate::error::CameraError::Tracing) for a tolerance below 0.001 pixel or a margin that
    /// is negative or not finite, [`CameraError::Winding`](crate::error::CameraError::Winding) for an image that no
    /// reasonable number of points follows.
    pub fn project_polyline(&self, points: &[Vector3<f64>], margin: f64, tolerance: f64) -> Result<Vec<Vec<[f64; 2]>>> {
        check_tracing(margin, tolerance)?;
        let mut tracer = Tracer::new(self.image_size(), margin, tolerance);
        for ends in points.windows(2) {
            check_interrupt()?;
            self.segment(&mut tracer, &ends[0], &ends[1])?;
        }
        Ok(tracer.finish())
    }

    /// The image of a polyline on the road, from its (x, y), as [`Camera::project_polyline`]. On a height map it follows
    /// the road, and is cut where the road is not known and where a crest hides it. Of a plane through the camera, which
    /// is seen edge-on, there is nothing.
    ///
    /// # Errors
    /// Those of [`Camera::project_polyline`].
    pub fn project_ground_polyline(
        &self,
        points: &[[f64; 2]],
        ground: &Ground,
        margin: f64,
        tolerance: f64,
    ) -> Result<Vec<Vec<[f64; 2]>>> {
        let lift = |[x, y]: [f64; 2]| Vector3::new(x, y, ground.height_at(x, y));
        let map = match ground {
            Ground::HeightMap(map) => map,
            Ground::Plane(plane) => {
                let seen = if plane.is_edge_on(&self.position()) { &[] } else { points };
                let points = buffer::collected("points", seen.iter().copied().map(lift))?;
                return self.project_polyline(&points, margin, tolerance);
            }
        };
        check_tracing(margin, tolerance)?;
        let mut tracer = Tracer::new(self.image_size(), margin, tolerance);
        let eye = self.position();
        for ends in points.windows(2) {
            check_interrupt()?;
            let [start, end] = [ends[0], ends[1]];
            let Some(over) = map.over(start, end) else {
                tracer.cut();
                continue;
            };
            if over.first > 0.0 {
                tracer.cut();
            }
            let parts = (over.nodes * PARTS_A_NODE).ceil().max(1.0) as usize;
            tracer.curve(parts, &|t| {
                let t = between(over.first, over.last, t);
                let point = lift([0, 1].map(|axis| between(start[axis], end[axis], t)));
                let pixel = self.project(&point).pixel;
                (!pixel[0].is_nan() && !map.hides(&eye, &point)).then_some(pixel)
            })?;
            if over.last < 1.0 {
                tracer.cut();
            }
        }
        Ok(tracer.finish())
    }

    fn segment(&self, tracer: &mut Tracer, start: &Vector3<f64>, end: &Vector3<f64>) -> Result<()> {
        let along = end - start;
        let length = along.norm();
        if !(length.is_finite() && start.iter().all(|value| value.is_finite())) {
            tracer.cut();
            return Ok(());
        }
        if length == 0.0 {
            return Ok(());
        }
        // Gone along by the angle seen from the camera, the line's image moves evenly, however near it passes and
        // however far it goes.
        let eye = self.position();
        let nearest = (eye - start).dot(&along) / (length * length);
        let aside = (start + along * nearest - eye).norm().max(1e-6 * length) / length;
        let (first, last) = ((-nearest / aside).atan(), ((1.0 - nearest) / aside).atan());
        let image = |t: f64| {
            let point = if t == 0.0 {
                *start
            } else if t == 1.0 {
                *end
            } else {
                let part = nearest + aside * between(first, last, t).tan();
                start + along * part.clamp(0.0, 1.0)
            };
            let pixel = self.project(&point).pixel;
            (!pixel[0].is_nan()).then_some(pixel)
        };
        if self.lens().is_none() {
            tracer.straight(&image)
        } else {
            tracer.curve(((last - first) / PART).ceil().max(1.0) as usize, &image)
        }
    }
}

fn between(a: f64, b: f64, t: f64) -> f64 {
    // exact at both ends
    a * (1.0 - t) + b * t
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::camera::{KannalaBrandt, Lens, Pinhole};
    use crate::{HeightMap, Plane};

    fn camera(lens: Option<Lens>) -> Camera {
        let model = Pinhole::new(400.0, 410.0, 330.0, 230.0, 2.5).unwrap();
        Camera::from_euler(model, (640, 480), [1.5, 0.3, 1.4], 0.1, 0.2, -0.3).unwrap().with_lens(lens)
    }

    fn fisheye() -> Option<Lens> {
        Some(KannalaBrandt::new(&[0.05, -0.02, 0.003, 0.0], Some(1.7)).unwrap().into())
    }

    fn distance(pieces: &[Vec<[f64; 2]>], p: [f64; 2]) -> f64 {
        let to_line = |w: &[[f64; 2]]| {
            let along = [w[1][0] - w[0][0], w[1][1] - w[0][1]];
            let to = [p[0] - w[0][0], p[1] - w[0][1]];
            let square = along[0] * along[0] + along[1] * along[1];
            let t = ((to[0] * along[0] + to[1] * along[1]) / square).clamp(0.0, 1.0);
            (to[0] - along[0] * t).hypot(to[1] - along[1] * t)
        };
        pieces.iter().flat_map(|piece| piece.windows(2).map(to_line)).fold(f64::INFINITY, f64::min)
    }

    proptest! {
        #[test]
        fn every_point_in_the_image_is_near_a_piece_and_every_piece_is_near_the_line(
            start in prop::array::uniform3(-30.0..30.0f64),
            end in prop::array::uniform3(-30.0..30.0f64),
            bent in any::<bool>(),
        ) {
            let camera = camera(if bent { fisheye() } else { None });
            let (start, end) = (Vector3::from(start), Vector3::from(end));
            let pieces = camera.project_polyline(&[start, end], 0.0, 0.25).unwrap();
            let inside = |p: &[f64; 2]| p[0] >= 0.0 && p[0] <= 639.0 && p[1] >= 0.0 && p[1] <= 479.0;
            prop_assert!(pieces.iter().flatten().all(inside));
            prop_assert!(pieces.iter().all(|piece| piece.len() >= 2));
            let dense: Vec<[f64; 2]> = (0..=20_000)
                .map(|k| camera.project(&(start + (end - start) * (f64::from(k) / 20_000.0))))
                .filter(|projection| projection.valid).map(|projection| projection.pixel).collect();
            // of a line that enters the image by less than the tolerance, a chord may pass outside
            let well_inside = |p: &[f64; 2]| p[0] >= 0.25 && p[0] <= 638.75 && p[1] >= 0.25 && p[1] <= 478.75;
            for &pixel in dense.iter().filter(|pixel| well_inside(pixel)).step_by(7) {
                prop_assert!(distance(&pieces, pixel) < 0.26, "{pixel:?}");
            }
            // every vertex is on the line: its ray passes it
            for &pixel in pieces.iter().flatten() {
                let ray = camera.unproject(pixel).unwrap();
                let normal = (start - camera.position()).cross(&(end - camera.position()));
                let off = ray.dot(&normal.normalize()).abs() * 500.0;
                prop_assert!(off < 0.5, "{pixel:?} {off}");
            }
        }
    }

    #[test]
    fn a_line_past_the_camera_ends_at_the_image_and_does_not_wrap() {
        let road = [[-50.0, 1.6], [100.0, 1.6]];
        for lens in [None, fisheye()] {
            let camera = camera(lens);
            let pieces = camera.project_ground_polyline(&road, &Ground::default(), 0.0, 0.25).unwrap();
            assert_eq!(pieces.len(), 1);
            assert_eq!(pieces[0].last(), Some(&camera.project(&Vector3::new(100.0, 1.6, 0.0)).pixel));
            assert_eq!(lens.is_some(), pieces[0].len() > 2, "straight through a pinhole");
        }
    }

    #[test]
    fn vertices_are_kept_and_gaps_too() {
        let camera = camera(None);
        let points = [[8.0, 0.0], [12.0, 1.0], [f64::NAN, 0.0], [12.0, -2.0], [20.0, 0.0]];
        let pieces = camera.project_ground_polyline(&points, &Ground::default(), 0.0, 0.25).unwrap();
        let pixel = |x: f64, y: f64| camera.project(&Vector3::new(x, y, 0.0)).pixel;
        assert_eq!(pieces, [[pixel(8.0, 0.0), pixel(12.0, 1.0)], [pixel(12.0, -2.0), pixel(20.0, 0.0)]]);
        assert!(camera.project_polyline(&[], 0.0, 0.25).unwrap().is_empty());
        assert!(camera.project_polyline(&[Vector3::x() * 9.0], 0.0, 0.25).unwrap().is_empty());
        // through the camera itself
        let through = [camera.position() - Vector3::x(), camera.position() + Vector3::x() * 9.0];
        assert!(camera.project_polyline(&through, 0.0, 0.25).unwrap().len() <= 1);
        for (margin, tolerance) in [(-1.0, 0.25), (f64::NAN, 0.25), (0.0, 0.0), (0.0, f64::NAN)] {
            assert!(camera.project_polyline(&[], margin, tolerance).is_err());
        }
    }

    #[test]
    fn on_a_height_map_it_follows_the_road_and_stops_at_a_crest() {
        let camera = camera(None);
        let crest = |x: f64| 0.8 * (-((x - 14.0) / 2.0).powi(2)).exp();
        let heights = (0..300 * 3).map(|k| crest(5.0 + 0.1 * f64::from(k / 3))).collect();
        let ground = HeightMap::new(heights, 3, (5.0, -10.0), (0.1, 10.0)).unwrap().into();
        let line = [[2.0, 0.5], [40.0, -6.0]];
        let pieces = camera.project_ground_polyline(&line, &ground, 0.0, 0.25).unwrap();
        assert!(!pieces.is_empty());
        let mut seen = 0;
        for k in 0..4000 {
            let t = f64::from(k) / 4000.0;
            let projection = camera.project_ground([2.0 + 38.0 * t, 0.5 - 6.5 * t], &ground);
            if projection.valid {
                assert!(distance(&pieces, projection.pixel) < 0.26);
                seen += 1;
            }
        }
        let flat =
            camera.project_ground_polyline(&line, &Plane::from_coefficients(0.0, 0.0, 0.0).unwrap().into(), 0.0, 0.25);
        assert!(seen > 200 && flat.unwrap() != pieces);
    }
}
