//! Straight lines on the plane z = 1.

use nalgebra::{Vector2, Vector3};

/// A straight line of points in the camera frame, `origin + step * t`, as it is on the plane z = 1: straight as well.
///
/// A point is at `foot + along * m` there, with `m = (t + shift) / z`: one number instead of two, and what a lens makes of
/// the line is a function of it alone.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Line {
    /// The point of the line that is nearest to the axis.
    pub(crate) foot: Vector2<f64>,
    /// The direction of the line, at a right angle to the way from the axis to its foot.
    pub(crate) along: Vector2<f64>,
    /// See above.
    pub(crate) shift: f64,
}

/// How near to the camera's centre a line may pass, in parts of the distance of its origin: nearer, rounding leaves too few
/// digits of its direction.
const NEAREST: f64 = 1e-3;

/// Parts of `shift` that t is at least. A line along the axis has none, and this keeps powers of m finite.
const LEAST: f64 = 1e-25;

impl Line {
    /// `None` where a line passes so near to the camera's centre that it is no line on the plane, or no sure one.
    pub(crate) fn seen(origin: &Vector3<f64>, step: &Vector3<f64>) -> Option<Self> {
        // the plane through the line and the centre
        let normal = origin.cross(step);
        let across = normal.xy();
        let square = across.norm_squared();
        // what is not a number is no line either
        let passes = square > NEAREST * NEAREST * origin.norm_squared() * step.norm_squared();
        if !passes {
            return None;
        }
        let length = square.sqrt();
        let foot = across * (-normal.z / square);
        let direction = Vector2::new(-across.y, across.x) / length;
        let (at_origin, with_t) = (direction.dot(&origin.xy()), direction.dot(&step.xy()));
        let scale = if with_t.abs() > LEAST * at_origin.abs() { with_t } else { LEAST * at_origin };
        Some(Self { foot, along: direction * scale, shift: at_origin / scale })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_of_a_line_are_where_they_are_seen() {
        let lines = [
            ([0.3, 1.2, 8.0], [-0.99, 0.02, 0.1]),
            ([0.3, 1.2, 2.0], [0.0, 0.0, 1.0]),  // along the axis
            ([-4.0, 0.0, 9.0], [1.0, 0.0, 0.0]), // through it
            ([2.0, 1.5, 30.0], [0.0, -1.0, 0.0]),
            ([1e4, 1.5e4, 3e5], [0.5, -1.0, 0.25]),
        ];
        for (origin, step) in lines.map(|(origin, step)| (Vector3::from(origin), Vector3::from(step))) {
            let line = Line::seen(&origin, &step).unwrap();
            assert!(line.foot.dot(&line.along).abs() <= 1e-15 * line.foot.norm() * line.along.norm());
            for t in [-0.5, 0.0, 0.25, 1.0, 7.5] {
                let point = origin + step * t;
                let m = (t + line.shift) / point.z;
                let seen = line.foot + line.along * m;
                assert!((seen - point.xy() / point.z).norm() < 1e-12, "{origin} {step} {t}: {seen}");
            }
        }
    }

    #[test]
    fn no_line_passes_through_the_centre() {
        let step = Vector3::new(0.1, -0.2, 1.0);
        assert!(Line::seen(&(step * 3.0), &step).is_none());
        assert!(Line::seen(&Vector3::zeros(), &step).is_none());
        assert!(Line::seen(&Vector3::new(1.0, 2.0, 0.0), &Vector3::new(1.0, 0.0, 0.0)).is_none()); // in the plane of the camera
        assert!(Line::seen(&Vector3::new(f64::NAN, 2.0, 0.0), &step).is_none());
    }
}
