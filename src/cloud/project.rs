//! Points to pixels, many at once.

use super::kernels::{self, ProjectLens, ProjectPinhole};
use crate::camera::Camera;
use crate::camera::lens::each_distort;
use crate::error::{CloudError, Error, Result};
use crate::isa::Isa;
use crate::parallel::{self, Work};
use crate::view::{PointSample, Strided};

/// Where points fall on an image, an entry for each.
#[derive(Debug)]
pub struct Projections<'a> {
    /// (u, v) in pixels; NaN where the point has no image.
    pub uv: &'a mut [[f64; 2]],
    /// z in the camera frame, metres.
    pub depth: &'a mut [f64],
    /// In front of the camera and inside the rectangle of pixel centres.
    pub valid: &'a mut [bool],
}

/// Points of one job: enough to be worth handing out.
const CHUNK: usize = 1 << 13;

/// Projects points of the vehicle frame, in float64: what [`Camera::project`] gives for each of them, to the last bit.
///
/// # Errors
/// [`CloudError::PointColumns`], [`CloudError::PointsLength`], [`ThreadsError::Zero`](crate::error::ThreadsError::Zero)
/// and [`IsaError`](crate::error::IsaError), before anything is written.
pub fn project_into<T: PointSample>(
    camera: &Camera,
    points: &Strided<'_, T>,
    out: Projections<'_>,
    threads: Option<usize>,
) -> Result<()> {
    if points.columns() < 3 {
        return Err(Error::Cloud(CloudError::PointColumns { expected: 3, got: points.columns() }));
    }
    let expected = points.rows();
    for (what, got) in [("uv", out.uv.len()), ("depth", out.depth.len()), ("valid", out.valid.len())] {
        if got != expected {
            return Err(Error::Cloud(CloudError::PointsLength { what, expected, got }));
        }
    }
    let (isa, threads) = (Isa::active()?, Work::bytes(expected.saturating_mul(32)).threads(threads)?);
    let outs = out.uv.chunks_mut(CHUNK).zip(out.depth.chunks_mut(CHUNK)).zip(out.valid.chunks_mut(CHUNK));
    parallel::for_each(threads, outs.enumerate(), |(chunk, ((uv, depth), valid))| {
        project_chunk(isa, camera, points, chunk * CHUNK, Projections { uv, depth, valid });
        Ok(())
    })
}

/// Projects the points from `first` on, as many as `out` takes.
pub(super) fn project_chunk<T: PointSample>(
    isa: Isa,
    camera: &Camera,
    points: &Strided<'_, T>,
    first: usize,
    out: Projections<'_>,
) {
    /// Points that lie otherwise than one after the other are brought together, so many at a time.
    const TOGETHER: usize = 128;
    let count = out.uv.len();
    if let Some(points) = points.packed::<3>(first, count) {
        project_dense(isa, camera, points, out);
    } else if let Some(points) = points.packed::<4>(first, count) {
        project_dense(isa, camera, points, out);
    } else {
        let mut together = [[T::default(); 3]; TOGETHER];
        let outs = out.uv.chunks_mut(TOGETHER).zip(out.depth.chunks_mut(TOGETHER)).zip(out.valid.chunks_mut(TOGETHER));
        for (start, ((uv, depth), valid)) in (first..).step_by(TOGETHER).zip(outs) {
            for (i, point) in together[..uv.len()].iter_mut().enumerate() {
                *point = points.first(start + i);
            }
            project_dense(isa, camera, &together[..uv.len()], Projections { uv, depth, valid });
        }
    }
}

