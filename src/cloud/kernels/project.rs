//! Points to pixels, through a pinhole and through a lens.

use super::Body;
use crate::camera::Lens;
use crate::camera::lens::Distort;
use crate::view::PointSample;

/// Pixels, depth and validity of points of the vehicle frame; the arithmetic of `Camera::project`, operation for
/// operation.
///
/// `S` numbers from one point to the next are known to the compiler, or it makes no vectors of the loads.
pub(in crate::cloud) struct ProjectPinhole<'a, T, const S: usize> {
    /// x, y, z, whatever else.
    pub(in crate::cloud) points: &'a [[T; S]],
    /// Row by row.
    pub(in crate::cloud) rotation: [[f64; 3]; 3],
    pub(in crate::cloud) translation: [f64; 3],
    /// fx, fy, cx, cy, skew.
    pub(in crate::cloud) intrinsics: [f64; 5],
    /// The last column and the last row.
    pub(in crate::cloud) last: (f64, f64),
    pub(in crate::cloud) uv: &'a mut [[f64; 2]],
    pub(in crate::cloud) depth: &'a mut [f64],
    pub(in crate::cloud) valid: &'a mut [bool],
}

impl<T: PointSample, const S: usize> Body for ProjectPinhole<'_, T, S> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { points, rotation: [a, b, c], translation: t, .. } = self;
        let [fx, fy, cx, cy, skew] = self.intrinsics;
        let (last_u, last_v) = self.last;
        let count = self.uv.len();
        let points = &points[..count];
        let (uv, depth, valid) = (&mut self.uv[..count], &mut self.depth[..count], &mut self.valid[..count]);
        for i in 0..count {
            let (x, y, z) = (points[i][0].to_f64(), points[i][1].to_f64(), points[i][2].to_f64());
            let right = a[0] * x + a[1] * y + a[2] * z + t[0];
            let down = b[0] * x + b[1] * y + b[2] * z + t[1];
            let ahead = c[0] * x + c[1] * y + c[2] * z + t[2];
            let (x, y) = (right / ahead, down / ahead);
            let (u, v) = (fx * x + skew * y + cx, fy * y + cy);
            let finite = (u.abs() < f64::INFINITY) & (v.abs() < f64::INFINITY);
            let imaged = (ahead > 0.0) & (ahead < f64::INFINITY) & finite;
            uv[i] = [if imaged { u } else { f64::NAN }, if imaged { v } else { f64::NAN }];
            depth[i] = ahead;
            valid[i] = imaged & (u >= 0.0) & (v >= 0.0) & (u <= last_u) & (v <= last_v);
        }
    }
}

/// The same through a lens, with its arithmetic of single points.
pub(in crate::cloud) struct ProjectLens<'a, T, L, const S: usize> {
    pub(in crate::cloud) lens: &'a L,
    pub(in crate::cloud) pinhole: ProjectPinhole<'a, T, S>,
}

impl<T: PointSample, L: Distort, const S: usize> Body for ProjectLens<'_, T, L, S> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { lens, pinhole: own } = self;
        let ProjectPinhole { points, rotation: [a, b, c], translation: t, .. } = own;
        let [fx, fy, cx, cy, skew] = own.intrinsics;
        let (last_u, last_v) = own.last;
        let count = own.uv.len();
        let points = &points[..count];
        let (uv, depth, valid) = (&mut own.uv[..count], &mut own.depth[..count], &mut own.valid[..count]);
        for i in 0..count {
            let (x, y, z) = (points[i][0].to_f64(), points[i][1].to_f64(), points[i][2].to_f64());
            let right = a[0] * x + a[1] * y + a[2] * z + t[0];
            let down = b[0] * x + b[1] * y + b[2] * z + t[1];
            let ahead = c[0] * x + c[1] * y + c[2] * z + t[2];
            let largest = right.abs().max(down.abs()).max(ahead.abs());
            let size = if Lens::takes(largest) { 1.0 } else { largest }; // to divide by 1 changes no bit
            let (x, y) = lens.distort(right / size, down / size, ahead / size);
            let (u, v) = (fx * x + skew * y + cx, fy * y + cy);
            let imaged = (u.abs() < f64::INFINITY) & (v.abs() < f64::INFINITY);
            uv[i] = [if imaged { u } else { f64::NAN }, if imaged { v } else { f64::NAN }];
            depth[i] = ahead;
            valid[i] = imaged & (u >= 0.0) & (v >= 0.0) & (u <= last_u) & (v <= last_v);
        }
    }
}
