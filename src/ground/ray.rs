//! Rays over a height map.
//!
//! A ray crosses the map's patches one after the other. Over one patch its height above the bilinear road is a quadratic
//! of the way gone, so where it meets the road, and whether it dips below, is solved there and not searched by steps.

use std::ops::ControlFlow;

use nalgebra::Vector3;

use super::{EDGE_ON, HeightMap, is_edge_on};

/// Height difference that is rounding, metres.
const ROUNDING: f64 = 1e-9;

/// A sight line is cut off where it lies this far below the road, metres. A road seen at a grazing angle keeps its own
/// line of sight only to rounding.
const CUT_OFF: f64 = 1e-6;

/// A ray's height above a patch, or below it where the eye is: `c + b s + a s^2` for s from 0 to `length`.
struct Crossing {
    /// Way along the ray, in lengths of its direction, to where it enters.
    start: f64,
    /// Way along the ray, in lengths of its direction, to where it leaves.
    end: f64,
    length: f64,
    a: f64,
    b: f64,
    c: f64,
}

/// The part of a line that lies over a map.
pub(crate) struct Over {
    /// From where to where, in parts of the line.
    pub(crate) first: f64,
    pub(crate) last: f64,
    /// Rows and columns of nodes that it crosses there.
    pub(crate) nodes: f64,
}

impl HeightMap {
    /// The part of the line from one (x, y) to another that lies over the map; `None` if none does, or a coordinate is
    /// not finite.
    pub(crate) fn over(&self, from: [f64; 2], to: [f64; 2]) -> Option<Over> {
        let ((x0, y0), (dx, dy)) = (self.origin(), self.spacing());
        let (u, v) = ((from[0] - x0) / dx, (from[1] - y0) / dy);
        let (du, dv) = ((to[0] - from[0]) / dx, (to[1] - from[1]) / dy);
        if !(u + v + du + dv).is_finite() {
            return None;
        }
        let mut way = (0.0, 1.0);
        clip(&mut way, u, du, (0.0, (self.rows() - 1) as f64));
        clip(&mut way, v, dv, (0.0, (self.columns() - 1) as f64));
        let nodes = (way.1 - way.0) * (du.abs() + dv.abs());
        (way.0 <= way.1).then_some(Over { first: way.0, last: way.1, nodes })
    }

    /// Where the ray from `origin` along `direction` first meets the road; `None` where it never does, and where it has
    /// passed to the road's other side over ground that is not known.
    pub(super) fn intersect(&self, origin: &Vector3<f64>, direction: &Vector3<f64>) -> Option<Vector3<f64>> {
        let direction = direction.normalize();
        let side = self.side(origin);
        let mut left_at = f64::NAN; // no patch before
        let found = self.cross(origin, &direction, f64::INFINITY, side, |crossing| {
            let goes_on = crossing.start == left_at;
            left_at = crossing.end;
            if !goes_on && crossing.c < -ROUNDING {
                return ControlFlow::Break(None);
            }
            match crossing.first_root() {
                Some(s) => ControlFlow::Break(Some(crossing.start + s)),
                None => ControlFlow::Continue(()),
            }
        });
        let way = found??;
        if is_edge_on(way) {
            return None; // the eye itself lies in the road
        }
        let point = origin + direction * way;
        let height = self.height_at(point.x, point.y);
        // at the map's border rounding may have put the point outside
        Some(Vector3::new(point.x, point.y, if height.is_nan() { point.z } else { height }))
    }

    /// Whether the road stands between `eye` and a point on it, or is seen edge-on there. What is not known hides nothing.
    pub(crate) fn hides(&self, eye: &Vector3<f64>, point: &Vector3<f64>) -> bool {
        self.hides_on(self.side(eye), eye, point)
    }

