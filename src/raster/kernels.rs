//! The loop that finds each point's cell: plain Rust without branches, of which the compiler makes vectors for each
//! instruction set (decision 0005). All operations are float64 and correctly rounded, nothing is fused, so all
//! instruction sets give the same cells.

use super::WHAT;
use crate::error::Result;
use crate::grid::BevGrid;
use crate::isa::{Body, Isa, run};
use crate::view::PointSample;
use crate::view::buffer;

/// Key of a point that has no cell.
pub(super) const NOWHERE: u32 = u32::MAX;

/// Whole numbers below 2^52 plus this hold the number in their low bits.
const TO_BITS: f64 = (1u64 << 52) as f64;

/// What is needed of a grid to find cells.
#[derive(Debug, Clone)]
pub(super) struct Finder {
    x: (f64, f64),
    y: (f64, f64),
    resolution: (f64, f64),
    rows: f64,
    columns: f64,
    /// Lower ends of height slices and the upper end of the last, if there are slices.
    edges: Vec<f64>,
}

impl Finder {
    pub(super) fn new(grid: &BevGrid, edges: &[f64]) -> Result<Self> {
        let (rows, columns) = (grid.rows() as f64, grid.columns() as f64);
        let edges = buffer::copied(WHAT, edges)?;
        Ok(Self { x: grid.x(), y: grid.y(), resolution: grid.resolution(), rows, columns, edges })
    }

    /// Writes the key of every point, and returns how many have a cell, and how many are not finite.
    ///
    /// The key of row r and column c is `r * columns + c`, plus `s * rows * columns` in slice s.
    pub(super) fn keys(&self, isa: Isa, points: [&[f64]; 3], keys: &mut [u32]) -> (usize, usize) {
        run(isa, Keys { finder: self, points, keys })
    }

    #[inline(always)]
    fn body(&self, [x, y, z]: [&[f64]; 3], keys: &mut [u32]) -> (usize, usize) {
        let count = keys.len();
        let (x, y, z) = (&x[..count], &y[..count], &z[..count]);
        let (mut found, mut not_finite) = (0u64, 0u64);
        for i in 0..count {
            let row = (self.x.1 - x[i]) / self.resolution.0;
            let column = (self.y.1 - y[i]) / self.resolution.1;
            // 0 for finite numbers, NaN for others
            let finite = x[i] * 0.0 + y[i] * 0.0 + z[i] * 0.0 == 0.0;
            let inside = (row >= 0.0)
                & (row < self.rows)
                & (column >= 0.0)
                & (column < self.columns)
                & (x[i] > self.x.0)
                & (y[i] > self.y.0)
                & finite;
            let cell = floor(row) * self.columns + floor(column);
            let key = (cell + TO_BITS).to_bits() as u32;
            keys[i] = if inside { key } else { NOWHERE };
            found += u64::from(inside);
            not_finite += u64::from(!finite);
        }
        if self.edges.len() > 1 {
            found = self.slices(z, keys);
        }
        (found as usize, not_finite as usize)
    }

    /// Moves the keys to the slices of their heights, and returns how many are left.
    #[inline(always)]
    fn slices(&self, z: &[f64], keys: &mut [u32]) -> u64 {
        let cells = self.rows * self.columns;
        let mut found = 0;
        for (key, &z) in keys.iter_mut().zip(z) {
            // how many edges are at or below; NaN has none
            let mut reached = 0.0;
            for &edge in &self.edges {
                reached += if z >= edge { 1.0 } else { 0.0 };
            }
            let inside = (reached >= 1.0) & (reached < self.edges.len() as f64) & (*key != NOWHERE);
            let shift = ((reached - 1.0) * cells + TO_BITS).to_bits() as u32;
            *key = if inside { key.wrapping_add(shift) } else { NOWHERE };
            found += u64::from(inside);
        }
        found
    }
}

/// [`Finder::keys`] as a loop.
struct Keys<'a> {
    finder: &'a Finder,
    points: [&'a [f64]; 3],
    keys: &'a mut [u32],
}

impl Body for Keys<'_> {
    type Output = (usize, usize);

    #[inline(always)]
    fn run(self) -> Self::Output {
        self.finder.body(self.points, self.keys)
    }
}

/// Coordinates out of rows that begin with x, y and z.
pub(super) struct Unpack<'a, P, const K: usize> {
    pub(super) rows: &'a [[P; K]],
    pub(super) xyz: [&'a mut [f64]; 3],
}

