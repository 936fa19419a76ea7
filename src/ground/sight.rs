//! What of a height map an eye sees: most of it without following a ray.
//!
//! From a point towards the eye, the elevation at which the eye sees the road under the line of sight falls, or stays, as
//! long as the eye is above the road's tangent plane: there nothing hides what lies behind it. Over one patch, which is
//! bilinear, the eye's height above the tangent plane is bilinear too, so its corners tell for all of it. What is left are
//! the few patches that fall away more steeply than the line of sight. Behind those, in their directions, a point is seen
//! for certain if it appears higher than all of them; only the others need a ray.
//!
//! A horizon of everything that lies before a point, without the tangent planes, was tried and saved nothing on noise of
//! 1 cm: every point's own neighbourhood was in it.

use nalgebra::Vector3;

use super::{EDGE_ON, HeightMap};
use crate::error::Result;
use crate::view::buffer;

/// Directions that patches are sorted into: at 50 m, 15 cm.
const BINS: usize = 2048;

/// Steps of distance.
const STEPS: usize = 32;

/// Room for rounding: metres, and parts of a full turn in directions.
const ROUNDING: f64 = 1e-9;

/// An eye above a height map.
pub(crate) struct Sight<'a> {
    map: &'a HeightMap,
    eye: Vector3<f64>,
    side: f64,
    falling: Falling,
}

/// The patches that fall away from the eye.
enum Falling {
    /// There is none.
    None,
    /// These.
    Some(Fallen),
    /// Not looked for: too many, or the eye is below the road.
    Unknown,
}

/// Patches by direction and distance.
struct Fallen {
    /// Square of the distance to the nearest one.
    nearest: f64,
    /// Steps to a metre.
    scale: f64,
    /// For each direction and step of distance: the greatest tangent of the elevation at which the eye sees any of them that
    /// begins in this step or before.
    highest: Vec<f64>,
}

impl<'a> Sight<'a> {
    pub(crate) fn new(map: &'a HeightMap, eye: Vector3<f64>) -> Result<Self> {
        let side = map.side(&eye);
        let falling = if side > 0.0 { falling(map, &eye)? } else { Falling::Unknown };
        Ok(Self { map, eye, side, falling })
    }

    /// Whether the eye sees all of the road that it faces.
    pub(crate) fn sees_all(&self) -> bool {
        matches!(self.falling, Falling::None)
    }

    /// [`HeightMap::hides`] of this eye, for a point on the known road.
    #[inline]
    pub(crate) fn hides(&self, point: &Vector3<f64>) -> bool {
        let seen = match &self.falling {
            Falling::None => true,
            Falling::Some(fallen) => fallen.is_seen(&(point - self.eye)),
            Falling::Unknown => false,
        };
        !seen && self.map.hides_on(self.side, &self.eye, point)
    }
}

impl Fallen {
    /// Whether a point so far from the eye is certainly not hidden.
    #[inline]
    fn is_seen(&self, away: &Vector3<f64>) -> bool {
        let square = away.x * away.x + away.y * away.y;
        if square < self.nearest {
            return true;
        }
        let distance = square.sqrt();
        let bin = ((direction(away.x, away.y) * BINS as f64) as usize).min(BINS - 1);
        let step = ((distance * self.scale) as usize).min(STEPS - 1);
        away.z > self.highest[bin * STEPS + step] * distance + ROUNDING
    }
}

/// Where (x, y) points, from 0 to 1 in a full turn: grows with the angle, by one division.
#[inline(always)]
fn direction(x: f64, y: f64) -> f64 {
    let part = 0.25 * y / (x.abs() + y.abs()); // from -1/4 to 1/4
    if x >= 0.0 {
        0.5 + part
    } else if y >= 0.0 {
        1.0 - part
    } else {
        -part
    }
}

