//! Coordinates of a row through a lens.

use nalgebra::{Matrix3, Vector3};

use super::for_each_isa;
use crate::camera::lens::{Distort, Terms};
use crate::camera::{DoubleSphere, Eucm, KannalaBrandt, Lens, Mei, Ocam, RadialPolynomial};
use crate::cpu::Isa;

/// A row of points in the camera frame behind a lens: `(u, v) = K (lens(origin + offset), 1)`.
pub(crate) struct BentRow<'a> {
    /// What the points of the row have in common.
    pub(crate) origin: Vector3<f64>,
    /// What takes the lens's plane to pixels.
    pub(crate) intrinsics: Matrix3<f64>,
    /// The lens.
    pub(crate) lens: &'a Lens,
}

/// Where the points of a row lie beside its origin, in the camera frame. On a plane, all rows share them.
pub(crate) struct Offsets {
    x: Vec<f64>,
    y: Vec<f64>,
    z: Vec<f64>,
}

impl Offsets {
    /// `step * t` for each t.
    pub(crate) fn along(step: &Vector3<f64>, ts: &[f64]) -> Self {
        let axis = |step: f64| ts.iter().map(|t| step * t).collect();
        Self { x: axis(step.x), y: axis(step.y), z: axis(step.z) }
    }
}

impl BentRow<'_> {
    /// Writes u and v for each point; NaN outside the lens's domain.
    pub(crate) fn fill(&self, isa: Isa, offsets: &Offsets, us: &mut [f64], vs: &mut [f64]) {
        let row = self;
        macro_rules! with {
            ($lens:expr, $model:ty) => {{
                let lens = $lens;
                for_each_isa!(isa, (body::<$model>, body::<$model>, body::<$model>)(
                    row: &BentRow<'_>, lens: &$model, offsets: &Offsets, us: &mut [f64], vs: &mut [f64]
                ))
            }};
        }
        match self.lens {
            Lens::BrownConrady(lens) => match lens.terms() {
                5 => with!(&Terms::<5>(*lens), Terms<5>),
                8 => with!(&Terms::<8>(*lens), Terms<8>),
                12 => with!(&Terms::<12>(*lens), Terms<12>),
                _ => with!(&Terms::<14>(*lens), Terms<14>),
            },
            Lens::KannalaBrandt(lens) => with!(lens, KannalaBrandt),
            Lens::Mei(lens) => with!(lens, Mei),
            Lens::DoubleSphere(lens) => with!(lens, DoubleSphere),
            Lens::Eucm(lens) => with!(lens, Eucm),
            Lens::RadialPolynomial(lens) => with!(lens, RadialPolynomial),
            Lens::Ocam(lens) => with!(lens, Ocam),
        }
    }
}

#[inline(always)]
fn body<L: Distort>(row: &BentRow<'_>, lens: &L, offsets: &Offsets, us: &mut [f64], vs: &mut [f64]) {
    if row.intrinsics[(0, 1)] == 0.0 {
        fill::<L, false>(row, lens, offsets, us, vs);
    } else {
        fill::<L, true>(row, lens, offsets, us, vs);
    }
}

#[inline(always)]
fn fill<L: Distort, const SKEW: bool>(row: &BentRow<'_>, lens: &L, offsets: &Offsets, us: &mut [f64], vs: &mut [f64]) {
    let (a, k) = (row.origin, row.intrinsics);
    let (fx, skew, cx, fy, cy) = (k[(0, 0)], k[(0, 1)], k[(0, 2)], k[(1, 1)], k[(1, 2)]);
    let cells = us.len();
    let (vs, xs, ys, zs) = (&mut vs[..cells], &offsets.x[..cells], &offsets.y[..cells], &offsets.z[..cells]);
    for i in 0..cells {
        let (x, y) = lens.distort(a.x + xs[i], a.y + ys[i], a.z + zs[i]);
        // as Pinhole::pixel: fx x + skew y + cx
        us[i] = if SKEW { fx * x + skew * y + cx } else { fx * x + cx };
        vs[i] = fy * y + cy;
    }
}
