//! A homography from points seen on the road.

use nalgebra::{DMatrix, Matrix3, SMatrix, SVector, Vector3};

use crate::error::{Error, PointsError, Result, finite};
use crate::parallel::check_interrupt;
use crate::view::buffer;

/// What memory is asked for, in errors.
const WHAT: &str = "points";

/// Points nearer to a line than this part of their spread lie on it: what lies off it by less may as well be a
/// misplaced click.
const ON_A_LINE: f64 = 1e-3;

/// Points nearer to each other than this part of their spread are one.
const THE_SAME: f64 = 1e-9;

/// Smallest second smallest singular value, against the largest, of equations that have one solution.
const RANK: f64 = 1e-9;

/// What [`homography_from_points`] finds.
#[derive(Debug, Clone, PartialEq)]
pub struct GroundHomography {
    /// Takes (x, y, 1) on the ground to a pixel. Its third component is positive at the points given, 1 on average.
    pub image_from_ground: Matrix3<f64>,
    /// For each point, pixels from where it was seen to where the homography puts it.
    pub errors: Vec<f64>,
}

/// The homography that takes points of the ground, metres, to where they are seen, pixels: of four, the one that does
/// so exactly; of more, the one with the least sum of squared distances in the image.
///
/// Direct linear transform of normalised points (Hartley and Zisserman, Multiple View Geometry, algorithm 4.2), then
/// Levenberg-Marquardt on the distances in the image.
///
/// # Errors
/// [`PointsError::Unfit`] where there are fewer than four pairs, where all points but one lie on a line (three of
/// four), or two of four coincide, and where no camera has all of them before it; [`Error::NotFinite`].
pub fn homography_from_points(image: &[[f64; 2]], ground: &[[f64; 2]]) -> Result<GroundHomography> {
    if image.len() != ground.len() {
        let got = format!("{} and {} points", image.len(), ground.len());
        return Err(Error::Points(PointsError::Unfit { what: "image_points, ground_points", expected: "pairs", got }));
    }
    for (what, points) in [("image_points", image), ("ground_points", ground)] {
        for &value in points.iter().flatten() {
            finite(what, value)?;
        }
        if points.len() < 4 {
            let got = format!("{}", points.len());
            return Err(Error::Points(PointsError::Unfit { what, expected: "at least four points", got }));
        }
    }
    let (image, to_image) = normalised("image_points", image)?;
    let (ground, to_ground) = normalised("ground_points", ground)?;
    let pairs = buffer::collected(WHAT, image.into_iter().zip(ground))?;
    let start = linear(&pairs)?;
    let h = refined(&pairs, oriented(&pairs, start)?)?;
    let pixel = |v: Vector3<f64>| [v.x / v.z, v.y / v.z];
    // a pixel is to_image's inverse of a normalised one: a scale and a shift
    let scale = to_image[(0, 0)];
    let errors = pairs.iter().map(|(image, ground)| {
        let [u, v] = pixel(h * Vector3::new(ground[0], ground[1], 1.0));
        (u - image[0]).hypot(v - image[1]) / scale
    });
    let errors = buffer::collected(WHAT, errors)?;
    // its determinant, the scale squared, may be beyond float64
    let centre = [0, 1].map(|axis| -to_image[(axis, 2)] / scale);
    let from_normal = Matrix3::new(scale.recip(), 0.0, centre[0], 0.0, scale.recip(), centre[1], 0.0, 0.0, 1.0);
    let image_from_ground = from_normal * h * to_ground;
    if !image_from_ground.iter().all(|entry| entry.is_finite()) {
        let got = "numbers whose homography is beyond float64".to_owned();
        let what = "image_points, ground_points";
        return Err(Error::Points(PointsError::Unfit { what, expected: "pixels and metres", got }));
    }
    Ok(GroundHomography { image_from_ground, errors })
}

/// The points moved to a centre of 0 and a mean distance of sqrt(2) from it, and what moves them.
fn normalised(what: &'static str, points: &[[f64; 2]]) -> Result<(Vec<[f64; 2]>, Matrix3<f64>)> {
    let count = points.len() as f64;
    let centre = [0, 1].map(|axis| points.iter().map(|point| point[axis] / count).sum::<f64>());
    let spread = points.iter().map(|p| (p[0] - centre[0]).hypot(p[1] - centre[1]) / count).sum::<f64>();
    let scale = std::f64::consts::SQRT_2 / spread;
    // what rounding left of a spread is none
    let apart = spread > 1e-13 * centre[0].abs().max(centre[1].abs());
    if !(apart && scale.is_finite() && scale > 0.0) {
        let got = format!("{} that coincide or are beyond all measure", points.len());
        return Err(Error::Points(PointsError::Unfit { what, expected: "points apart", got }));
    }
    let moved = points.iter().map(|p| [0, 1].map(|axis| (p[axis] - centre[axis]) * scale));
    let moved = buffer::collected(WHAT, moved)?;
    check_spread(what, &moved)?;
    let matrix = Matrix3::new(scale, 0.0, -scale * centre[0], 0.0, scale, -scale * centre[1], 0.0, 0.0, 1.0);
    Ok((moved, matrix))
}

