//! Normal equations of Tukey's loss.

use super::{CUT, weight};

/// Half the sum of Tukey's losses, its gradient, and the Gauss-Newton matrix.
#[derive(Debug, Clone, PartialEq)]
pub struct Normal {
    /// The loss: half a square where little is off, `CUT^2 / 6` variances at most.
    pub cost: f64,
    /// Of each parameter.
    pub gradient: Vec<f64>,
    /// Row after row, symmetric.
    pub hessian: Vec<f64>,
}

impl Normal {
    /// Of residuals whose standard deviation is `spread`, and their derivatives, row after row.
    ///
    /// # Panics
    /// Where the lengths do not fit.
    pub fn of(off: &[f64], slopes: &[f64], columns: usize, spread: f64) -> Self {
        assert_eq!(slopes.len(), off.len() * columns);
        let mut found = Self { cost: 0.0, gradient: vec![0.0; columns], hessian: vec![0.0; columns * columns] };
        let mut weighted = vec![0.0; columns];
        for (place, &off) in off.iter().enumerate() {
            let share = off / (CUT * spread);
            let rest = 1.0 - (share * share).min(1.0);
            found.cost += 1.0 - rest * rest * rest;
            let weight = weight(off, spread);
            let row = &slopes[place * columns..][..columns];
            weighted.iter_mut().zip(row).for_each(|(weighted, slope)| *weighted = weight * slope);
            for (column, &a) in weighted.iter().enumerate() {
                found.gradient[column] += a * off;
                let upper = &mut found.hessian[column * columns..][column..columns];
                upper.iter_mut().zip(&row[column..]).for_each(|(sum, slope)| *sum += a * slope);
            }
        }
        for row in 1..columns {
            for column in 0..row {
                found.hessian[row * columns + column] = found.hessian[column * columns + row];
            }
        }
        found.cost *= CUT * CUT / 6.0 * spread * spread;
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gradient_is_that_of_the_cost() {
        let off: Vec<f64> =
            (0..50).map(|k| 4.0 * (0.9 * f64::from(k)).sin() + if k == 7 { 90.0 } else { 0.0 }).collect();
        let slopes: Vec<f64> = (0..100).map(|k| (0.37 * f64::from(k)).cos()).collect();
        let at = |step: [f64; 2]| {
            let moved: Vec<f64> = off
                .iter()
                .zip(slopes.chunks_exact(2))
                .map(|(off, row)| off + row[0] * step[0] + row[1] * step[1])
                .collect();
            Normal::of(&moved, &slopes, 2, 1.5)
        };
        let found = at([0.0, 0.0]);
        for (column, step) in [[1e-5, 0.0], [0.0, 1e-5]].into_iter().enumerate() {
            let expected = (at(step).cost - at(step.map(|each| -each)).cost) / 2e-5;
            assert!((found.gradient[column] - expected).abs() < 1e-6 * (1.0 + expected.abs()));
        }
        assert_eq!(found.hessian[1], found.hessian[2]);
        let squares: f64 =
            off.iter().zip(slopes.chunks_exact(2)).map(|(&off, row)| weight(off, 1.5) * row[1] * row[1]).sum();
        assert!((found.hessian[3] - squares).abs() < 1e-12);
        let far = Normal::of(&[1e6], &[1.0], 1, 2.0);
        assert_eq!((far.cost, far.gradient[0]), (CUT * CUT / 6.0 * 4.0, 0.0));
    }
}
