//! Coordinates of a row over a road of varying height.

use nalgebra::{Matrix3, Vector3};

use crate::camera::Lens;
use crate::camera::lens::{Distort, distort_all, each_distort};
use crate::isa::{Isa, for_each_isa};

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
        let Some(lens) = self.lens else {
            let lens = &Straight;
            return for_each_isa!(isa, (body::<Straight>, body::<Straight>, body::<Straight>)(
                row: &HeightsRow<'_>, lens: &Straight, ys: &[f64], zs: &[f64], us: &mut [f64], vs: &mut [f64]
            ));
        };
        each_distort!(lens, lens: Model => for_each_isa!(isa, (body::<Model>, body::<Model>, body::<Model>)(
            row: &HeightsRow<'_>, lens: &Model, ys: &[f64], zs: &[f64], us: &mut [f64], vs: &mut [f64]
        )));
    }
}

#[inline(always)]
fn body<L: Distort>(row: &HeightsRow<'_>, lens: &L, ys: &[f64], zs: &[f64], us: &mut [f64], vs: &mut [f64]) {
    let (o, a, b, k) = (row.origin, row.across, row.up, row.intrinsics);
    let (fx, skew, cx, fy, cy) = (k[(0, 0)], k[(0, 1)], k[(0, 2)], k[(1, 1)], k[(1, 2)]);
    let cells = ys.len();
    let (zs, us, vs) = (&zs[..cells], &mut us[..cells], &mut vs[..cells]);
    let point = |i: usize| {
        let (y, z) = (ys[i], zs[i]);
        [o.x + a.x * y + b.x * z, o.y + a.y * y + b.y * z, o.z + a.z * y + b.z * z]
    };
    if L::DRAFTS {
        distort_all(lens, point, us, vs);
        for i in 0..cells {
            let (mx, my) = (us[i], vs[i]);
            (us[i], vs[i]) = (fx * mx + skew * my + cx, fy * my + cy);
        }
        return;
    }
    for i in 0..cells {
        let [x, y, z] = point(i);
        let (mx, my) = lens.distort(x, y, z);
        us[i] = fx * mx + skew * my + cx;
        vs[i] = fy * my + cy;
    }
}
