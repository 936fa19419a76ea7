//! Coordinates of a row through a lens.

use std::ops::Range;

use nalgebra::{Matrix3, Vector3};

use crate::camera::Lens;
use crate::camera::lens::{Distort, Line, OnLine, distort_all, each_distort};
use crate::error::Result;
use crate::isa::{Isa, for_each_isa};
use crate::kernels::Row;

/// A row of points in the camera frame behind a lens: `(u, v) = K (lens(origin + step * t), 1)`.
pub(crate) struct BentRow<'a> {
    /// The point where t is 0.
    pub(crate) origin: Vector3<f64>,
    /// How it moves with t.
    pub(crate) step: Vector3<f64>,
    /// What takes the lens's plane to pixels.
    pub(crate) intrinsics: Matrix3<f64>,
    /// The lens.
    pub(crate) lens: &'a Lens,
}

/// Where the points of a row lie beside its origin, in the camera frame. On a plane, all rows share them.
pub(crate) struct Offsets {
    t: Row,
    /// `step * t`, by axis.
    x: Row,
    y: Row,
    z: Row,
}

/// [`Offsets`] of some neighbouring cells.
#[derive(Clone, Copy)]
pub(crate) struct OffsetsOf<'a> {
    t: &'a [f64],
    x: &'a [f64],
    y: &'a [f64],
    z: &'a [f64],
}

impl Offsets {
    /// The offsets of rows whose points lie at `step * t` from their origin, for each of `ts`.
    pub(crate) fn along(step: &Vector3<f64>, ts: &[f64]) -> Result<Self> {
        let times = |step: f64| Row::collected(ts.iter().map(|t| step * t));
        Ok(Self { t: times(1.0)?, x: times(step.x)?, y: times(step.y)?, z: times(step.z)? })
    }

    /// The offsets of these cells.
    pub(crate) fn of(&self, cells: Range<usize>) -> OffsetsOf<'_> {
        let [t, x, y, z] = [&self.t, &self.x, &self.y, &self.z].map(|axis| &axis[cells.clone()]);
        OffsetsOf { t, x, y, z }
    }
}

impl BentRow<'_> {
    /// Writes u and v for each point; NaN outside the lens's domain.
    pub(crate) fn fill(&self, isa: Isa, offsets: OffsetsOf<'_>, us: &mut [f64], vs: &mut [f64]) {
        let row = self;
        each_distort!(self.lens, lens: Model => for_each_isa!(isa, (body::<Model>, body::<Model>, body::<Model>)(
            row: &BentRow<'_>, lens: &Model, offsets: OffsetsOf<'_>, us: &mut [f64], vs: &mut [f64]
        )));
    }
}

#[inline(always)]
fn body<L: Distort>(row: &BentRow<'_>, lens: &L, offsets: OffsetsOf<'_>, us: &mut [f64], vs: &mut [f64]) {
    let line = Line::seen(&row.origin, &row.step);
    if let Some((line, on_line)) = line.and_then(|line| Some((line, lens.on_line(line, &row.intrinsics)?))) {
        fill_line(row.origin.z, line.shift, on_line, offsets, us, vs);
    } else {
        fill(row, lens, offsets, us, vs);
    }
}

/// Point by point.
#[inline(always)]
fn fill<L: Distort>(row: &BentRow<'_>, lens: &L, offsets: OffsetsOf<'_>, us: &mut [f64], vs: &mut [f64]) {
    let (a, k) = (row.origin, row.intrinsics);
    let (fx, skew, cx, fy, cy) = (k[(0, 0)], k[(0, 1)], k[(0, 2)], k[(1, 1)], k[(1, 2)]);
    let cells = us.len();
    let (vs, xs, ys, zs) = (&mut vs[..cells], &offsets.x[..cells], &offsets.y[..cells], &offsets.z[..cells]);
    if L::DRAFTS {
        distort_all(lens, |i| [a.x + xs[i], a.y + ys[i], a.z + zs[i]], us, vs);
        for i in 0..cells {
            let (x, y) = (us[i], vs[i]);
            (us[i], vs[i]) = (fx * x + skew * y + cx, fy * y + cy);
        }
        return;
    }
    for i in 0..cells {
        let (x, y) = lens.distort(a.x + xs[i], a.y + ys[i], a.z + zs[i]);
        // as Pinhole::pixel
        (us[i], vs[i]) = (fx * x + skew * y + cx, fy * y + cy);
    }
}

