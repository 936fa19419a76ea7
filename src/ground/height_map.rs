//! A road of heights at the nodes of a grid.

use nalgebra::Vector3;

use super::is_edge_on;
use super::peaks::Peaks;
use crate::error::{Error, GroundError, Result, finite};

/// How close to a whole number of spacings a position counts as that node, so that rounding puts no sample of the map's
/// own grid outside the map or into a neighbouring hole.
const SNAP: f64 = 1e-8;

/// Heights at the nodes of a grid in the vehicle frame, metres: node (i, j) lies at
/// `(origin.0 + i spacing.0, origin.1 + j spacing.1)`.
///
/// Between the nodes the road is bilinear; outside the map, and next to a node whose height is NaN, it is unknown.
#[derive(Debug, Clone)]
pub struct HeightMap {
    heights: Vec<f64>,
    rows: usize,
    columns: usize,
    origin: (f64, f64),
    spacing: (f64, f64),
    /// Lowest and highest of the known heights.
    range: (f64, f64),
    peaks: Peaks,
}

/// Where a position lies between the nodes of one axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Between {
    /// The node before; there is one after it.
    pub(super) node: usize,
    /// From 0 to 1, both included.
    pub(super) fraction: f64,
}

impl HeightMap {
    /// A map from its heights, row by row: `heights[i * columns + j]` is that of node (i, j). A spacing may be negative:
    /// a map in the order of a `BevGrid` begins far left. NaN is a height that is not known.
    ///
    /// # Errors
    /// [`GroundError::HeightMap`] where there are fewer than two nodes along an axis, another number of heights than
    /// nodes, no known height, or a spacing of zero; [`GroundError::NoData`] for a number that stands for "no data" in
    /// elevation files; [`Error::NotFinite`], [`Error::OutOfMemory`].
    pub fn new(heights: Vec<f64>, columns: usize, origin: (f64, f64), spacing: (f64, f64)) -> Result<Self> {
        let rows = heights.len().checked_div(columns).unwrap_or(0);
        if rows < 2 || columns < 2 || rows * columns != heights.len() {
            let got = format!("{} heights in rows of {columns}", heights.len());
            return Err(Error::Ground(GroundError::HeightMap { expected: "at least 2 x 2 nodes", got }));
        }
        for value in [origin.0, origin.1] {
            finite("origin", value)?;
        }
        for value in [spacing.0, spacing.1] {
            finite("spacing", value)?;
        }
        let last = (origin.0 + spacing.0 * (rows - 1) as f64, origin.1 + spacing.1 * (columns - 1) as f64);
        let apart = |origin: f64, spacing: f64, last: f64| {
            spacing != 0.0 && last.is_finite() && origin + spacing != origin && last - spacing != last
        };
        if !apart(origin.0, spacing.0, last.0) || !apart(origin.1, spacing.1, last.1) {
            let got = format!("origin {origin:?} and spacing {spacing:?}");
            return Err(Error::Ground(GroundError::HeightMap {
                expected: "a spacing in metres that is not 0 and tells nodes apart",
                got,
            }));
        }
        super::nodata::refuse(&heights, columns)?;
        let known = heights.iter().filter(|height| !height.is_nan());
        let range = known.fold((f64::INFINITY, f64::NEG_INFINITY), |range, &z| (range.0.min(z), range.1.max(z)));
        if range.0 > range.1 {
            return Err(Error::Ground(GroundError::HeightMap {
                expected: "at least one known height",
                got: "NaN alone".to_owned(),
            }));
        }
        let peaks = Peaks::new(&heights, columns, spacing)?;
        Ok(Self { heights, rows, columns, origin, spacing, range, peaks })
    }

    /// The heights, row by row.
    pub fn heights(&self) -> &[f64] {
        &self.heights
    }

    /// Nodes along x.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Nodes along y.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// (x, y) of node (0, 0), metres.
    pub fn origin(&self) -> (f64, f64) {
        self.origin
    }

    /// Metres from one node to the next (along x, along y).
    pub fn spacing(&self) -> (f64, f64) {
        self.spacing
    }

    /// Lowest and highest known height.
    pub(super) fn range(&self) -> (f64, f64) {
        self.range
    }

    /// How high and how steep it gets.
    pub(super) fn peaks(&self) -> &Peaks {
        &self.peaks
    }

    /// z of the road at (x, y); NaN where it is unknown.
    pub fn height_at(&self, x: f64, y: f64) -> f64 {
        match (self.between_rows(x), self.between_columns(y)) {
            (Some(row), Some(column)) => {
                let [near, far] = [self.row(row.node), self.row(row.node + 1)];
                blend(along(near, column), along(far, column), row.fraction)
            }
            _ => f64::NAN,
        }
    }

