//! Heights of a map along the rows of a grid.

use super::HeightMap;
use super::height_map::{Between, blend};
use crate::error::Result;
use crate::view::buffer;

/// A height map looked up at one set of y, row after row of x: what is the same for all rows is worked out once.
pub(crate) struct HeightRows<'a> {
    map: &'a HeightMap,
    /// For each y, where it lies between the map's columns.
    columns: Vec<Option<Between>>,
}

impl<'a> HeightRows<'a> {
    pub(crate) fn new(map: &'a HeightMap, ys: &[f64]) -> Result<Self> {
        let columns = buffer::collected("Lut", ys.iter().map(|&y| map.between_columns(y)))?;
        Ok(Self { map, columns })
    }

    /// Writes z of the road at (x, y) for each y; NaN where it is unknown. `scratch` is any vector.
    pub(crate) fn fill(&self, x: f64, zs: &mut [f64], scratch: &mut Vec<f64>) -> Result<()> {
        let Some(row) = self.map.between_rows(x) else {
            zs.fill(f64::NAN);
            return Ok(());
        };
        // the profile at x, at the map's own columns
        let (near, far) = (self.map.row(row.node), self.map.row(row.node + 1));
        scratch.clear();
        buffer::room_for("Lut", scratch, near.len())?;
        scratch.extend(near.iter().zip(far).map(|(&near, &far)| blend(near, far, row.fraction)));
        for (z, column) in zs.iter_mut().zip(&self.columns) {
            *z = column.map_or(f64::NAN, |c| blend(scratch[c.node], scratch[c.node + 1], c.fraction));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_the_heights_one_by_one() {
        let heights = (0..35).map(|i| if i == 17 { f64::NAN } else { f64::from(i * i % 11) }).collect();
        let map = HeightMap::new(heights, 5, (3.0, 2.0), (0.7, -0.9)).unwrap();
        let ys: Vec<f64> = (0..60).map(|i| 2.3 - f64::from(i) * 0.07).chain([2.0, 2.0 - 0.9 * 4.0]).collect();
        let rows = HeightRows::new(&map, &ys).unwrap();
        let (mut zs, mut scratch) = (vec![0.0; ys.len()], Vec::new());
        let mut known = 0;
        for x in (0..50).map(|i| 2.5 + f64::from(i) * 0.1).chain([3.0, 3.0 + 0.7 * 6.0]) {
            rows.fill(x, &mut zs, &mut scratch).unwrap();
            for (&y, &z) in ys.iter().zip(&zs) {
                let expected = map.height_at(x, y);
                assert!((z - expected).abs() < 1e-14 || (z.is_nan() && expected.is_nan()), "{x} {y} {z} {expected}");
                known += usize::from(!z.is_nan());
            }
        }
        assert!(known > 1000);
    }
}