/// Along the straight line that the row is on the plane z = 1.
///
/// In two loops: each is a short chain, of which the processor keeps more in flight. In one: 1.35 times as long.
#[inline(always)]
fn fill_line(
    origin_z: f64,
    shift: f64,
    OnLine { pixel, end }: OnLine<impl Fn(f64) -> (f64, f64)>,
    offsets: OffsetsOf<'_>,
    us: &mut [f64],
    vs: &mut [f64],
) {
    let cells = us.len();
    let (vs, ts, zs) = (&mut vs[..cells], &offsets.t[..cells], &offsets.z[..cells]);
    // A cone around the axis cuts a line once: where both ends are inside it, by more than rounding, all points are. Of
    // two z the product must be a number as well.
    let inside = |i: usize| {
        let (z, m) = (origin_z + zs[i], (ts[i] + shift) / (origin_z + zs[i]));
        (1e-150..1e150).contains(&z) && m * m <= (1.0 - 1e-9) * end
    };
    if cells > 0 && inside(0) && inside(cells - 1) {
        divide(shift, ts, origin_z, zs, us);
        for i in 0..cells {
            (us[i], vs[i]) = pixel(us[i]);
        }
    } else {
        for i in 0..cells {
            let z = origin_z + zs[i];
            us[i] = if z > 0.0 { (ts[i] + shift) / z } else { f64::NAN };
        }
        for i in 0..cells {
            let m = us[i];
            let (u, v) = pixel(m);
            (us[i], vs[i]) = if m * m <= end { (u, v) } else { (f64::NAN, f64::NAN) };
        }
    }
}