    /// z of the road below or above `eye`. Where it is unknown, that of the nearest known node or of the road's tangent
    /// plane there, whichever `eye` lies in, or else the lower.
    pub(super) fn nearest_height(&self, eye: &Vector3<f64>) -> f64 {
        let here = self.height_at(eye.x, eye.y);
        if !here.is_nan() {
            return here;
        }
        let [x, y, height] = self.nearest_node(eye.x, eye.y);
        let tangent = eye.z - self.above_tangent(eye, x, y);
        let either = [height, tangent].into_iter().find(|&road| is_edge_on(eye.z - road));
        either.unwrap_or(height.min(tangent)) // a tangent plane beside a hole is not known, and NaN
    }

    /// (x, y, z) of the known node nearest to a place.
    fn nearest_node(&self, x: f64, y: f64) -> [f64; 3] {
        let node = |k: usize| {
            let (i, j) = ((k / self.columns) as f64, (k % self.columns) as f64);
            [self.origin.0 + i * self.spacing.0, self.origin.1 + j * self.spacing.1, self.heights[k]]
        };
        let away = |node: &[f64; 3]| (node[0] - x).hypot(node[1] - y);
        let known = (0..self.heights.len()).map(node).filter(|node| !node[2].is_nan());
        known.min_by(|a, b| away(a).total_cmp(&away(b))).expect("a map has a known height")
    }

    /// How high `eye` is above the road's tangent plane at (x, y); NaN where the road is unknown.
    pub(super) fn above_tangent(&self, eye: &Vector3<f64>, x: f64, y: f64) -> f64 {
        let (Some(row), Some(column)) = (self.between_rows(x), self.between_columns(y)) else { return f64::NAN };
        let [near, far] = [self.row(row.node), self.row(row.node + 1)];
        let [a, b, c, d] = [near[column.node], near[column.node + 1], far[column.node], far[column.node + 1]];
        let (along_x, along_y) = (blend(c - a, d - b, column.fraction), blend(b - a, d - c, row.fraction));
        let height = blend(blend(a, b, column.fraction), blend(c, d, column.fraction), row.fraction);
        eye.z - height - along_x / self.spacing.0 * (eye.x - x) - along_y / self.spacing.1 * (eye.y - y)
    }

    /// The heights of a row of nodes.
    #[inline]
    pub(super) fn row(&self, row: usize) -> &[f64] {
        &self.heights[row * self.columns..(row + 1) * self.columns]
    }

    /// Where x lies between the rows; `None` outside.
    pub(super) fn between_rows(&self, x: f64) -> Option<Between> {
        between((x - self.origin.0) / self.spacing.0, self.rows)
    }

    /// Where y lies between the columns; `None` outside.
    pub(super) fn between_columns(&self, y: f64) -> Option<Between> {
        between((y - self.origin.1) / self.spacing.1, self.columns)
    }
}

/// NaN is equal to NaN here: both say that the height is not known.
impl PartialEq for HeightMap {
    fn eq(&self, other: &Self) -> bool {
        self.rows == other.rows
            && self.columns == other.columns
            && self.origin == other.origin
            && self.spacing == other.spacing
            && self.heights.iter().zip(&other.heights).all(|(a, b)| a == b || (a.is_nan() && b.is_nan()))
    }
}

/// Where a position in spacings lies between `nodes` nodes.
fn between(position: f64, nodes: usize) -> Option<Between> {
    let nearest = position.round();
    let position = if (position - nearest).abs() <= SNAP { nearest } else { position };
    if !(position >= 0.0 && position <= (nodes - 1) as f64) {
        return None; // NaN too
    }
    let node = (position as usize).min(nodes - 2);
    Some(Between { node, fraction: position - node as f64 })
}

/// The height of a row at a place between its nodes.
#[inline]
fn along(row: &[f64], column: Between) -> f64 {
    blend(row[column.node], row[column.node + 1], column.fraction)
}