/// Which patches fall away from an eye above the road.
fn falling(map: &HeightMap, eye: &Vector3<f64>) -> Result<Falling> {
    let (rows, columns) = (map.rows() - 1, map.columns() - 1);
    let ((x0, y0), (dx, dy)) = (map.origin(), map.spacing());
    let (u, v) = ((eye.x - x0) / dx, (eye.y - y0) / dy);
    let mut flags = buffer::zeroed::<u8>("Lut", rows * columns)?;
    let mut count = 0;
    for (i, flags) in flags.chunks_mut(columns).enumerate() {
        let u = u - i as f64;
        let (near, far) = (&map.row(i)[..=columns], &map.row(i + 1)[..=columns]);
        for j in 0..columns {
            let (h, p, q) = (near[j], far[j] - near[j], near[j + 1] - near[j]);
            let (r, v) = (far[j + 1] - far[j] - q, v - j as f64);
            // above the tangent planes at the four corners
            let above = eye.z - h - p * u - q * v;
            let (a, b, c) = (above - r * v, above - r * u, above - r * (u + v - 1.0));
            let margin = 2.0 * EDGE_ON;
            let faces = (above > margin) & (a > margin) & (b > margin) & (c > margin);
            flags[j] = u8::from(!faces); // NaN where the road is not known
        }
        count += flags.iter().filter(|&&flag| flag != 0).count();
    }
    // Sorting one in takes as long as a ray or two. Beyond a hole the road may go on at any height.
    if count > rows * columns / 4 || map.peaks().steepest == f64::INFINITY {
        return Ok(Falling::Unknown);
    }
    if count == 0 {
        return Ok(Falling::None);
    }
    let corner = |i: usize, j: usize| [x0 + dx * i as f64 - eye.x, y0 + dy * j as f64 - eye.y];
    let farthest = [(0, 0), (0, columns), (rows, 0), (rows, columns)]
        .map(|(i, j)| corner(i, j))
        .into_iter()
        .fold(0.0, |far: f64, [x, y]| far.max(x.hypot(y)));
    let scale = STEPS as f64 / farthest;
    let mut highest = buffer::filled("Lut", BINS * STEPS, f64::NEG_INFINITY)?;
    let mut nearest = f64::INFINITY;
    for (k, _) in flags.iter().enumerate().filter(|(_, flag)| **flag != 0) {
        let (i, j) = (k / columns, k % columns);
        let patch = Patch::new(map, eye, (i, j), corner);
        nearest = f64::min(nearest, patch.near);
        let step = ((patch.near * scale - ROUNDING).max(0.0) as usize).min(STEPS - 1);
        let mut note = |bins: std::ops::RangeInclusive<usize>| {
            for bin in bins {
                let held = &mut highest[bin * STEPS + step];
                *held = held.max(patch.highest);
            }
        };
        match patch.bins {
            (first, last) if first <= last => note(first..=last),
            (first, last) => {
                note(first..=BINS - 1);
                note(0..=last);
            }
        }
    }
    for steps in highest.chunks_mut(STEPS) {
        for step in 1..STEPS {
            steps[step] = steps[step].max(steps[step - 1]);
        }
    }
    let nearest = (nearest - ROUNDING).max(0.0);
    Ok(Falling::Some(Fallen { nearest: nearest * nearest, scale, highest }))
}

/// A patch as an eye sees it.
struct Patch {
    /// No point of it is nearer.
    near: f64,
    /// First and last direction; the first is behind the last where it lies across direction 0.
    bins: (usize, usize),
    /// No point of it appears under a greater tangent of the elevation.
    highest: f64,
}

