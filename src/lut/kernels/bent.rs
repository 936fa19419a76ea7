//! Coordinates of a row through a lens.

use nalgebra::{Matrix3, Vector3};

use super::for_each_isa;
use crate::camera::lens::{Distort, Terms};
use crate::camera::{DoubleSphere, Eucm, KannalaBrandt, Lens, Mei, Ocam, RadialPolynomial};
use crate::cpu::Isa;

/// A row of points in the camera frame, `origin + step * t`, behind a lens: `(u, v) = K (lens(point), 1)`.
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

impl BentRow<'_> {
    /// Writes u and v for each t; NaN outside the lens's domain.
    pub(crate) fn fill(&self, isa: Isa, ts: &[f64], us: &mut [f64], vs: &mut [f64]) {
        let row = self;
        macro_rules! with {
            ($lens:expr, $model:ty) => {{
                let lens = $lens;
                for_each_isa!(isa, (body::<$model>, body::<$model>, body::<$model>)(
                    row: &BentRow<'_>, lens: &$model, ts: &[f64], us: &mut [f64], vs: &mut [f64]
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
fn body<L: Distort>(row: &BentRow<'_>, lens: &L, ts: &[f64], us: &mut [f64], vs: &mut [f64]) {
    let (a, b, k) = (row.origin, row.step, row.intrinsics);
    let (fx, skew, cx, fy, cy) = (k[(0, 0)], k[(0, 1)], k[(0, 2)], k[(1, 1)], k[(1, 2)]);
    let cells = ts.len();
    let (us, vs) = (&mut us[..cells], &mut vs[..cells]);
    for i in 0..cells {
        let t = ts[i];
        let (x, y) = lens.distort(a.x + b.x * t, a.y + b.y * t, a.z + b.z * t);
        us[i] = fx * x + skew * y + cx;
        vs[i] = fy * y + cy;
    }
}