/// `a` and `b` in shares of `1 - fraction` and `fraction`; one of no share may be unknown.
#[inline]
pub(super) fn blend(a: f64, b: f64, fraction: f64) -> f64 {
    let between = a + (b - a) * fraction;
    let known = if fraction == 0.0 { a } else { between };
    if fraction == 1.0 { b } else { known }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn twisted() -> HeightMap {
        HeightMap::new(vec![0.0, 1.0, 2.0, 5.0, 4.0, f64::NAN], 3, (10.0, -1.0), (2.0, 1.0)).unwrap()
    }

    #[test]
    fn bilinear_between_the_nodes_and_unknown_beyond() {
        let map = twisted();
        assert_eq!(map.height_at(10.0, -1.0), 0.0);
        assert_eq!(map.height_at(12.0, 0.0), 4.0);
        assert_eq!(map.height_at(11.0, -0.5), 2.5);
        assert_eq!(map.height_at(10.0, 1.0), 2.0, "on the border of a hole, at a known node");
        assert!((map.height_at(12.0 + 1e-9, 0.0) - 4.0).abs() < 1e-12, "within rounding of the border");
        for (x, y) in [(9.99, 0.0), (12.01, 0.0), (11.0, -1.01), (11.0, 1.01), (11.0, 0.5), (f64::NAN, 0.0)] {
            assert!(map.height_at(x, y).is_nan(), "{x} {y}");
        }
    }

    #[test]
    fn beside_the_map_the_nearest_known_node_counts() {
        let map = twisted();
        assert_eq!(map.nearest_height(&Vector3::new(11.0, -0.5, 9.0)), 2.5, "on the map its own height");
        assert_eq!(map.nearest_node(0.0, -3.0), [10.0, -1.0, 0.0]);
        assert_eq!(map.nearest_node(30.0, 0.2), [12.0, 0.0, 4.0]);
        assert_eq!(map.nearest_height(&Vector3::new(30.0, 0.2, 9.0)), 4.0, "beside a hole no plane is known");
        // z = 0.1 (x - 10): below the first node, and in the plane
        let slope = HeightMap::new(vec![0.0, 0.0, 0.2, 0.2], 2, (10.0, -1.0), (2.0, 1.0)).unwrap();
        assert!((slope.nearest_height(&Vector3::new(4.0, 0.0, 1.4)) + 0.6).abs() < 1e-14);
        assert!((slope.nearest_height(&Vector3::new(4.0, 0.0, -0.6)) + 0.6).abs() < 1e-14);
        assert_eq!(slope.nearest_height(&Vector3::new(15.0, 0.0, 1.4)), 0.2);
    }

    #[test]
    fn an_eye_above_the_tangent_plane() {
        let map = HeightMap::new(vec![0.0, 0.1, 0.2, 0.3], 2, (10.0, -1.0), (2.0, 1.0)).unwrap();
        // the plane z = 0.1 (x - 10) + 0.1 (y + 1)
        for (eye, above) in [([0.0, 0.0, -0.9], 0.0), ([0.0, 0.0, 0.6], 1.5), ([20.0, 0.0, 0.6], -0.5)] {
            let found = map.above_tangent(&eye.into(), 11.3, -0.4);
            assert!((found - above).abs() < 1e-14, "{eye:?} {found}");
        }
        assert!(map.above_tangent(&Vector3::zeros(), 9.0, 0.0).is_nan());
    }

    #[test]
    fn a_negative_spacing_counts_the_other_way() {
        let reversed: Vec<f64> = twisted().heights.iter().rev().copied().collect();
        let map = HeightMap::new(reversed, 3, (12.0, 1.0), (-2.0, -1.0)).unwrap();
        for (x, y) in [(10.0, -1.0), (11.3, -0.2), (10.7, -0.9), (12.0, 0.0)] {
            assert!((map.height_at(x, y) - twisted().height_at(x, y)).abs() < 1e-15);
        }
        assert_ne!(map, twisted());
        assert_eq!(twisted(), twisted());
    }

    #[test]
    fn refuses_what_is_no_map() {
        let new = |heights: &[f64], columns, spacing| HeightMap::new(heights.to_vec(), columns, (0.0, 0.0), spacing);
        assert!(new(&[0.0; 4], 2, (1.0, 1.0)).is_ok());
        for (heights, columns, spacing) in [
            (&[0.0; 4][..], 4, (1.0, 1.0)),
            (&[0.0; 4], 1, (1.0, 1.0)),
            (&[0.0; 5], 2, (1.0, 1.0)),
            (&[], 0, (1.0, 1.0)),
            (&[0.0; 4], 2, (0.0, 1.0)),
            (&[0.0; 4], 2, (1.0, f64::MAX * 2.0)),
            (&[f64::NAN; 4], 2, (1.0, 1.0)),
            (&[f64::INFINITY, 0.0, 0.0, 0.0], 2, (1.0, 1.0)),
        ] {
            assert!(new(heights, columns, spacing).is_err(), "{heights:?} {columns} {spacing:?}");
        }
    }
}