/// Refuses points of which no four are such that no three lie on a line: then all but one lie on one.
fn check_spread(what: &'static str, points: &[[f64; 2]]) -> Result<()> {
    let mut distinct: Vec<usize> = buffer::reserved(WHAT, points.len())?;
    let mut twin = (0, 0);
    for (index, point) in points.iter().enumerate() {
        // the first four are enough to try lines through; later twins do no harm
        let seen = distinct.iter().take(4).find(|&&other| distance(point, &points[other]) <= THE_SAME);
        match seen {
            Some(&other) => twin = (other, index),
            None => distinct.push(index),
        }
    }
    if distinct.len() < 4 {
        let got = format!("points {} and {} in the same place", twin.0, twin.1);
        return Err(Error::Points(PointsError::Unfit { what, expected: "at least four different points", got }));
    }
    // a line through all but one passes through two of any three
    for (a, b) in [(0, 1), (0, 2), (1, 2)] {
        let (start, end) = (points[distinct[a]], points[distinct[b]]);
        let length = distance(&start, &end);
        let direction = [(end[0] - start[0]) / length, (end[1] - start[1]) / length];
        let off = |index: &&usize| {
            let p = points[**index];
            let aside = (p[0] - start[0]) * direction[1] - (p[1] - start[1]) * direction[0];
            aside.abs() > ON_A_LINE
        };
        if distinct.iter().filter(off).count() <= 1 {
            let on: Vec<_> = distinct.iter().filter(|index| !off(index)).take(8).map(usize::to_string).collect();
            let got = format!("points {} on one line", on.join(", "));
            return Err(Error::Points(PointsError::Unfit {
                what,
                expected: "four points of which no three lie on a line",
                got,
            }));
        }
    }
    Ok(())
}

