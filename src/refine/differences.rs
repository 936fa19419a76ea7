//! How brightness differs between two views of the same road, whatever the light.

use super::{SPREAD_OF_MEDIAN, median, weight};

/// Derivatives of brightness by some parameters, place after place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slopes<'a> {
    /// Row after row.
    pub values: &'a [f64],
    /// How many parameters there are.
    pub columns: usize,
}

/// How the brightness of places in one view differs from that in another.
#[derive(Debug, Clone, PartialEq)]
pub struct Differences {
    /// Of the places that both views show.
    pub off: Vec<f64>,
    /// The derivatives of `off`, row after row; empty without any.
    pub slopes: Vec<f64>,
    /// For each place whether both views show it, and its derivatives are finite.
    pub shown: Vec<bool>,
}

impl Differences {
    /// How `values` differ from what is `there` when the gain and the offset of the latter fit best.
    ///
    /// They are fitted to what Tukey's weights leave, from a gain of one and the median offset on: what moves is no light.
    /// The gain stays between a half and two: else a place without contrast would fit everything. Without a `spread`,
    /// the standard deviation of what is off, that of the better half is taken.
    ///
    /// # Panics
    /// Where the lengths do not fit.
    pub fn new(values: &[f64], there: &[f64], slopes: Option<Slopes<'_>>, spread: Option<f64>) -> Self {
        assert_eq!(values.len(), there.len());
        let mut light = Light::of(values, there, slopes);
        light.fit(spread);
        Self { off: light.off, slopes: light.slopes, shown: light.shown }
    }
}

/// What both views show, and what the light makes of it.
struct Light {
    shown: Vec<bool>,
    values: Vec<f64>,
    there: Vec<f64>,
    slopes: Vec<f64>,
    columns: usize,
    off: Vec<f64>,
}

impl Light {
    fn of(values: &[f64], there: &[f64], slopes: Option<Slopes<'_>>) -> Self {
        let columns = slopes.map_or(0, |slopes| slopes.columns);
        let row = |place: usize| slopes.map_or(&[][..], |slopes| &slopes.values[place * columns..][..columns]);
        assert!(slopes.is_none_or(|slopes| slopes.values.len() == values.len() * columns));
        let is_shown = |(place, (value, there)): (usize, (&f64, &f64))| {
            value.is_finite() && there.is_finite() && row(place).iter().all(|slope| slope.is_finite())
        };
        let shown: Vec<bool> = values.iter().zip(there).enumerate().map(is_shown).collect();
        let places = || shown.iter().enumerate().filter_map(|(place, &shown)| shown.then_some(place));
        let (values, there) = (places().map(|k| values[k]).collect::<Vec<_>>(), places().map(|k| there[k]).collect());
        let slopes = places().flat_map(|place| row(place).iter().copied()).collect();
        let off = Vec::with_capacity(values.len());
        Self { shown, values, there, slopes, columns, off }
    }

    fn fit(&mut self, spread: Option<f64>) {
        self.off.extend(self.values.iter().zip(&self.there).map(|(value, there)| value - there));
        let mut some = self.off.clone();
        let middle = median(&mut some);
        self.off.iter_mut().for_each(|off| *off -= middle);
        for round in 0..2 {
            let spread = spread.unwrap_or_else(|| {
                some.iter_mut().zip(&self.off).for_each(|(some, off)| *some = off.abs());
                SPREAD_OF_MEDIAN * median(&mut some)
            });
            let weights: Vec<f64> =
                self.off.iter().map(|&off| if spread > 0.0 { weight(off, spread) } else { 0.0 }).collect();
            let total: f64 = weights.iter().sum();
            if total <= 0.0 || total.is_nan() {
                return;
            }
            let mean = |of: &[f64]| weights.iter().zip(of).map(|(weight, value)| weight * value).sum::<f64>() / total;
            let (bright, there) = (mean(&self.values), mean(&self.there));
            let weighted: Vec<f64> =
                weights.iter().zip(&self.there).map(|(weight, value)| weight * (value - there)).collect();
            let contrast: f64 = weighted.iter().zip(&self.there).map(|(a, value)| a * (value - there)).sum();
            let along: f64 = weighted.iter().zip(&self.values).map(|(a, value)| a * (value - bright)).sum();
            let gain = if contrast > 0.0 { along / contrast } else { 1.0 };
            let clipped = gain.clamp(0.5, 2.0);
            let pairs = self.values.iter().zip(&self.there);
            self.off.iter_mut().zip(pairs).for_each(|(off, (a, b))| *off = (a - bright) - clipped * (b - there));
            if round == 1 {
                let is_free = clipped == gain && contrast > 0.0;
                self.follow(&weights, total, there, is_free.then_some((&weighted, contrast)));
            }
        }
    }