impl<P: PointSample, const K: usize> Body for Unpack<'_, P, K> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let [x, y, z] = self.xyz;
        let count = self.rows.len();
        let (x, y, z) = (&mut x[..count], &mut y[..count], &mut z[..count]);
        for i in 0..count {
            let row = self.rows[i];
            (x[i], y[i], z[i]) = (row[0].to_f64(), row[1].to_f64(), row[2].to_f64());
        }
    }
}

/// The largest whole number that is not above, of numbers in 0..2^51; others give anything.
#[inline(always)]
fn floor(value: f64) -> f64 {
    let nearest = (value + TO_BITS) - TO_BITS;
    nearest - if nearest > value { 1.0 } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::SampleAt;

    fn plain(grid: &BevGrid, edges: &[f64], [x, y, z]: [f64; 3]) -> u32 {
        let row = ((grid.x().1 - x) / grid.resolution().0).floor();
        let column = ((grid.y().1 - y) / grid.resolution().1).floor();
        let (rows, columns) = (grid.rows() as f64, grid.columns() as f64);
        let on_grid = (0.0..rows).contains(&row) && (0.0..columns).contains(&column);
        if !on_grid || x <= grid.x().0 || y <= grid.y().0 || !z.is_finite() {
            return NOWHERE;
        }
        let slice = match edges {
            [] => 0,
            _ => match edges.windows(2).position(|edge| edge[0] <= z && z < edge[1]) {
                Some(slice) => slice,
                None => return NOWHERE,
            },
        };
        slice as u32 * (rows * columns) as u32 + (row * columns + column) as u32
    }

    fn check(grid: &BevGrid, edges: &[f64], points: &[[f64; 3]]) {
        let column = |k: usize| points.iter().map(|point| point[k]).collect::<Vec<_>>();
        let (x, y, z) = (column(0), column(1), column(2));
        for &isa in Isa::available() {
            let mut keys = vec![7; points.len()];
            let (found, bad) = Finder::new(grid, edges).unwrap().keys(isa, [&x, &y, &z], &mut keys);
            assert_eq!(bad, points.iter().filter(|p| !p.iter().all(|v| v.is_finite())).count());
            assert_eq!(found, keys.iter().filter(|&&key| key != NOWHERE).count());
            for (point, key) in points.iter().zip(keys) {
                assert_eq!(key, plain(grid, edges, *point), "{isa:?} {point:?}");
            }
        }
    }

    #[test]
    fn edges_and_oddities() {
        // 0.3 / 0.1 is below 3: the near edge is out all the same
        for range in [(0.0, 0.3), (-0.2, 0.1), (7.0, 50.0), (-10.0, 10.0)] {
            let grid = BevGrid::new(range, range, (0.1, 0.1), SampleAt::Center).unwrap();
            let mut ends = vec![range.0, range.1, range.0.next_up(), range.1.next_up(), range.1.next_down()];
            ends.extend([f64::NAN, f64::INFINITY, -f64::INFINITY, f64::MAX, f64::MIN, 0.0, -0.0, 5e-324]);
            ends.extend((0..=grid.rows()).map(|i| range.1 - i as f64 * 0.1));
            let mut points = Vec::new();
            for &x in &ends {
                for &y in ends.iter().step_by(3) {
                    points.extend([[x, y, 0.0], [y, x, 1.0], [x, y, f64::NAN], [x, x, -0.5]]);
                }
            }
            check(&grid, &[], &points);
            check(&grid, &[-0.5, 0.0, 1.0], &points);
        }
    }

    proptest! {
        #[test]
        fn all_instruction_sets_as_the_definition(
            points in prop::collection::vec(prop::array::uniform3(-30f64..60.0), 1..200),
            cell in 0.01f64..2.0,
            (rows, columns) in (1u32..300, 1u32..300),
        ) {
            let (x, y) = (f64::from(rows) * cell, f64::from(columns) * cell);
            let Ok(grid) = BevGrid::new((1.0, 1.0 + x), (-3.0, -3.0 + y), (cell, cell), SampleAt::Corner) else {
                return Ok(());
            };
            check(&grid, &[], &points);
            check(&grid, &[-20.0, 0.0, 0.5, 33.0], &points);
        }
    }
}
