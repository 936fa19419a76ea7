//! Polynomials of one variable, coefficients from the constant up.

/// p(x).
#[inline(always)]
pub(super) fn value(coefficients: &[f64], x: f64) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, &coefficient| sum * x + coefficient)
}

/// p(at + scale x).
#[inline(always)]
pub(super) fn shifted([a, b, c, d]: [f64; 4], at: f64, scale: f64) -> [f64; 4] {
    [
        a + at * (b + at * (c + at * d)),
        scale * (b + at * (2.0 * c + at * 3.0 * d)),
        scale * scale * (c + at * 3.0 * d),
        scale * scale * scale * d,
    ]
}

/// p'.
pub(super) fn derivative(coefficients: &[f64]) -> Vec<f64> {
    coefficients.iter().enumerate().skip(1).map(|(power, &coefficient)| power as f64 * coefficient).collect()
}

/// p q.
pub(super) fn product(p: &[f64], q: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; p.len() + q.len() - 1];
    for (i, a) in p.iter().enumerate() {
        for (j, b) in q.iter().enumerate() {
            out[i + j] += a * b;
        }
    }
    out
}

/// a p + b q.
pub(super) fn sum(a: f64, p: &[f64], b: f64, q: &[f64]) -> Vec<f64> {
    let at = |c: &[f64], i: usize| c.get(i).copied().unwrap_or(0.0);
    (0..p.len().max(q.len())).map(|i| a * at(p, i) + b * at(q, i)).collect()
}

/// The end of the stretch from 0 on where p, positive at 0, stays positive: `None` if that reaches beyond `end`.
pub(super) fn positive_until(coefficients: &[f64], end: f64) -> Option<f64> {
    let mut low = 0.0;
    for high in turning_points(coefficients, end).into_iter().chain([end]) {
        if value(coefficients, high) <= 0.0 {
            return Some(bisect(low, high, |x| value(coefficients, x) > 0.0));
        }
        low = high;
    }
    None
}

/// Where p' changes its sign between 0 and `end`, in order: between two such points p is monotone.
fn turning_points(coefficients: &[f64], end: f64) -> Vec<f64> {
    let slope = derivative(coefficients);
    if slope.iter().all(|&coefficient| coefficient == 0.0) {
        return Vec::new();
    }
    let mut ends = turning_points(&slope, end);
    ends.push(end);
    let mut found = Vec::new();
    let mut low = 0.0;
    for high in ends {
        let rising = value(&slope, low) > 0.0;
        if rising != (value(&slope, high) > 0.0) {
            found.push(bisect(low, high, |x| (value(&slope, x) > 0.0) == rising));
        }
        low = high;
    }
    found
}

/// The last number, from `low`, for which `holds`; at `high` it does not.
pub(super) fn bisect(mut low: f64, mut high: f64, holds: impl Fn(f64) -> bool) -> f64 {
    loop {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            return low;
        }
        if holds(middle) { low = middle } else { high = middle }
    }
}

/// x from 0 to `end` where a function that grows from there to there reaches 0; `f` gives its value, of which only the
/// sign must be right far away, and its derivative. `end` where the function is not positive before it.
///
/// Newton's steps, halving where one leaves the interval that is left.
pub(super) fn root_of_increasing(end: f64, start: f64, f: impl Fn(f64) -> (f64, f64)) -> f64 {
    let (mut low, mut high) = (0.0, end);
    if f(end).0 <= 0.0 {
        return end;
    }
    let mut x = if start > 0.0 && start < end { start } else { 0.5 * end };
    for _ in 0..200 {
        let (error, slope) = f(x);
        if error > 0.0 {
            high = x
        } else {
            low = x
        }
        let newton = x - error / slope;
        let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
        if error == 0.0 {
            return x;
        }
        if (next - x).abs() <= 2.0 * f64::EPSILON * x {
            return next; // steps of one unit in the last place may go on for ever
        }
        x = next;
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_the_first_of_several_roots() {
        // (1 - x)(2 - x)(3 - x)
        let p = product(&product(&[1.0, -1.0], &[2.0, -1.0]), &[3.0, -1.0]);
        assert!((positive_until(&p, 10.0).unwrap() - 1.0).abs() < 1e-14);
        assert_eq!(positive_until(&p, 0.9), None);
        assert_eq!(positive_until(&[1.0], 1e9), None);
        assert_eq!(positive_until(&[1.0, 0.0, 0.5], 1e9), None);
        // two roots close together, between which a coarse scan would step
        let close = product(&[0.5, -1.0], &[0.5 + 1e-6, -1.0]);
        assert!((positive_until(&close, 1e6).unwrap() - 0.5).abs() < 1e-9);
    }

    #[test]
    fn solves_where_newton_alone_runs_away() {
        let f = |x: f64| (x.powi(3) - 2.0 * x.powi(2) + 1.5 * x - 0.3, 3.0 * x * x - 4.0 * x + 1.5);
        for start in [0.01, 0.6667, 5.9] {
            let x = root_of_increasing(6.0, start, f);
            assert!(f(x).0.abs() < 1e-15, "{start} {x}");
        }
        assert_eq!(root_of_increasing(0.2, 0.1, f), 0.2);
    }
}
