//! How high and how steep a height map gets, so that rays leap over what lies below them.

use crate::error::Result;
use crate::parallel::check_interrupt;
use crate::view::buffer;

/// The highest road in blocks of 2 x 2 patches, 4 x 4, 8 x 8, ... up to the whole map (a maximum mipmap: Tevs, Ihrke and
/// Seidel 2008).
#[derive(Debug, Clone)]
pub(super) struct Peaks {
    /// Level l at index l - 1: blocks of 2^l x 2^l patches, row by row.
    levels: Vec<Level>,
    /// Largest slope between any two points, in any direction; infinite where the map has holes.
    pub(super) steepest: f64,
}

#[derive(Debug, Clone)]
struct Level {
    columns: usize,
    highest: Vec<f64>,
}

impl Peaks {
    /// Of heights with `columns` nodes to a row.
    pub(super) fn new(heights: &[f64], columns: usize, spacing: (f64, f64)) -> Result<Self> {
        let rows = heights.len() / columns;
        let node = |i: usize, j: usize| heights[i.min(rows - 1) * columns + j.min(columns - 1)];
        // the nodes of 2 x 2 patches are 3 x 3; NaN is less than any height
        let first = level((rows - 1).div_ceil(2), (columns - 1).div_ceil(2), 3, |i, j| (2 * i, 2 * j), node)?;
        let mut levels = vec![first];
        while let Some(last) = levels.last().filter(|last| last.highest.len() > 1) {
            let (below, below_columns) = (&last.highest, last.columns);
            let below_rows = below.len() / below_columns;
            let block = |i: usize, j: usize| below[i.min(below_rows - 1) * below_columns + j.min(below_columns - 1)];
            let next = level(below_rows.div_ceil(2), below_columns.div_ceil(2), 2, |i, j| (2 * i, 2 * j), block)?;
            levels.push(next);
        }
        Ok(Self { levels, steepest: steepest(heights, columns, spacing) })
    }

    /// The largest level.
    pub(super) fn top(&self) -> u32 {
        self.levels.len() as u32
    }

    /// The highest known road in the block of 2^level patches squared that patch (i, j) is in; negative infinity where
    /// all of it is unknown. `level` is from 1 to `top`.
    #[inline]
    pub(super) fn highest(&self, level: u32, i: usize, j: usize) -> f64 {
        let own = &self.levels[level as usize - 1];
        own.highest[(i >> level) * own.columns + (j >> level)]
    }
}

/// A level of blocks, each the highest of `side` x `side` values from `corner` on.
fn level(
    rows: usize,
    columns: usize,
    side: usize,
    corner: impl Fn(usize, usize) -> (usize, usize),
    value: impl Fn(usize, usize) -> f64,
) -> Result<Level> {
    let mut highest = buffer::reserved("heights", rows * columns)?;
    for row in 0..rows {
        check_interrupt()?;
        for column in 0..columns {
            let (i, j) = corner(row, column);
            let values = (0..side).flat_map(|down| (0..side).map(move |right| (i + down, j + right)));
            highest.push(values.map(|(i, j)| value(i, j)).fold(f64::NEG_INFINITY, f64::max));
        }
    }
    Ok(Level { columns, highest })
}

/// On a bilinear patch each partial slope lies between those of two of its edges, and the slope in any direction is at
/// most the length of the largest two.
fn steepest(heights: &[f64], columns: usize, (dx, dy): (f64, f64)) -> f64 {
    if heights.iter().any(|height| height.is_nan()) {
        return f64::INFINITY; // beyond a hole the road may go on at any height
    }
    let along_y = heights.chunks(columns).flat_map(|row| row.windows(2).map(|pair| (pair[1] - pair[0]).abs()));
    let along_x = heights.iter().zip(&heights[columns..]).map(|(near, far)| (far - near).abs());
    (along_x.fold(0.0, f64::max) / dx).hypot(along_y.fold(0.0, f64::max) / dy)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_hold_the_highest_of_their_patches() {
        let (rows, columns) = (11, 14);
        let heights: Vec<f64> =
            (0..rows * columns).map(|k| if k == 40 { f64::NAN } else { ((k * 7919) % 101) as f64 }).collect();
        let peaks = Peaks::new(&heights, columns, (1.0, 1.0)).unwrap();
        for level in 1..=peaks.top() {
            for i in 0..rows - 1 {
                for j in 0..columns - 1 {
                    let (i0, j0) = (i >> level << level, j >> level << level);
                    let (i1, j1) = ((i0 + (1 << level)).min(rows - 1), (j0 + (1 << level)).min(columns - 1));
                    let nodes = (i0..=i1).flat_map(|i| (j0..=j1).map(move |j| (i, j)));
                    let expected = nodes.map(|(i, j)| heights[i * columns + j]).fold(f64::NEG_INFINITY, f64::max);
                    assert!(peaks.highest(level, i, j) >= expected, "{level} {i} {j}");
                    assert!(level > 1 || peaks.highest(level, i, j) == expected);
                }
            }
        }
        assert_eq!(peaks.highest(peaks.top(), 0, 0), 100.0);
        assert_eq!(peaks.steepest, f64::INFINITY);
        let plane: Vec<f64> = (0..20).map(|k| 3.0 * f64::from(k / 5) * 0.5 - 4.0 * f64::from(k % 5) * 0.25).collect();
        assert!((Peaks::new(&plane, 5, (0.5, -0.25)).unwrap().steepest - 5.0).abs() < 1e-12);
    }
}
