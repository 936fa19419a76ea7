//! The angle of a direction from the axis, in operations that every instruction set has and rounds alike.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

/// tan(pi / 8): up to it the series is used as it is.
const FOLD: f64 = 0.414_213_562_373_095_03;

/// (atan(sqrt u) / sqrt u - 1) / u on [0, tan^2(pi / 8)], interpolated at Chebyshev nodes: off by less than 7e-18.
const SERIES: [f64; 11] = [
    -0.333_333_333_333_333_3,
    0.199_999_999_999_955_2,
    -0.142_857_142_846_665_42,
    0.111_111_110_152_562_92,
    -0.090_909_045_781_210_85,
    0.076_921_831_907_606_51,
    -0.066_645_114_464_602_2,
    0.058_581_489_047_951_24,
    -0.050_854_496_960_392_584,
    0.039_231_657_085_083_686,
    -0.019_176_885_636_589_053,
];

/// `atan2(r, z)` for `r >= 0`, from 0 to pi, to 2 units in the last place; NaN at (0, 0). Without branches or calls,
/// so that a loop over it becomes vectors, and with the same bits on every machine.
#[inline(always)]
pub(super) fn angle_from_axis(r: f64, z: f64) -> f64 {
    let along = z.abs();
    let steep = r > along;
    let (small, large) = if steep { (along, r) } else { (r, along) };
    // atan(n / d) = pi / 4 + atan((n - d) / (n + d))
    let folded = small > large * FOLD;
    let (numerator, denominator) = if folded { (small - large, small + large) } else { (small, large) };
    let t = numerator / denominator;
    let u = t * t;
    let mut series = SERIES[10];
    let mut term = 10;
    while term > 0 {
        term -= 1;
        series = series * u + SERIES[term];
    }
    let part = t + t * (u * series);
    let acute = if folded { FRAC_PI_4 + part } else { part };
    let angle = if steep { FRAC_PI_2 - acute } else { acute };
    if z < 0.0 { PI - angle } else { angle }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn is_atan2() {
        let mut worst = 0.0f64;
        for i in 0..200_001 {
            let angle = PI * f64::from(i) / 200_000.0;
            for length in [1.0, 3.7e-5, 8.1e7] {
                let (r, z) = (angle.sin().abs() * length, angle.cos() * length);
                let exact = r.atan2(z);
                worst = worst.max((angle_from_axis(r, z) - exact).abs() / exact.max(f64::MIN_POSITIVE));
            }
        }
        assert!(worst < 4.5e-16, "{worst:e}");
        for (r, z) in [(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (1.0, 1.0), (1.0, -1.0), (1e-300, 2.0)] {
            let (got, exact) = (angle_from_axis(r, z), r.atan2(z));
            assert!((got - exact).abs() <= 2.3e-16 * exact, "{r} {z}: {got} {exact}");
        }
        assert!(angle_from_axis(0.0, 0.0).is_nan() && angle_from_axis(f64::NAN, 1.0).is_nan());
    }
}