    /// [`HeightMap::hides`] of an eye whose side is known.
    pub(super) fn hides_on(&self, side: f64, eye: &Vector3<f64>, point: &Vector3<f64>) -> bool {
        let to_eye = eye - point;
        // where the line rises faster than any road, none comes up to it
        if side * to_eye.z > self.peaks().steepest * to_eye.x.hypot(to_eye.y) + EDGE_ON {
            return false;
        }
        if is_edge_on(self.above_tangent(eye, point.x, point.y)) {
            return true;
        }
        self.cross(point, &to_eye, 1.0, side, |crossing| {
            if crossing.lowest().0 < -CUT_OFF { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        })
        .is_some()
    }

    /// 1 where an eye looks at the road from above, -1 from below.
    pub(super) fn side(&self, eye: &Vector3<f64>) -> f64 {
        let road = self.height_at(eye.x, eye.y);
        // beside the map it is above, unless it is below everything
        let below = if road.is_nan() { eye.z < self.range().0 } else { eye.z < road };
        if below { -1.0 } else { 1.0 }
    }

    /// Visits the known patches under (over) the ray from `origin` along `direction` up to `end` directions, in order,
    /// leaving out where it is higher (lower) than any road.
    fn cross<B>(
        &self,
        origin: &Vector3<f64>,
        direction: &Vector3<f64>,
        end: f64,
        side: f64,
        mut visit: impl FnMut(&Crossing) -> ControlFlow<B>,
    ) -> Option<B> {
        let (x0, y0) = self.origin();
        let (dx, dy) = self.spacing();
        // in nodes
        let (u0, v0) = ((origin.x - x0) / dx, (origin.y - y0) / dy);
        let (du, dv) = (direction.x / dx, direction.y / dy);
        let (lowest, highest) = self.range();
        let mut way = (0.0_f64, end);
        clip(&mut way, u0, du, (0.0, (self.rows() - 1) as f64));
        clip(&mut way, v0, dv, (0.0, (self.columns() - 1) as f64));
        // with room, so that it is outside of the road where it enters
        let slab = if side > 0.0 { (f64::NEG_INFINITY, highest + CUT_OFF) } else { (lowest - CUT_OFF, f64::INFINITY) };
        clip(&mut way, origin.z, direction.z, slab);
        let (mut t, end) = way;
        if !(t <= end && t.is_finite()) {
            return None;
        }
        let cell = |position: f64, nodes: usize| (position.max(0.0) as usize).min(nodes - 2);
        let (mut i, mut j) = (cell(u0 + du * t, self.rows()), cell(v0 + dv * t, self.columns()));
        let peaks = self.peaks();
        let mut level = 1;
        loop {
            // from above, what lies wholly below the ray is leapt over, in ever larger blocks
            if side > 0.0 && level > 0 {
                let (block_i, block_j) = (i >> level, j >> level);
                let to_row = way_out(block_i, u0, du, level);
                let to_column = way_out(block_j, v0, dv, level);
                let next = to_row.min(to_column).min(end).max(t);
                let lowest = (origin.z + direction.z * t).min(origin.z + direction.z * next);
                // touching is meeting, see `first_root`
                if lowest <= peaks.highest(level, i, j) + ROUNDING {
                    level -= 1;
                    continue;
                }
                if next >= end {
                    return None;
                }
                t = next;
                let inside = |position: f64, block: usize, nodes: usize| {
                    cell(position, nodes).clamp(block << level, (((block + 1) << level) - 1).min(nodes - 2))
                };
                let left = if to_row <= to_column {
                    j = inside(v0 + dv * t, block_j, self.columns());
                    i = if du > 0.0 { (((block_i + 1) << level) - 1).min(self.rows() - 2) } else { block_i << level };
                    step(&mut i, du, self.rows() - 2)
                } else {
                    i = inside(u0 + du * t, block_i, self.rows());
                    j = if dv > 0.0 {
                        (((block_j + 1) << level) - 1).min(self.columns() - 2)
                    } else {
                        block_j << level
                    };
                    step(&mut j, dv, self.columns() - 2)
                };
                if left {
                    return None;
                }
                level = (level + 1).min(peaks.top());
                continue;
            }
            level = 1;
            let (to_row, to_column) = (way_out(i, u0, du, 0), way_out(j, v0, dv, 0));
            let next = to_row.min(to_column).min(end).max(t);
            let corners = self.corners(i, j);
            if !corners.iter().any(|height| height.is_nan()) {
                let [h, p, q, r] = [
                    corners[0],
                    corners[2] - corners[0],
                    corners[1] - corners[0],
                    corners[3] - corners[2] - corners[1] + corners[0],
                ];
                let (u, v) = (u0 + du * t - i as f64, v0 + dv * t - j as f64);
                let crossing = Crossing {
                    start: t,
                    end: next,
                    length: next - t,
                    c: side * (origin.z + direction.z * t - (h + p * u + q * v + r * u * v)),
                    b: side * (direction.z - (p * du + q * dv + r * (u * dv + v * du))),
                    a: side * -(r * du * dv),
                };
                if let ControlFlow::Break(found) = visit(&crossing) {
                    return Some(found);
                }
            }
            if next >= end {
                return None;
            }
            t = next;
            let left = if to_row <= to_column {
                step(&mut i, du, self.rows() - 2)
            } else {
                step(&mut j, dv, self.columns() - 2)
            };
            if left {
                return None;
            }
        }
    }

    /// Heights of the nodes (i, j), (i, j + 1), (i + 1, j) and (i + 1, j + 1).
    fn corners(&self, i: usize, j: usize) -> [f64; 4] {
        let (near, far) = (self.row(i), self.row(i + 1));
        [near[j], near[j + 1], far[j], far[j + 1]]
    }
}

impl Crossing {
    fn at(&self, s: f64) -> f64 {
        (self.a * s + self.b) * s + self.c
    }