/// Writes `(shift + t) / (origin + z)`, where no divisor is 0.
///
/// Two by one division, `1 / a = b (1 / ab)`, which is at most two units in the last place off: 0.14 ms instead of 0.21 for
/// the seed job. They are half a row apart, and not neighbours, because of that the compiler makes vectors.
#[inline(always)]
fn divide(shift: f64, ts: &[f64], origin: f64, zs: &[f64], out: &mut [f64]) {
    let cells = out.len();
    // the second half begins where a vector does
    let half = cells.div_ceil(2).next_multiple_of(8).min(cells);
    let pairs = cells - half;
    for i in pairs..half {
        out[i] = (shift + ts[i]) * (1.0 / (origin + zs[i]));
    }
    let ((out, far_out), (ts, far_ts), (zs, far_zs)) = (out.split_at_mut(half), ts.split_at(half), zs.split_at(half));
    let (out, ts, zs) = (&mut out[..pairs], &ts[..pairs], &zs[..pairs]);
    let (far_out, far_ts, far_zs) = (&mut far_out[..pairs], &far_ts[..pairs], &far_zs[..pairs]);
    for i in 0..pairs {
        let (z, far_z) = (origin + zs[i], origin + far_zs[i]);
        let of_both = 1.0 / (z * far_z);
        out[i] = (shift + ts[i]) * (far_z * of_both);
        far_out[i] = (shift + far_ts[i]) * (z * of_both);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Lens;
    use crate::camera::{
        BrownConrady, Camera, Cylindrical, Division, DoubleSphere, Equirectangular, Eucm, FTheta, FThetaForm, Fov,
        InverseBrownConrady, KannalaBrandt, Mei, Ocam, Pinhole, RadialPolynomial, ThinPrismFisheye,
    };

    fn lenses() -> Vec<Lens> {
        let bent = [0.1, 0.02, 1e-3, -2e-3, 3e-3, 0.2, 0.1, 0.01, 1e-3, 2e-3, -1e-3, 3e-4, 0.03, -0.05];
        let brown = |count: usize| BrownConrady::new(&bent[..count], None).unwrap().into();
        vec![
            brown(4),
            brown(5),
            brown(8),
            brown(12),
            brown(14),
            // ends at a pole of its quotient, 61 degrees from the axis, before which pixels grow without bound
            BrownConrady::new(&[0.1, 0.02, 1e-3, -2e-3, 3e-3, -0.3, 0.0, 0.0], None).unwrap().into(),
            KannalaBrandt::new(&[0.02, -0.01, 3e-3, -5e-4], None).unwrap().into(),
            Mei::new(2.2, &[0.016, 1.65, 4e-4, -5e-4], None).unwrap().into(),
            Mei::new(0.9, &[-0.02, 0.001, 4e-4, -5e-4], Some(1.9)).unwrap().into(),
            DoubleSphere::new(-0.2, 0.6, None).unwrap().into(),
            DoubleSphere::new(0.95, 0.5, None).unwrap().into(),
            Eucm::new(0.6, 1.1, None).unwrap().into(),
            RadialPolynomial::new(&[340.0, -32.0, 48.0, -7.2], None).unwrap().into(),
            Ocam::new(&[-300.0, 0.0, 1e-3, -1e-6, 1e-9], [1.001, 2e-3, -3e-3], None).unwrap().into(),
            FTheta::new(&[0.0, 340.0, 5.0, -8.0], FThetaForm::Forward, [1.01, 2e-3, -3e-3], None).unwrap().into(),
            FTheta::new(&[0.0, 2.9e-3, 1e-8, 1e-10], FThetaForm::Backward, [1.0, 0.0, 0.0], None).unwrap().into(),
            Fov::new(1.1, None).unwrap().into(),
            Division::new(-0.4, None).unwrap().into(),
            Division::new(0.2, None).unwrap().into(),
            InverseBrownConrady::new(&[-0.2, 0.05, 1e-3, -2e-3, 0.0], None).unwrap().into(),
            ThinPrismFisheye::new(&[0.01, -0.02, 1e-3, -2e-3, 3e-3, -1e-3, 4e-3, -5e-3], None).unwrap().into(),
            ThinPrismFisheye::new(&[0.01, -0.01, 2e-3, 0., 0., 0., 1e-3, -2e-3, 3e-3, 0., 1e-3, 0.], None)
                .unwrap()
                .into(),
            Cylindrical::new(None).unwrap().into(),
            Equirectangular::new(None).unwrap().into(),
        ]
    }

    /// Asserts that a row is the same on every instruction set and what `project` says of its points; returns how many
    /// are seen.
    fn check(row: &BentRow<'_>, camera: &Camera, ts: &[f64]) -> usize {
        let offsets = Offsets::along(&row.step, ts).unwrap();
        let filled = |isa| {
            let (mut us, mut vs) = (vec![0.0; ts.len()], vec![0.0; ts.len()]);
            row.fill(isa, offsets.of(0..ts.len()), &mut us, &mut vs);
            (us, vs)
        };
        let bits = |(us, vs): &(Vec<f64>, Vec<f64>)| -> Vec<u64> {
            us.iter().chain(vs).map(|value| if value.is_nan() { u64::MAX } else { value.to_bits() }).collect()
        };
        let (lens, scalar) = (row.lens, filled(Isa::Scalar));
        for &isa in Isa::available() {
            assert_eq!(bits(&filled(isa)), bits(&scalar), "{isa:?} {lens}");
        }
        let mut seen = 0;
        for (i, t) in ts.iter().enumerate() {
            let pixel = camera.project(&(row.origin + row.step * *t)).pixel;
            let (u, v) = (scalar.0[i], scalar.1[i]);
            assert_eq!(pixel[0].is_nan(), u.is_nan(), "{lens} at {t}");
            if !u.is_nan() {
                let tolerance = 1e-12 * (1e3 + u.hypot(v).powi(2));
                assert!((u - pixel[0]).abs() < tolerance && (v - pixel[1]).abs() < tolerance, "{lens} at {t}");
                seen += 1;
            }
        }
        seen
    }

    #[test]
    fn points_so_far_away_that_the_product_of_two_is_infinite_are_where_they_are() {
        let lens: Lens = BrownConrady::new(&[0.1, 0.02, 1e-3, -2e-3], None).unwrap().into();
        let model = Pinhole::new(700.0, 710.0, 620.0, 370.0, 0.0).unwrap();
        let pose = crate::geometry::Pose::new(Matrix3::identity(), Vector3::zeros()).unwrap();
        let camera = Camera::new(model, (1280, 720), pose).unwrap().with_lens(lens);
        let (origin, step) = (Vector3::new(0.3, 1.2, 2.0), Vector3::new(-0.2, 0.05, 0.97));
        let row = BentRow { origin, step, intrinsics: model.matrix(), lens: &lens };
        let ts: Vec<f64> = (1..=40).map(|i| f64::from(i) * 1e160).collect();
        assert_eq!(check(&row, &camera, &ts), 40);
    }

    #[test]
    fn every_instruction_set_gives_the_bits_of_scalar_and_what_project_gives() {
        // from straight ahead to behind the camera; across; along the axis; through the camera's own place
        let ts: Vec<f64> = (0..1003).map(|i| f64::from(i) * 0.02 - 8.0).collect();
        let lines = [
            ([0.3, 1.2, 2.0], [-0.2, 0.05, -0.97]),
            ([0.1, 1.5, 9.0], [1.0, -0.02, 0.05]),
            ([0.5, 1.5, 9.0], [0.0, 0.0, 1.0]),
            ([0.2, -0.4, 4.0], [-0.05, 0.1, -1.0]),
        ];
        for (skew, lens) in lenses().into_iter().flat_map(|lens| [(0.0, lens), (1.5, lens)]) {
            let model = Pinhole::new(700.0, 710.0, 620.0, 370.0, skew).unwrap();
            let pose = crate::geometry::Pose::new(Matrix3::identity(), Vector3::zeros()).unwrap();
            let camera = Camera::new(model, (1280, 720), pose).unwrap().with_lens(lens);
            for (origin, step) in lines.map(|(origin, step)| (Vector3::from(origin), Vector3::from(step))) {
                let row = BentRow { origin, step, intrinsics: model.matrix(), lens: &lens };
                let seen = check(&row, &camera, &ts);
                assert!(seen > 200, "{lens} {origin} {seen}");
                // rows in the domain from end to end, of every length that vectors and pairs may have
                let mut parts = 0;
                for cells in (1..50).chain([100, 333]) {
                    for first in [0, 200, 400, 600] {
                        parts += usize::from(check(&row, &camera, &ts[first..first + cells]) == cells);
                    }
                }
                assert!(parts > 50, "{lens} {origin} {parts}");
            }
        }
    }
}
