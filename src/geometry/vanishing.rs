//! Where lines that are parallel on the road meet in the image.

use nalgebra::{Matrix2, Vector2};

use crate::error::{Error, PointsError, Result, finite};

/// The pixel where lines meet: of two, their intersection; of more, the point with the least sum of squared distances
/// from them. Each line is given by two of its points, the more apart the better.
///
/// # Errors
/// [`PointsError::Unfit`] where there are fewer than two lines, two ends of one coincide, or all are parallel;
/// [`Error::NotFinite`].
pub fn vanishing_point(lines: &[[[f64; 2]; 2]]) -> Result<[f64; 2]> {
    const WHAT: &str = "lines";
    for &value in lines.iter().flatten().flatten() {
        finite(WHAT, value)?;
    }
    if lines.len() < 2 {
        return Err(Error::Points(PointsError::Unfit {
            what: WHAT,
            expected: "at least two",
            got: lines.len().to_string(),
        }));
    }
    // about their middle, so that no digits are lost to a distant origin
    let count = (2 * lines.len()) as f64;
    let middle = lines.iter().flatten().fold(Vector2::zeros(), |sum, &point| sum + Vector2::from(point) / count);
    let (mut normal, mut right) = (Matrix2::zeros(), Vector2::zeros());
    for (index, &[start, end]) in lines.iter().enumerate() {
        let (start, end) = (Vector2::from(start) - middle, Vector2::from(end) - middle);
        let along = end - start;
        let across = Vector2::new(-along.y, along.x) / along.norm();
        if !across.x.is_finite() {
            let got = format!("line {index} with both points in one place");
            return Err(Error::Points(PointsError::Unfit {
                what: WHAT,
                expected: "two different points for each",
                got,
            }));
        }
        normal += across * across.transpose();
        right += across * across.dot(&start);
    }
    // the determinant is the sum of the squared sines between the lines
    let determinant = normal.determinant();
    if determinant.is_nan() || determinant <= 1e-12 {
        let got = format!("{} that are parallel", lines.len());
        return Err(Error::Points(PointsError::Unfit { what: WHAT, expected: "lines that meet", got }));
    }
    let adjugate = Matrix2::new(normal.m22, -normal.m12, -normal.m21, normal.m11);
    let point = adjugate * right / determinant + middle;
    Ok([finite(WHAT, point.x)?, finite(WHAT, point.y)?])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_lines_meet_and_more_meet_nearly() {
        let through = |x: f64, y: f64| [[x, y], [x + 0.4 * (700.0 - x), y + 0.4 * (320.0 - y)]];
        let lines = [through(100.0, 900.0), through(1400.0, 850.0), through(650.0, 1000.0)];
        for lines in [&lines[..2], &lines] {
            let [u, v] = vanishing_point(lines).unwrap();
            assert!((u - 700.0).abs() < 1e-9 && (v - 320.0).abs() < 1e-9, "{u} {v}");
        }
        let mut bent = lines;
        bent[2][1][0] += 2.0;
        let [u, v] = vanishing_point(&bent).unwrap();
        assert!((u - 700.0).hypot(v - 320.0) < 10.0 && (u - 700.0).hypot(v - 320.0) > 0.1);
    }

    #[test]
    fn refuses_lines_that_do_not_meet() {
        assert!(vanishing_point(&[[[0.0, 0.0], [1.0, 1.0]]]).is_err());
        assert!(vanishing_point(&[[[0.0, 0.0], [1.0, 1.0]], [[5.0, 0.0], [6.0, 1.0]]]).is_err());
        assert!(vanishing_point(&[[[0.0, 0.0], [1.0, 1.0]], [[5.0, 0.0], [5.0, 0.0]]]).is_err());
        assert!(vanishing_point(&[[[0.0, f64::NAN], [1.0, 1.0]], [[5.0, 0.0], [6.0, 0.0]]]).is_err());
    }
}
