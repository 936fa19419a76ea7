//! Rays and depth to points.

use super::Body;
use crate::view::{DepthSample, PointSample};

/// Three coordinates of the rays of a row, each an array of its own.
pub(in crate::cloud) type Rays<'a> = [&'a mut [f64]; 3];

/// Rays of length one instead of z = 1.
pub(in crate::cloud) struct Unit<'a>(pub(in crate::cloud) Rays<'a>);

impl Body for Unit<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let [xs, ys, zs] = self.0;
        let count = xs.len();
        let (ys, zs) = (&mut ys[..count], &mut zs[..count]);
        for i in 0..count {
            let (x, y, z) = (xs[i], ys[i], zs[i]);
            let length = (x * x + y * y + z * z).sqrt();
            xs[i] = x / length;
            ys[i] = y / length;
            zs[i] = z / length;
        }
    }
}

/// Rays turned by a rotation, given row by row.
pub(in crate::cloud) struct Rotate<'a> {
    pub(in crate::cloud) rays: Rays<'a>,
    pub(in crate::cloud) rotation: [[f64; 3]; 3],
}

impl Body for Rotate<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let [xs, ys, zs] = self.rays;
        let count = xs.len();
        let (ys, zs) = (&mut ys[..count], &mut zs[..count]);
        let [a, b, c] = self.rotation;
        for i in 0..count {
            let (x, y, z) = (xs[i], ys[i], zs[i]);
            xs[i] = a[0] * x + a[1] * y + a[2] * z;
            ys[i] = b[0] * x + b[1] * y + b[2] * z;
            zs[i] = c[0] * x + c[1] * y + c[2] * z;
        }
    }
}

/// Points of one row: `ray * depth + origin`, NaN where the depth is not positive, finite and within the limits.
pub(in crate::cloud) struct PointsRow<'a, T, O> {
    pub(in crate::cloud) depth: &'a [T],
    /// Metres per unit of depth.
    pub(in crate::cloud) scale: f64,
    /// Nearest and farthest depth that is kept, both finite.
    pub(in crate::cloud) limits: (f64, f64),
    pub(in crate::cloud) rays: [&'a [f64]; 3],
    pub(in crate::cloud) origin: [f64; 3],
    /// x, y, z of each point.
    pub(in crate::cloud) out: &'a mut [O],
}

impl<T: DepthSample, O: PointSample> Body for PointsRow<'_, T, O> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { depth, scale, limits, rays: [xs, ys, zs], origin, out } = self;
        let count = depth.len();
        let (xs, ys, zs) = (&xs[..count], &ys[..count], &zs[..count]);
        fill(depth, scale, limits, |i| [xs[i], ys[i], zs[i]], origin, out);
    }
}

/// [`PointsRow`] of planar depth through a pinhole: of the rays and their rotation only what changes along the row is worked
/// out, in the order of [`PinholeRays`] and [`Rotate`], so that no bit changes.
pub(in crate::cloud) struct PinholePoints<'a, T, O> {
    pub(in crate::cloud) depth: &'a [T],
    /// As for [`PointsRow`], and likewise the limits.
    pub(in crate::cloud) scale: f64,
    pub(in crate::cloud) limits: (f64, f64),
    /// x of the rays with z = 1.
    pub(in crate::cloud) columns: &'a [f64],
    /// Their y.
    pub(in crate::cloud) y: f64,
    /// None for the optical frame.
    pub(in crate::cloud) rotation: Option<[[f64; 3]; 3]>,
    pub(in crate::cloud) origin: [f64; 3],
    /// x, y, z of each point.
    pub(in crate::cloud) out: &'a mut [O],
}

impl<T: DepthSample, O: PointSample> Body for PinholePoints<'_, T, O> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { depth, scale, limits, columns, y, rotation, origin, out } = self;
        let columns = &columns[..depth.len()];
        match rotation {
            None => fill(depth, scale, limits, |i| [columns[i], y, 1.0], origin, out),
            Some([a, b, c]) => {
                let down = [a[1] * y, b[1] * y, c[1] * y];
                let ray = |i: usize| {
                    let x = columns[i];
                    [a[0] * x + down[0] + a[2], b[0] * x + down[1] + b[2], c[0] * x + down[2] + c[2]]
                };
                fill(depth, scale, limits, ray, origin, out);
            }
        }
    }
}

/// Points of a row whose i-th ray is `ray(i)`.
///
/// Each axis goes to an array of its own first, of so many points at a time: of loops that write three numbers to each
/// point and do sums in float64 as well, the compiler makes no vectors.
#[inline(always)]
fn fill<T: DepthSample, O: PointSample>(
    depth: &[T],
    scale: f64,
    (nearest, farthest): (f64, f64),
    ray: impl Fn(usize) -> [f64; 3],
    origin: [f64; 3],
    out: &mut [O],
) {
    const BLOCK: usize = 128;
    let out = &mut out.as_chunks_mut::<3>().0[..depth.len()];
    let [mut xs, mut ys, mut zs] = [[O::default(); BLOCK]; 3];
    for (block, (depth, out)) in depth.chunks(BLOCK).zip(out.chunks_mut(BLOCK)).enumerate() {
        let count = depth.len();
        for i in 0..count {
            let metres = depth[i].to_f64() * scale;
            let kept = (metres > 0.0) & (metres >= nearest) & (metres <= farthest);
            let metres = if kept { metres } else { f64::NAN };
            let [x, y, z] = ray(block * BLOCK + i);
            xs[i] = O::from_f64(x * metres + origin[0]);
            ys[i] = O::from_f64(y * metres + origin[1]);
            zs[i] = O::from_f64(z * metres + origin[2]);
        }
        for (i, point) in out.iter_mut().enumerate() {
            *point = [xs[i], ys[i], zs[i]];
        }
    }
}

/// The rays of a row of pixels through a pinhole, with z = 1; the arithmetic of `Pinhole::ray`, operation for operation.
pub(in crate::cloud) struct PinholeRays<'a> {
    /// Column of the first pixel and columns from one to the next.
    pub(in crate::cloud) columns: (f64, f64),
    pub(in crate::cloud) row: f64,
    /// fx, fy, cx, cy, skew.
    pub(in crate::cloud) intrinsics: [f64; 5],
    pub(in crate::cloud) rays: Rays<'a>,
}

impl Body for PinholeRays<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let [fx, fy, cx, cy, skew] = self.intrinsics;
        let (first, step) = self.columns;
        let [xs, ys, zs] = self.rays;
        let y = (self.row - cy) / fy;
        let sheared = skew * y;
        for (i, x) in xs.iter_mut().enumerate() {
            // below 2^31: an image has fewer than 2^32 pixels in both directions together
            let u = first + step * f64::from(i as i32);
            *x = (u - cx - sheared) / fx;
        }
        ys.fill(y);
        zs.fill(1.0);
    }
}

/// Rays with z = 1, as planar depth asks for; NaN for what lies 90 degrees or more off the axis.
pub(in crate::cloud) struct Planar<'a>(pub(in crate::cloud) Rays<'a>);

impl Body for Planar<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let [xs, ys, zs] = self.0;
        let count = xs.len();
        let (ys, zs) = (&mut ys[..count], &mut zs[..count]);
        for i in 0..count {
            let z = if zs[i] > 0.0 { zs[i] } else { f64::NAN };
            xs[i] /= z;
            ys[i] /= z;
            zs[i] = if z > 0.0 { 1.0 } else { f64::NAN };
        }
    }
}