    /// The least value, and where it is.
    fn lowest(&self) -> (f64, f64) {
        let turn = -self.b / (2.0 * self.a);
        let turns = self.a > 0.0 && turn > 0.0 && turn < self.length;
        [0.0, self.length, if turns { turn } else { 0.0 }]
            .map(|s| (self.at(s), s))
            .into_iter()
            .fold((f64::INFINITY, 0.0), |least, next| if next.0 < least.0 { next } else { least })
    }

    /// Where it first is 0 or less, or touches 0 as far as rounding can tell: at a ridge that it just passes over.
    fn first_root(&self) -> Option<f64> {
        if self.c <= 0.0 {
            return Some(0.0);
        }
        let discriminant = self.b * self.b - 4.0 * self.a * self.c;
        // from above the first root is the one with the falling slope: c / -b where the road is a plane. Written with
        // the sum of two numbers of one sign, because their difference loses digits.
        let root = discriminant.sqrt(); // NaN where there is none
        let s = if self.b < 0.0 { 2.0 * self.c / (root - self.b) } else { (-self.b - root) / (2.0 * self.a) };
        if s >= 0.0 && s <= self.length {
            return Some(s);
        }
        let (lowest, at) = self.lowest();
        (lowest <= ROUNDING).then_some(at)
    }
}

/// Cuts the way along a ray to where `position + speed * t` lies within the bounds.
fn clip(way: &mut (f64, f64), position: f64, speed: f64, (low, high): (f64, f64)) {
    if speed == 0.0 {
        if !(low <= position && position <= high) {
            way.1 = f64::NEG_INFINITY;
        }
        return;
    }
    let (a, b) = ((low - position) / speed, (high - position) / speed);
    *way = (way.0.max(a.min(b)), way.1.min(a.max(b)));
}

/// Where a ray leaves a block of 2^level cells on one axis.
fn way_out(block: usize, position: f64, speed: f64, level: u32) -> f64 {
    if speed > 0.0 {
        (((block + 1) << level) as f64 - position) / speed
    } else if speed < 0.0 {
        ((block << level) as f64 - position) / speed
    } else {
        f64::INFINITY
    }
}

/// Goes to the next cell; true where there is none.
fn step(cell: &mut usize, speed: f64, last: usize) -> bool {
    let edge = if speed > 0.0 { last } else { 0 };
    if *cell == edge {
        return true;
    }
    *cell = if speed > 0.0 { *cell + 1 } else { *cell - 1 };
    false
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::ground::Plane;

    fn map_of(height: impl Fn(f64, f64) -> f64) -> HeightMap {
        let heights = (0..41 * 31).map(|k| height(5.0 + f64::from(k / 31), f64::from(k % 31) - 15.0)).collect();
        HeightMap::new(heights, 31, (5.0, -15.0), (1.0, 1.0)).unwrap()
    }

    /// The first meeting found by small steps and bisection.
    fn by_steps(map: &HeightMap, eye: &Vector3<f64>, direction: &Vector3<f64>) -> Option<Vector3<f64>> {
        let above = |t: f64| {
            let point = eye + direction * t;
            point.z - map.height_at(point.x, point.y)
        };
        let step = 2e-3;
        let first = (1..40_000).map(|k| f64::from(k) * step).find(|&t| above(t) <= 0.0)?;
        if above(first - step).is_nan() {
            return None; // came in from below
        }
        let (mut low, mut high) = (first - step, first);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if above(middle) > 0.0 { low = middle } else { high = middle }
        }
        Some(eye + direction * high)
    }