impl Patch {
    fn new(
        map: &HeightMap,
        eye: &Vector3<f64>,
        (i, j): (usize, usize),
        corner: impl Fn(usize, usize) -> [f64; 2],
    ) -> Self {
        let corners = [corner(i, j), corner(i, j + 1), corner(i + 1, j), corner(i + 1, j + 1)];
        let heights = [map.row(i)[j], map.row(i)[j + 1], map.row(i + 1)[j], map.row(i + 1)[j + 1]];
        let range = |axis: usize| {
            let values = corners.map(|corner| corner[axis]);
            (values.into_iter().fold(f64::INFINITY, f64::min), values.into_iter().fold(f64::NEG_INFINITY, f64::max))
        };
        let (x, y) = (range(0), range(1));
        let gap = |(low, high): (f64, f64)| low.max(-high).max(0.0); // from 0 to the nearest of low..high
        let near = gap(x).hypot(gap(y));
        let far = corners.into_iter().fold(0.0, |far: f64, [x, y]| far.max(x.hypot(y)));
        let above = heights.into_iter().fold(f64::NEG_INFINITY, f64::max) - eye.z;
        let highest = if above < 0.0 { above / (far + ROUNDING) } else { above / (near - ROUNDING).max(0.0) };
        let highest = if highest.is_nan() { f64::INFINITY } else { highest };
        let all = (0, BINS - 1);
        let bin = |direction: f64| ((direction.clamp(0.0, 1.0) * BINS as f64) as usize).min(BINS - 1);
        let bins = if near <= ROUNDING {
            all
        } else {
            // corners bound the directions of a patch that the eye is not in; across the seam, the larger ones come first
            let turns = corners.map(|[x, y]| direction(x, y));
            let across = x.0 < 0.0 && y.0 <= 0.0 && y.1 >= 0.0;
            let bounds = |within: [f64; 4]| {
                let (low, high) = within.into_iter().fold((2.0f64, -1.0f64), |(a, b), t| (a.min(t), b.max(t)));
                (low - ROUNDING, high + ROUNDING)
            };
            if across {
                let (low, high) = bounds(turns.map(|turn| if turn < 0.5 { turn + 1.0 } else { turn }));
                (bin(low), bin(high - 1.0))
            } else {
                let (low, high) = bounds(turns);
                (bin(low), bin(high))
            }
        };
        Self { near, bins, highest }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn map_of(spacing: f64, height: impl Fn(f64, f64) -> f64) -> HeightMap {
        let heights = (0..81 * 61)
            .map(|k| height(f64::from(k / 61) * spacing - 5.0, f64::from(k % 61) * spacing - 30.0 * spacing))
            .collect();
        HeightMap::new(heights, 61, (-5.0, -30.0 * spacing), (spacing, spacing)).unwrap()
    }

    /// How many points of the map are (told seen without a ray, hidden); asserts that none is both.
    fn check(map: &HeightMap, eye: Vector3<f64>) -> (usize, usize) {
        let sight = Sight::new(map, eye).unwrap();
        let ((x0, y0), (dx, dy)) = (map.origin(), map.spacing());
        let (mut told, mut hidden) = (0, 0);
        for i in 0..3 * (map.rows() - 1) {
            for j in 0..3 * (map.columns() - 1) {
                // on nodes, on edges and between
                let (x, y) = (x0 + dx * i as f64 / 3.0, y0 + dy * (j as f64 / 3.0 + 1e-3));
                let z = map.height_at(x, y);
                if z.is_nan() {
                    continue;
                }
                let point = Vector3::new(x, y, z);
                let hides = map.hides(&eye, &point);
                assert_eq!(sight.hides(&point), hides, "{eye} {point}");
                let seen = match &sight.falling {
                    Falling::None => true,
                    Falling::Some(fallen) => fallen.is_seen(&(point - eye)),
                    Falling::Unknown => false,
                };
                assert!(!(seen && hides), "{eye} {point}");
                (told, hidden) = (told + usize::from(seen), hidden + usize::from(hides));
            }
        }
        (told, hidden)
    }

    #[test]
    fn directions_grow_in_a_full_turn() {
        let mut before = -1.0;
        for step in 1..2000 {
            let angle = (f64::from(step) / 1000.0 - 1.0) * std::f64::consts::PI;
            let turn = direction(angle.cos(), angle.sin());
            assert!(turn > before && (0.0..=1.0).contains(&turn), "{angle}");
            before = turn;
        }
    }

    #[test]
    fn gentle_roads_need_no_ray_and_crests_few() {
        let points = 9 * 80 * 60;
        let eye = Vector3::new(1.5, 0.2, 1.4);
        let plane = map_of(0.5, |x, y| 0.02 * x - 0.01 * y);
        assert_eq!(check(&plane, eye), (points, 0));
        let gentle = map_of(0.5, |x, y| 0.1 * (x / 9.0).sin() + 0.05 * (y / 6.0).cos());
        assert_eq!(check(&gentle, eye), (points, 0));
        let crest = map_of(0.5, |x, y| if (x - 15.0).abs() < 0.6 && y.abs() < 3.0 { 0.8 } else { 0.0 });
        let (told, hidden) = check(&crest, eye);
        assert!(hidden > 1000 && told > points - 3 * hidden, "{told} {hidden} of {points}");
    }

    #[test]
    fn holes_eyes_below_and_eyes_beside_the_map() {
        let bumps = |x: f64, y: f64| 0.3 * (x * 0.8).sin() * (y * 0.5).cos();
        let hole = map_of(0.5, |x, y| if (x - 15.0).abs() < 0.6 && y.abs() < 3.0 { f64::NAN } else { bumps(x, y) });
        for eye in [[1.5, 0.0, 1.4], [1.5, 0.0, -2.0], [-20.0, 3.0, 1.0], [60.0, -40.0, 2.0], [15.0, 0.0, 0.31]] {
            check(&hole, eye.into());
            check(&map_of(0.5, bumps), eye.into());
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn what_needs_no_ray_is_not_hidden(
            eye in [-8.0..40.0f64, -20.0..20.0f64, 0.4..6.0f64],
            waves in prop::array::uniform3((0.02..0.6f64, 0.1..2.0f64, 0.0..6.3f64)),
            spacing in 0.2..0.8f64,
            noise in 0.0..0.02f64,
        ) {
            let map = map_of(spacing, |x, y| {
                let wave = |(height, rate, turn): (f64, f64, f64)| height * (rate * (x * turn.cos() + y * turn.sin())).sin();
                waves.into_iter().map(wave).sum::<f64>() / 3.0 + noise * (x * 91.7 + y * 37.1).sin()
            });
            check(&map, eye.into());
        }
    }
}
