//! Coordinates of a row under a projective map: a pinhole camera and a plane, or a homography.

use nalgebra::Vector3;

use crate::isa::{Isa, for_each_isa};

/// `(u, v) = (q.x / q.z, q.y / q.z)` with `q = origin + step * t`, along a row of the output.
pub(crate) struct ProjectiveRow {
    /// q where t is 0.
    pub(crate) origin: Vector3<f64>,
    /// How q grows with t.
    pub(crate) step: Vector3<f64>,
    /// Whether points with `q.z <= 0` lie behind a camera and have no image.
    pub(crate) culled: bool,
}

impl ProjectiveRow {
    /// Writes u and v for each t; NaN or what is outside every image where there is no image.
    pub(crate) fn fill(&self, isa: Isa, ts: &[f64], us: &mut [f64], vs: &mut [f64]) {
        let row = self;
        for_each_isa!(isa, (body, body, body)(row: &ProjectiveRow, ts: &[f64], us: &mut [f64], vs: &mut [f64]));
    }
}

#[inline(always)]
fn body(row: &ProjectiveRow, ts: &[f64], us: &mut [f64], vs: &mut [f64]) {
    let (a, b) = (row.origin, row.step);
    // where nothing is culled every z passes, NaN aside
    let behind = if row.culled { 0.0 } else { f64::NEG_INFINITY };
    let cells = ts.len();
    let (us, vs) = (&mut us[..cells], &mut vs[..cells]);
    for i in 0..cells {
        let t = ts[i];
        let z = a.z + b.z * t;
        let scale = if z > behind { 1.0 / z } else { f64::NAN };
        us[i] = (a.x + b.x * t) * scale;
        vs[i] = (a.y + b.y * t) * scale;
    }
}
