//! Poses from pictures: where one picture shows the road that another shows, how their brightness differs, and which way
//! a pose must move to make them agree.
//!
//! These are the inner loops of a direct method, as Lucas and Kanade 1981 or Engel et al. 2018 have it: [`Crossing`] takes
//! places of the road from one picture of a drive to the next and derives their brightness by the camera's mounting,
//! [`Differences`] sets two views of the same road off against each other whatever the light, [`Normal`] is what they tell
//! of the parameters. Who walks downhill, on which pictures and until when, is the caller's.
//!
//! All sums run in the order of the places, on one thread: the same to the last bit whatever the threads around.

mod crossing;
mod differences;
mod normal;

pub use crossing::{Crossing, Mounting, Moves, SLOPES, Shown};
pub use differences::{Differences, Slopes};
pub use normal::Normal;

/// Tukey's constant: what is off by more standard deviations counts for nothing, and 95 % of the information stays.
pub const CUT: f64 = 4.685;

/// Standard deviations in a median of distances from the median, of a normal distribution.
const SPREAD_OF_MEDIAN: f64 = 1.4826;

/// Tukey's weight of what is off by so much, 0 to 1.
#[inline]
fn weight(off: f64, spread: f64) -> f64 {
    let share = off / (CUT * spread);
    let rest = 1.0 - (share * share).min(1.0);
    rest * rest
}

/// The median of numbers that are not NaN; of an even count the mean of the middle two. NaN of none.
fn median(values: &mut [f64]) -> f64 {
    let middle = values.len() / 2;
    if values.is_empty() {
        return f64::NAN;
    }
    let is_odd = values.len() % 2 == 1;
    let (below, &mut upper, _) = values.select_nth_unstable_by(middle, f64::total_cmp);
    if is_odd {
        return upper;
    }
    let lower = below.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    0.5 * (lower + upper)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_is_in_the_middle() {
        assert_eq!(median(&mut [3.0, -1.0, 7.0]), 3.0);
        assert_eq!(median(&mut [3.0, -1.0, 7.0, 4.0]), 3.5);
        assert_eq!(median(&mut [2.0]), 2.0);
        assert!(median(&mut []).is_nan());
    }

    #[test]
    fn what_is_far_off_counts_for_nothing() {
        assert_eq!(weight(0.0, 2.0), 1.0);
        assert_eq!(weight(-CUT * 2.0, 2.0), 0.0);
        assert_eq!(weight(1e9, 2.0), 0.0);
        assert!((weight(CUT, 2.0) - 0.75_f64.powi(2)).abs() < 1e-15);
    }
}
