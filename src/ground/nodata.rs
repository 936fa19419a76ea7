//! Numbers that elevation files have where they know no height.

use crate::error::{Error, GroundError, Result};

/// Metres beyond which no height is one: far above and below every road, and below GDAL's -3.4e38, 1e20 and the like.
pub(super) const HIGHEST: f64 = 1e5;

/// What files of whole numbers and of text have for "no data", within [`HIGHEST`].
const SENTINELS: [f64; 12] =
    [-32768.0, -32767.0, 32767.0, -9999.0, 9999.0, -99999.0, 99999.0, 65535.0, -999.0, 999.0, -9999.9, -999.9];

/// A sentinel is taken for a height where another height is as near as this part of its size: a real road comes up to
/// it, where "no data" stands alone.
const NEAR: f64 = 0.25;

/// Refuses heights (rows of `columns`) that stand for "no data" and would be taken for a road; NaN is none of them.
///
/// # Errors
/// [`GroundError::NoData`].
pub(super) fn refuse(heights: &[f64], columns: usize) -> Result<()> {
    let beyond = |height: &f64| height.abs() > HIGHEST;
    if let Some(first) = heights.iter().position(beyond) {
        let count = heights.iter().filter(|height| beyond(height)).count();
        return Err(error(heights[first], first, columns, count));
    }
    for sentinel in SENTINELS {
        let Some(first) = heights.iter().position(|&height| height == sentinel) else { continue };
        let alone = |&height: &f64| {
            height.is_nan() || SENTINELS.contains(&height) || (height - sentinel).abs() > NEAR * sentinel.abs()
        };
        if heights.iter().all(alone) {
            let count = heights.iter().filter(|&&height| height == sentinel).count();
            return Err(error(sentinel, first, columns, count));
        }
    }
    Ok(())
}

fn error(got: f64, first: usize, columns: usize, count: usize) -> Error {
    Error::Ground(GroundError::NoData { got, row: first / columns, column: first % columns, count })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with(value: f64, rest: f64) -> Result<()> {
        let mut heights = vec![rest; 12];
        heights[7] = value;
        heights[2] = f64::NAN;
        refuse(&heights, 4)
    }

    #[test]
    fn what_stands_for_no_data_is_told_from_heights() {
        for value in [f64::from(f32::MIN), 1e20, -1e6, f64::INFINITY, -32768.0, -9999.0, 9999.0, 32767.0, -999.0] {
            match with(value, -0.4) {
                Err(Error::Ground(GroundError::NoData { got, row: 1, column: 3, count: 1 })) => assert_eq!(got, value),
                other => panic!("{value}: {other:?}"),
            }
        }
        for value in [0.0, 8848.9, -427.0, 998.0, -9998.0, 1e5] {
            assert_eq!(with(value, -0.4), Ok(()), "{value}");
        }
        // a mountain road through a height that is also a sentinel
        assert_eq!(with(999.0, 1003.5), Ok(()));
        assert!(with(-32768.0, 1003.5).is_err());
        // two sentinels in one file, and nothing but sentinels
        assert!(refuse(&[-9999.0, -999.0, 0.1, 0.2], 2).is_err());
        assert!(refuse(&[-9999.0; 4], 2).is_err());
        assert!(refuse(&[f64::NAN; 4], 2).is_ok());
    }
}
