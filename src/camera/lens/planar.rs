//! Maps of the plane to itself that a lens bends it by: where they fold, and their inverse.

use nalgebra::{Matrix2, Vector2};

use super::polynomial;

/// Where the largest circle ends in which `holds` for every point on it, looked for along rays from the centre, up to `end`.
///
/// `at` takes a part from 0 to 1 of the way to the radius there.
pub(super) fn circle_until(end: f64, at: impl Fn(f64) -> f64, holds: impl Fn([f64; 2]) -> bool) -> f64 {
    const AZIMUTHS: u32 = 180;
    const STEPS: u32 = 512;
    let azimuths: Vec<_> =
        (0..AZIMUTHS).map(|i| (f64::from(i) / f64::from(AZIMUTHS) * std::f64::consts::TAU).sin_cos()).collect();
    let keeps = |r: f64| azimuths.iter().all(|&(sin, cos)| holds([r * cos, r * sin]));
    let mut low = 0.0;
    for step in 1..=STEPS {
        let high = if step == STEPS { end } else { at(f64::from(step) / f64::from(STEPS)) };
        if !keeps(high) {
            return polynomial::bisect(low, high, keeps);
        }
        low = high;
    }
    end
}

/// Whether the symmetric part of a Jacobian is positive definite: on a circle, which is convex, a map of which it is so
/// everywhere is one-to-one.
pub(super) fn grows(jacobian: &Matrix2<f64>) -> bool {
    let mixed = 0.5 * (jacobian[(0, 1)] + jacobian[(1, 0)]);
    jacobian[(0, 0)] > 0.0 && jacobian[(0, 0)] * jacobian[(1, 1)] > mixed * mixed
}

/// The point of the circle with radius `end` at which `error` vanishes, from `start` on: Newton's steps, shorter where one
/// leads away or out of the circle. A guess that must be checked; `length` is the size of what the error is of.
pub(super) fn root(
    start: Vector2<f64>,
    end: f64,
    length: f64,
    error: impl Fn(&Vector2<f64>) -> Vector2<f64>,
    jacobian: impl Fn(&Vector2<f64>) -> Matrix2<f64>,
) -> Vector2<f64> {
    let edge = end * (1.0 + 1e-9); // so that what lies on the edge is reached and not slid along to
    let inside = |p: Vector2<f64>| if p.norm() > edge { p * (edge / p.norm()) } else { p };
    let mut p = inside(start);
    let mut residual = error(&p);
    for _ in 0..100 {
        if residual.norm() <= 4.0 * f64::EPSILON * length {
            break;
        }
        let Some(inverse) = jacobian(&p).try_inverse() else { break };
        let step = inverse * residual;
        let shorter = |scale: f64| {
            let next = inside(p - step * scale);
            let after = error(&next);
            (after.norm() < residual.norm()).then_some((next, after))
        };
        let Some((next, after)) = (0..30).find_map(|halvings| shorter(0.5f64.powi(halvings))) else { break };
        (p, residual) = (next, after);
    }
    p
}