    #[test]
    fn on_a_flat_map_rays_end_as_on_the_plane() {
        let plane = Plane::from_coefficients(-0.2, 0.03, -0.01).unwrap();
        let map = map_of(|x, y| plane.height_at(x, y));
        let eye = Vector3::new(1.7, 0.1, 1.3);
        let mut hits = 0;
        for k in 0..2000 {
            let direction = Vector3::new(1.0, f64::from(k % 50) * 0.02 - 0.5, -0.25 + f64::from(k / 50) * 0.006);
            let expected = plane.intersect(&eye, &direction);
            let inside = expected.filter(|p| p.x > 5.0 && p.x < 45.0 && p.y.abs() < 15.0);
            let got = map.intersect(&eye, &direction);
            match (got, inside) {
                (Some(got), Some(expected)) => {
                    assert!((got - expected).norm() < 1e-9, "{got} {expected}");
                    assert!(!map.hides(&eye, &got));
                    hits += 1;
                }
                (None, None) => {}
                other => panic!("{direction} {other:?}"),
            }
        }
        assert!(hits > 500);
    }

    proptest! {
        #[test]
        fn the_first_meeting_is_that_of_small_steps(
            eye in [-3.0..50.0f64, -20.0..20.0f64, 2.5..6.0f64],
            to in [5.0..45.0f64, -15.0..15.0f64, -3.0..2.0f64],
        ) {
            let map = map_of(|x, y| (x * 0.7).sin() + (y * 0.4 + 0.3 * x).cos());
            let (eye, direction) = (Vector3::from(eye), (Vector3::from(to) - Vector3::from(eye)).normalize());
            let (got, expected) = (map.intersect(&eye, &direction), by_steps(&map, &eye, &direction));
            if let (Some(got), Some(expected)) = (got, expected) {
                // a ray that only grazes a crest may be caught by one and missed by the other
                let grazes = (got - expected).norm() > 1e-6;
                prop_assert!(!grazes || (got - eye).norm() < (expected - eye).norm() + 1e-6, "{got} {expected}");
                if !grazes {
                    prop_assert!(!map.hides(&eye, &got));
                }
            } else if expected.is_some() {
                let depth = (1..2000).map(|k| eye + direction * f64::from(k) * 0.03)
                    .map(|p| p.z - map.height_at(p.x, p.y)).fold(f64::INFINITY, f64::min);
                prop_assert!(depth > -1e-3, "missed {expected:?}");
            }
        }
    }

