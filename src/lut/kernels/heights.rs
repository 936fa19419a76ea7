//! Coordinates of a row over a road of varying height.

use nalgebra::{Matrix3, Vector3};

use super::for_each_isa;
use crate::camera::lens::{Distort, Terms};
use crate::camera::{DoubleSphere, Eucm, KannalaBrandt, Lens, Mei, Ocam, RadialPolynomial};
use crate::cpu::Isa;

/// A row of points in the camera frame, `origin + across * y + up * z`: the row of a grid whose heights are given.
pub(crate) struct HeightsRow<'a> {
    /// The point where y and z are 0.
    pub(crate) origin: Vector3<f64>,
    /// How it moves with y.
    pub(crate) across: Vector3<f64>,
    /// How it moves with z.
    pub(crate) up: Vector3<f64>,
    /// What takes the lens's plane to pixels.
    pub(crate) intrinsics: Matrix3<f64>,
    /// The lens; `None` is a pinhole.
    pub(crate) lens: Option<&'a Lens>,
}

/// A pinhole, as a lens that bends nothing.
struct Straight;

impl Distort for Straight {
    #[inline(always)]
    fn distort(&self, x: f64, y: f64, z: f64) -> (f64, f64) {
        let scale = if z > 0.0 { 1.0 / z } else { f64::NAN };
        (x * scale, y * scale)
    }
}

impl HeightsRow<'_> {
    /// Writes u and v for each y and z; NaN where the camera sees nothing and where z is NaN.
    pub(crate) fn fill(&self, isa: Isa, ys: &[f64], zs: &[f64], us: &mut [f64], vs: &mut [f64]) {
        let row = self;
        macro_rules! with {
            ($lens:expr, $model:ty) => {{
                let lens = $lens;
                for_each_isa!(isa, (body::<$model>, body::<$model>, body::<$model>)(
                    row: &HeightsRow<'_>, lens: &$model, ys: &[f64], zs: &[f64], us: &mut [f64], vs: &mut [f64]
                ))
            }};
        }
        match self.lens {
            None => with!(&Straight, Straight),
            Some(Lens::BrownConrady(lens)) => match lens.terms() {
                5 => with!(&Terms::<5>(*lens), Terms<5>),
                8 => with!(&Terms::<8>(*lens), Terms<8>),
                12 => with!(&Terms::<12>(*lens), Terms<12>),
                _ => with!(&Terms::<14>(*lens), Terms<14>),
            },
            Some(Lens::KannalaBrandt(lens)) => with!(lens, KannalaBrandt),
            Some(Lens::Mei(lens)) => with!(lens, Mei),
            Some(Lens::DoubleSphere(lens)) => with!(lens, DoubleSphere),
            Some(Lens::Eucm(lens)) => with!(lens, Eucm),
            Some(Lens::RadialPolynomial(lens)) => with!(lens, RadialPolynomial),
            Some(Lens::Ocam(lens)) => with!(lens, Ocam),
        }
    }
}

#[inline(always)]
fn body<L: Distort>(row: &HeightsRow<'_>, lens: &L, ys: &[f64], zs: &[f64], us: &mut [f64], vs: &mut [f64]) {
    let (o, a, b, k) = (row.origin, row.across, row.up, row.intrinsics);
    let (fx, skew, cx, fy, cy) = (k[(0, 0)], k[(0, 1)], k[(0, 2)], k[(1, 1)], k[(1, 2)]);
    let cells = ys.len();
    let (zs, us, vs) = (&zs[..cells], &mut us[..cells], &mut vs[..cells]);
    for i in 0..cells {
        let (y, z) = (ys[i], zs[i]);
        let (mx, my) = lens.distort(o.x + a.x * y + b.x * z, o.y + a.y * y + b.y * z, o.z + a.z * y + b.z * z);
        us[i] = fx * mx + skew * my + cx;
        vs[i] = fy * my + cy;
    }
}