fn distance(a: &[f64; 2], b: &[f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// The homography of least algebraic error.
fn linear(pairs: &[([f64; 2], [f64; 2])]) -> Result<Matrix3<f64>> {
    // two equations a pair; at least nine rows, so that there are nine singular vectors
    let rows = (2 * pairs.len()).max(9);
    let mut equations = DMatrix::from_vec(rows, 9, buffer::zeroed(WHAT, 9 * rows)?);
    for (pair, &([u, v], [x, y])) in pairs.iter().enumerate() {
        let rows = [[x, y, 1.0, 0.0, 0.0, 0.0, -u * x, -u * y, -u], [0.0, 0.0, 0.0, x, y, 1.0, -v * x, -v * y, -v]];
        for (row, entries) in rows.iter().enumerate() {
            for (column, &entry) in entries.iter().enumerate() {
                equations[(2 * pair + row, column)] = entry;
            }
        }
    }
    // the triangular factor has the same singular values and right vectors, and is 9 x 9 whatever the number of pairs
    let triangle = equations.qr().r();
    let svd = triangle.try_svd(false, true, f64::EPSILON, 1000);
    let degenerate = |got: &str| {
        let expected = "points that determine a homography";
        Err(Error::Points(PointsError::Unfit { what: "image_points, ground_points", expected, got: got.to_owned() }))
    };
    let Some((vectors, values)) = svd.and_then(|svd| Some((svd.v_t?, svd.singular_values))) else {
        return degenerate("equations without a solution");
    };
    let mut order: Vec<usize> = (0..9).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    let rank = values[order[1]] / values[order[8]];
    if rank.is_nan() || rank <= RANK {
        return degenerate("pairs that leave it open; are some of them on one line, or mixed up?");
    }
    let h = Matrix3::from_row_iterator(vectors.row(order[0]).iter().copied());
    // of rank 2 it would take the whole ground to a line
    if h.determinant().abs() > RANK * h.norm().powi(3) {
        Ok(h)
    } else {
        degenerate("pairs that put the ground on a line")
    }
}

/// The homography scaled so that its third component is positive at all points, and 1 at their centre.
fn oriented(pairs: &[([f64; 2], [f64; 2])], h: Matrix3<f64>) -> Result<Matrix3<f64>> {
    let third = |ground: [f64; 2]| h[(2, 0)] * ground[0] + h[(2, 1)] * ground[1] + h[(2, 2)];
    let before = pairs.iter().filter(|pair| third(pair.1) > 0.0).count();
    if before == 0 || before == pairs.len() {
        return Ok(h / h[(2, 2)]); // the centre's, which is the mean of theirs
    }
    // the smaller side is the likelier mistake
    let odd_sign = before <= pairs.len() / 2;
    let odd = pairs.iter().enumerate().filter(|(_, pair)| (third(pair.1) > 0.0) == odd_sign);
    let odd: Vec<_> = odd.take(8).map(|(index, _)| index.to_string()).collect();
    let got = format!("points {} beyond the horizon of the others; are pairs mixed up?", odd.join(", "));
    Err(Error::Points(PointsError::Unfit {
        what: "image_points, ground_points",
        expected: "points all in front of one camera",
        got,
    }))
}

/// Levenberg-Marquardt on the sum of squared distances in the image, from a homography with 1 as its last entry, which
/// stays: it is the third component at the points' centre, positive for every answer that counts.
fn refined(pairs: &[([f64; 2], [f64; 2])], start: Matrix3<f64>) -> Result<Matrix3<f64>> {
    const STEPS: usize = 60;
    let (mut h, mut damping) = (start, 1e-6);
    let mut cost = cost_of(pairs, &h);
    for _ in 0..STEPS {
        check_interrupt()?;
        let (mut normal, mut gradient) = (SMatrix::<f64, 8, 8>::zeros(), SVector::<f64, 8>::zeros());
        for &([u, v], [x, y]) in pairs {
            let q = h * Vector3::new(x, y, 1.0);
            let (w, pu, pv) = (1.0 / q.z, q.x / q.z, q.y / q.z);
            let rows = [
                ([x * w, y * w, w, 0.0, 0.0, 0.0, -pu * x * w, -pu * y * w], pu - u),
                ([0.0, 0.0, 0.0, x * w, y * w, w, -pv * x * w, -pv * y * w], pv - v),
            ];
            for (row, residual) in rows {
                let row = SVector::from(row);
                normal += row * row.transpose();
                gradient += row * residual;
            }
        }
        let mut damped = normal;
        for axis in 0..8 {
            damped[(axis, axis)] += damping * normal[(axis, axis)].max(f64::MIN_POSITIVE);
        }
        let Some(step) = damped.cholesky().map(|factor| factor.solve(&gradient)) else {
            damping = f64::max(damping * 10.0, 1e-12);
            continue;
        };
        let mut next = h;
        for (entry, change) in step.iter().enumerate() {
            next[(entry / 3, entry % 3)] -= change;
        }
        let next_cost = cost_of(pairs, &next);
        if next_cost < cost {
            let done = cost - next_cost <= 1e-15 * cost;
            (h, cost, damping) = (next, next_cost, damping * 0.1);
            if done {
                break;
            }
        } else if damping > 1e6 || step.norm() <= 1e-15 * h.norm() {
            break;
        } else {
            damping = f64::max(damping * 10.0, 1e-12);
        }
    }
    Ok(h)
}

/// Sum of squared distances; infinite where a point is not in front.
fn cost_of(pairs: &[([f64; 2], [f64; 2])], h: &Matrix3<f64>) -> f64 {
    let mut squares = 0.0;
    for &([u, v], [x, y]) in pairs {
        let q = h * Vector3::new(x, y, 1.0);
        if q.z.is_nan() || q.z <= 0.0 {
            return f64::INFINITY;
        }
        squares += (q.x / q.z - u).powi(2) + (q.y / q.z - v).powi(2);
    }
    squares
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Cityscapes, golden: the ground homography of the documents' camera.
    fn seed() -> Matrix3<f64> {
        Matrix3::new(
            1056.153326757786,
            -2273.928132238124,
            -1685.536746623405,
            428.155534435163,
            -4.164714595275,
            2022.569692771502,
            0.99921455744,
            -0.009719466681,
            -1.651833975096,
        )
    }

    #[test]
    fn numbers_of_any_size_have_a_homography_or_an_error() {
        let ground = [[5.0, -2.0], [5.0, 2.0], [20.0, -3.0], [20.0, 4.0], [11.0, 0.5]];
        let image = seen(&seed(), &ground);
        let scaled = |factor: f64| image.iter().map(|pixel| pixel.map(|at| at * factor)).collect::<Vec<_>>();
        for factor in [1e-160, 1e160, 1e300] {
            match homography_from_points(&scaled(factor), &ground) {
                Ok(found) => assert!(found.image_from_ground.iter().all(|entry| entry.is_finite()), "{factor}"),
                Err(error) => assert!(matches!(error, Error::Points(PointsError::Unfit { .. })), "{factor}: {error}"),
            }
        }
        let far = homography_from_points(&scaled(1e160), &ground).unwrap();
        let [u, v] = seen(&far.image_from_ground, &ground)[3];
        assert!((u / image[3][0] / 1e160 - 1.0).abs() < 1e-9 && (v / image[3][1] / 1e160 - 1.0).abs() < 1e-9);
    }

    fn seen(h: &Matrix3<f64>, ground: &[[f64; 2]]) -> Vec<[f64; 2]> {
        let pixel = |p: &[f64; 2]| h * Vector3::new(p[0], p[1], 1.0);
        ground.iter().map(pixel).map(|q| [q.x / q.z, q.y / q.z]).collect()
    }

    #[test]
    fn four_points_are_met_exactly_and_the_sign_is_a_cameras() {
        let ground = [[10.0, 3.0], [10.0, -3.0], [30.0, 4.0], [28.0, -3.5]];
        let found = homography_from_points(&seen(&seed(), &ground), &ground).unwrap();
        assert!(found.errors.iter().all(|&error| error < 1e-9), "{:?}", found.errors);
        let scale = found.image_from_ground[(2, 0)] / seed()[(2, 0)];
        assert!(scale > 0.0);
        assert!((found.image_from_ground / scale - seed()).abs().max() < 1e-7);
        assert!(found.image_from_ground.determinant() < 0.0, "seen from above");
    }

    #[test]
    fn of_many_noisy_points_it_is_the_least_squares_one() {
        let ground: Vec<[f64; 2]> =
            (0..40).map(|i| [8.0 + f64::from(i % 8) * 4.0, f64::from(i / 8) * 1.5 - 3.0]).collect();
        let noise = |i: usize, k: usize| ((i * 7919 + k * 104_729) % 1000) as f64 / 500.0 - 1.0;
        let image: Vec<[f64; 2]> =
            seen(&seed(), &ground).iter().enumerate().map(|(i, p)| [p[0] + noise(i, 0), p[1] + noise(i, 1)]).collect();
        let found = homography_from_points(&image, &ground).unwrap();
        let cost =
            |h: &Matrix3<f64>| seen(h, &ground).iter().zip(&image).map(|(a, b)| distance(a, b).powi(2)).sum::<f64>();
        let least = cost(&found.image_from_ground);
        assert!((found.errors.iter().map(|error| error * error).sum::<f64>() - least).abs() < 1e-9 * least);
        assert!(least < cost(&seed()));
        for entry in 0..9 {
            for change in [1e-5, -1e-5] {
                let mut other = found.image_from_ground;
                other[entry] *= 1.0 + change;
                assert!(cost(&other) >= least * (1.0 - 1e-12), "{entry}");
            }
        }
    }

    proptest! {
        #[test]
        fn finds_the_homography_again(points in prop::array::uniform5([5.0..60.0f64, -12.0..12.0f64]), count in 4..=5usize) {
            let ground = &points[..count];
            let image = seen(&seed(), ground);
            match homography_from_points(&image, ground) {
                Ok(found) => prop_assert!(found.errors.iter().all(|&error| error < 1e-7), "{:?}", found.errors),
                Err(Error::Points(PointsError::Unfit { .. })) => {
                    // two close ones, or three all but on a line
                    let area = |a: [f64; 2], b: [f64; 2], c: [f64; 2]|
                        ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).abs();
                    let longest = |a, b, c| distance(&a, &b).max(distance(&b, &c)).max(distance(&a, &c));
                    let thin = (0..count).flat_map(|a| (0..a).flat_map(move |b| (0..b).map(move |c| (a, b, c))))
                        .map(|(a, b, c)| (ground[a], ground[b], ground[c]))
                        .map(|(a, b, c)| area(a, b, c) / longest(a, b, c).powi(2))
                        .fold(f64::INFINITY, f64::min);
                    prop_assert!(thin < 0.1, "{thin}");
                }
                Err(other) => prop_assert!(false, "{other}"),
            }
        }
    }

    #[test]
    fn says_what_is_wrong_with_the_points() {
        let ground = [[10.0, 3.0], [10.0, -3.0], [30.0, 4.0], [28.0, -3.5]];
        let image = seen(&seed(), &ground);
        let message = |image: &[[f64; 2]], ground: &[[f64; 2]]| {
            homography_from_points(image, ground).expect_err("must be refused").to_string()
        };
        assert!(message(&image[..3], &ground[..3]).contains("at least four points, got 3"));
        assert!(message(&image[..3], &ground).contains("3 and 4 points"));
        let mut other = ground;
        other[3] = ground[1];
        assert!(message(&image, &other).contains("points 1 and 3 in the same place"));
        other[3] = [10.0, 5.0];
        assert!(message(&seen(&seed(), &other), &other).contains("points 0, 1, 3 on one line"));
        other[3] = [f64::NAN, 5.0];
        assert!(message(&image, &other).contains("ground_points: expected finite numbers"));
        let mut swapped = image.clone();
        swapped.swap(0, 1);
        assert!(message(&swapped, &ground).contains("mixed up"), "{}", message(&swapped, &ground));
        assert!(message(&[[5.0, 5.0]; 6], &[[5.0, 5.0]; 6]).contains("coincide"));
    }
}