fn project_dense<T: PointSample, const S: usize>(
    isa: Isa,
    camera: &Camera,
    points: &[[T; S]],
    Projections { uv, depth, valid }: Projections<'_>,
) {
    let pose = camera.camera_from_vehicle();
    let (width, height) = camera.image_size();
    let body = ProjectPinhole {
        points,
        rotation: super::rows(pose.rotation()),
        translation: (*pose.translation()).into(),
        intrinsics: super::intrinsics(camera),
        last: (f64::from(width - 1), f64::from(height - 1)),
        uv,
        depth,
        valid,
    };
    match camera.lens() {
        None => kernels::run(isa, body),
        Some(lens) => {
            each_distort!(lens, lens: Model => kernels::run(isa, ProjectLens::<_, Model, S> { lens, pinhole: body }))
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::camera::{BrownConrady, DoubleSphere, Eucm, KannalaBrandt, Lens, Mei, Ocam, Pinhole, RadialPolynomial};

    fn camera() -> Camera {
        let model = Pinhole::new(800.3, 700.7, 320.5, 239.5, 3.25).unwrap();
        Camera::from_euler(model, (640, 480), [1.5, -0.25, 1.25], 0.01, 0.07, -0.3).unwrap()
    }

    /// One without and one with every lens, in every form that its loop takes.
    fn cameras() -> Vec<Camera> {
        let brown = [-0.25, 0.08, 1e-3, -2e-3, -0.01, 0.1, 0.02, 1e-3, 3e-3, 1e-3, -2e-3, 2e-3, 0.03, -0.04];
        let mut lenses: Vec<Lens> =
            [5, 8, 12, 14].iter().map(|&n| BrownConrady::new(&brown[..n], None).unwrap().into()).collect();
        lenses.extend::<[Lens; 7]>([
            KannalaBrandt::new(&[0.02, -0.01, 3e-3, -1e-3], None).unwrap().into(),
            Mei::new(1.2, &[-0.1, 0.05, 1e-3, 1e-3], None).unwrap().into(),
            DoubleSphere::new(-0.2, 0.59, None).unwrap().into(),
            DoubleSphere::new(0.97, 0.59, None).unwrap().into(),
            Eucm::new(0.6, 1.1, None).unwrap().into(),
            RadialPolynomial::new(&[1.0, -0.09, 0.14, -0.02], None).unwrap().into(),
            Ocam::new(&[-1.0, 0.0, 0.3, -0.05, 0.02], [1.01, 0.02, -0.01], None).unwrap().into(),
        ]);
        let through = lenses.into_iter().map(|lens| camera().with_lens(Some(lens)));
        std::iter::once(camera()).chain(through).collect()
    }

    /// Points all around, and the awkward ones.
    fn cloud() -> Vec<f64> {
        let mut state = 7u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((state >> 11) as f64 / (1u64 << 53) as f64 - 0.5) * 100.0
        };
        let mut points: Vec<f64> = (0..4 * 20_011).map(|_| random()).collect();
        let awkward = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX, f64::MIN_POSITIVE, 0.0, -0.0, 1e308];
        for (i, &number) in awkward.iter().enumerate() {
            for column in 0..3 {
                points[4 * (17 * i + column) + column] = number;
            }
        }
        points[4 * 500..4 * 500 + 3].copy_from_slice(camera().position().as_slice());
        points
    }

    #[test]
    fn every_instruction_set_equals_one_point_at_a_time() {
        let data = cloud();
        let bits = |pixel: [f64; 2], depth: f64, valid| {
            let bits = |number: f64| if number.is_nan() { u64::MAX } else { number.to_bits() };
            (pixel.map(bits), bits(depth), valid)
        };
        let backwards = Strided::with_strides(&data, (20_011, 4), data.len() - 4, (-4, 1)).unwrap();
        let packed = Strided::new(&data[..3 * 20_011], 3).unwrap();
        let columns = Strided::with_strides(&data, (20_011, 3), 0, (1, 20_011)).unwrap();
        for (camera, points) in cameras().iter().flat_map(|camera| {
            [Strided::new(&data, 4).unwrap(), packed, backwards, columns].map(|points| (camera, points))
        }) {
            let expected: Vec<_> = (0..points.rows())
                .map(|i| {
                    let row: [f64; 3] = points.first(i);
                    let one = camera.project(&Vector3::new(row[0], row[1], row[2]));
                    bits(one.pixel, one.depth, one.valid)
                })
                .collect();
            assert!(expected.iter().any(|one| one.2) && expected.iter().any(|one| !one.2));
            for &isa in Isa::available() {
                for (first, count) in [(0, points.rows()), (3, 0), (5, 1), (11, 1023)] {
                    let (mut uv, mut depth, mut valid) = (vec![[0.0; 2]; count], vec![0.0; count], vec![false; count]);
                    let out = Projections { uv: &mut uv, depth: &mut depth, valid: &mut valid };
                    project_chunk(isa, camera, &points, first, out);
                    let got: Vec<_> = (0..count).map(|i| bits(uv[i], depth[i], valid[i])).collect();
                    assert!(got == expected[first..first + count], "{:?} {isa:?} {first} {count}", camera.lens());
                }
            }
        }
    }

    #[test]
    fn refuses_outputs_of_other_lengths() {
        let points = Strided::new(&[1.0f32; 9], 3).unwrap();
        let (mut uv, mut depth, mut valid) = ([[0.0; 2]; 3], [0.0; 2], [false; 3]);
        let out = Projections { uv: &mut uv, depth: &mut depth, valid: &mut valid };
        let got = project_into(&camera(), &points, out, None);
        assert_eq!(got, Err(Error::Cloud(CloudError::PointsLength { what: "depth", expected: 3, got: 2 })));
    }
}