    proptest! {
        #[test]
        fn what_is_hidden_is_what_small_steps_find_hidden(
            eye in [-3.0..50.0f64, -20.0..20.0f64, 1.5..4.0f64],
            at in [5.0..45.0f64, -15.0..15.0f64],
            rough in 0.05..1.0f64,
            hole in any::<bool>(),
        ) {
            let map = map_of(|x, y| {
                let height = rough * ((x * 0.7).sin() + (y * 0.4 + 0.3 * x).cos());
                if hole && x == 20.0 && y == 3.0 { f64::NAN } else { height }
            });
            let (eye, point) = (Vector3::from(eye), Vector3::new(at[0], at[1], map.height_at(at[0], at[1])));
            let road = map.height_at(eye.x, eye.y); // NaN beside the map
            prop_assume!(point.z.is_finite() && (road.is_nan() || road < eye.z)); // from below the other side hides
            let above = (1..20_000).map(|k| point + (eye - point) * (f64::from(k) / 20_000.0))
                .map(|p| p.z - map.height_at(p.x, p.y)).fold(f64::INFINITY, f64::min);
            if above < -1e-5 {
                prop_assert!(map.hides(&eye, &point), "{above}");
            } else if above > 1e-5 || map.peaks().steepest < 0.01 {
                prop_assert!(!map.hides(&eye, &point), "{above}");
            }
        }
    }

    #[test]
    fn a_crest_hides_the_valley_behind_it() {
        let map = map_of(|x, _| if x == 20.0 { 1.0 } else { 0.0 });
        let eye = Vector3::new(0.0, 0.0, 1.5);
        let on_road = |x| Vector3::new(x, 0.0, map.height_at(x, 0.0));
        for (x, hidden) in [(10.0, false), (19.5, false), (20.0, false), (20.5, true), (30.0, true), (44.9, true)] {
            assert_eq!(map.hides(&eye, &on_road(x)), hidden, "{x}");
        }
        // from 1.5 m at 0 over 1 m at 20: the ray comes down at 60
        let high = Vector3::new(0.0, 0.0, 3.0);
        assert!(map.hides(&high, &on_road(29.0)) && !map.hides(&high, &on_road(31.0)));
        let hit = map.intersect(&eye, &(on_road(30.0) - eye)).unwrap();
        assert!(hit.x > 19.0 && hit.x < 20.0, "{hit}");
    }

    #[test]
    fn unknown_ground_hides_nothing_and_is_met_nowhere() {
        let map = map_of(|x, _| if x == 20.0 { f64::NAN } else { 0.0 });
        let eye = Vector3::new(0.0, 0.0, 1.5);
        let towards = |x: f64| map.intersect(&eye, &(Vector3::new(x, 0.0, 0.0) - eye));
        assert!(towards(10.0).is_some() && towards(30.0).is_some());
        assert_eq!(towards(20.2), None, "into the hole");
        assert_eq!(towards(3.0), None, "before the map");
        assert_eq!(towards(60.0), None, "beyond the map");
        assert!(!map.hides(&eye, &Vector3::new(30.0, 0.0, 0.0)));
    }

    #[test]
    fn straight_down_and_from_below() {
        let map = map_of(|x, _| 0.1 * x);
        let down = map.intersect(&Vector3::new(10.0, 0.5, 9.0), &Vector3::new(0.0, 0.0, -2.0)).unwrap();
        assert!((down - Vector3::new(10.0, 0.5, 1.0)).norm() < 1e-12);
        let up = map.intersect(&Vector3::new(10.0, 0.5, -9.0), &Vector3::new(0.0, 0.0, 1.0)).unwrap();
        assert!((up - Vector3::new(10.0, 0.5, 1.0)).norm() < 1e-12);
        assert_eq!(map.intersect(&Vector3::new(10.0, 0.5, 9.0), &Vector3::new(0.0, 0.0, 1.0)), None);
        for bad in [f64::NAN, f64::INFINITY] {
            assert_eq!(map.intersect(&Vector3::new(10.0, bad, 9.0), &Vector3::new(0.0, 0.0, -1.0)), None);
            assert_eq!(map.intersect(&Vector3::new(10.0, 0.0, 9.0), &Vector3::new(0.0, bad, -1.0)), None);
            assert!(!map.hides(&Vector3::new(bad, 0.0, 1.0), &Vector3::new(10.0, 0.0, 0.0)));
        }
    }
}