    /// Takes out of the slopes what offset and gain follow of them.
    fn follow(&mut self, weights: &[f64], total: f64, there: f64, gain: Option<(&Vec<f64>, f64)>) {
        let columns = self.columns;
        if columns == 0 {
            return;
        }
        let sums = |factors: &[f64], slopes: &[f64]| {
            let mut sums = vec![0.0; columns];
            for (factor, row) in factors.iter().zip(slopes.chunks_exact(columns)) {
                sums.iter_mut().zip(row).for_each(|(sum, slope)| *sum += factor * slope);
            }
            sums
        };
        let means: Vec<f64> = sums(weights, &self.slopes).iter().map(|sum| sum / total).collect();
        for row in self.slopes.chunks_exact_mut(columns) {
            row.iter_mut().zip(&means).for_each(|(slope, mean)| *slope -= mean);
        }
        if let Some((weighted, contrast)) = gain {
            let gains: Vec<f64> = sums(weighted, &self.slopes).iter().map(|sum| sum / contrast).collect();
            for (row, value) in self.slopes.chunks_exact_mut(columns).zip(&self.there) {
                row.iter_mut().zip(&gains).for_each(|(slope, gain)| *slope -= (value - there) * gain);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A view of some contrast, and the same in other light, with what moves on every ninth place.
    fn views(gain: f64) -> (Vec<f64>, Vec<f64>) {
        let there: Vec<f64> = (0..300).map(|k| 100.0 + 30.0 * (0.7 * f64::from(k)).sin()).collect();
        let noise = |k: usize| (1.3 * k as f64).cos();
        let values = there.iter().enumerate().map(|(k, value)| match k % 9 {
            4 => 250.0,
            _ => gain * value + 12.0 + noise(k),
        });
        (values.collect(), there)
    }

    #[test]
    fn light_is_no_difference_and_what_moves_is_no_light() {
        let (values, there) = views(1.2);
        let found = Differences::new(&values, &there, None, None);
        assert_eq!(found.off.len(), 300);
        for (place, off) in found.off.iter().enumerate() {
            if place % 9 != 4 {
                assert!(off.abs() < 1.3, "{place}: {off}");
            }
        }
        let dark = Differences::new(&views(0.1).0, &there, None, None);
        assert!(dark.off.iter().any(|off| off.abs() > 8.0), "a gain of a tenth is none");
    }

    #[test]
    fn slopes_are_those_of_the_differences() {
        let (values, there) = views(1.2);
        let steep: Vec<f64> = (0..300).map(|k| (0.31 * f64::from(k)).cos() + 0.3).collect();
        let moved = |step: f64| -> Vec<f64> {
            let values: Vec<f64> = values.iter().zip(&steep).map(|(value, slope)| value + step * slope).collect();
            Differences::new(&values, &there, None, Some(2.0)).off
        };
        let slopes = Slopes { values: &steep, columns: 1 };
        let found = Differences::new(&values, &there, Some(slopes), Some(2.0));
        let (plus, minus) = (moved(1e-3), moved(-1e-3));
        // the weights move too, by little: what is off by their constant is held
        for place in 0..300 {
            let expected = (plus[place] - minus[place]) / 2e-3;
            assert!((found.slopes[place] - expected).abs() < 0.06, "{place}: {} {expected}", found.slopes[place]);
        }
        assert!(found.slopes.iter().sum::<f64>().abs() < 60.0 && steep.iter().sum::<f64>() > 80.0);
    }

    #[test]
    fn places_that_are_not_shown_are_left_out() {
        let (mut values, there) = views(1.0);
        values[7] = f64::NAN;
        let mut steep = vec![1.0; 600];
        steep[2 * 9] = f64::INFINITY;
        let found = Differences::new(&values, &there, Some(Slopes { values: &steep, columns: 2 }), Some(2.0));
        assert_eq!((found.off.len(), found.slopes.len()), (298, 596));
        assert!(!found.shown[7] && !found.shown[9] && found.shown.iter().filter(|shown| **shown).count() == 298);
        let none = Differences::new(&[f64::NAN], &[1.0], None, None);
        assert_eq!((none.off, none.shown), (vec![], vec![false]));
    }

    #[test]
    fn without_a_spread_nothing_is_weighed() {
        let found = Differences::new(&[3.0, 3.0, 3.0], &[1.0, 1.0, 1.0], None, None);
        assert_eq!(found.off, [0.0, 0.0, 0.0]);
    }
}
