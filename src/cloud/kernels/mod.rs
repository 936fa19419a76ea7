//! The loops that a cloud spends its time in, as plain Rust without branches: the compiler makes vectors of them for
//! each instruction set (decision 0005). Nothing is fused or reordered, so all give the same answers to the last bit.

mod decode;
mod points;
mod project;

pub(super) use decode::{Decode, Encode};
pub(super) use points::{PinholePoints, PinholeRays, Planar, PointsRow, Rotate, Unit};
pub(super) use project::{ProjectLens, ProjectPinhole};

pub(super) use crate::isa::{Body, run};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::isa::Isa;
    use crate::view::{DepthSample, PointSample};

    /// Numbers in between, and the awkward ones.
    fn numbers(count: usize) -> impl Iterator<Item = f64> {
        let mut state = 99u64;
        let awkward = [f64::NAN, f64::INFINITY, -1.0, 0.0, -0.0, 1e-300, 1e300, 0.9, 1000.0];
        (0..count).map(move |i| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let random = (state >> 11) as f64 / (1u64 << 53) as f64;
            if i % 7 == 3 { awkward[(state >> 40) as usize % awkward.len()] } else { random * 1000.0 }
        })
    }

    fn bits<T: DepthSample>(values: &[T]) -> Vec<u64> {
        let bits = |value: f64| if value.is_nan() { u64::MAX } else { value.to_bits() };
        values.iter().map(|&value| bits(value.to_f64())).collect()
    }

    /// What `run` gives under every instruction set, which must be one and the same.
    fn agree<R: PartialEq>(what: &str, run: impl Fn(Isa) -> R) {
        let scalar = run(Isa::Scalar);
        for &isa in Isa::available() {
            assert!(run(isa) == scalar, "{what} under {isa:?}");
        }
    }

    #[test]
    fn every_instruction_set_decodes_and_encodes_alike() {
        let bytes: Vec<u8> = numbers(4 * 133).map(|number| (number * 61.0) as u8).collect();
        let depths: Vec<f64> = numbers(133).collect();
        for width in (0..20).chain([31, 32, 33, 63, 64, 65, 133]) {
            agree("decode", |isa| {
                let (mut four, mut three) = (vec![0f32; width], vec![0f32; width]);
                run(isa, Decode::<4, false> { pixels: &bytes, scale: 1e-3, out: &mut four });
                run(isa, Decode::<3, true> { pixels: &bytes, scale: 1e-3, out: &mut three });
                (bits(&four), bits(&three))
            });
            agree("encode", |isa| {
                let (mut four, mut three) = (vec![0u8; 4 * width], vec![0u8; 3 * width]);
                let numbers = &depths[..width];
                let fine = run(isa, Encode::<f64, 4, false> { numbers, scale: 16777.215, out: &mut four });
                run(isa, Encode::<f64, 3, true> { numbers, scale: 16777.215, out: &mut three });
                assert_eq!(fine, numbers.iter().all(|&number| number >= 0.0));
                (four, three, fine)
            });
        }
    }

    fn points_of_a_row<T: DepthSample, O: PointSample>(isa: Isa, depth: &[T], row: f64) -> Vec<Vec<u64>> {
        let width = depth.len();
        let mut results = vec![];
        for (unit, planar, turned) in [(false, false, false), (true, false, true), (false, true, true)] {
            let (mut xs, mut ys, mut zs) = (vec![0.0; width], vec![0.0; width], vec![0.0; width]);
            let intrinsics = [421.5, 400.25, 63.75, 30.5, 1.25];
            run(isa, PinholeRays { columns: (0.0, 2.0), row, intrinsics, rays: [&mut xs, &mut ys, &mut zs] });
            if unit {
                run(isa, Unit([&mut xs, &mut ys, &mut zs]));
            }
            if turned {
                let rotation = [[0.6, -0.8, 0.01], [0.8, 0.6, 0.02], [-0.02, 0.01, 0.99]];
                run(isa, Rotate { rays: [&mut xs, &mut ys, &mut zs], rotation });
            }
            if planar {
                zs.iter_mut().step_by(3).for_each(|z| *z -= 1.0);
                run(isa, Planar([&mut xs, &mut ys, &mut zs]));
            }
            let mut out = vec![O::default(); 3 * width];
            let (limits, origin) = ((0.9, 900.0), [1.0, -2.0, 0.1]);
            run(isa, PointsRow { depth, scale: 0.97, limits, rays: [&xs, &ys, &zs], origin, out: &mut out });
            results.extend([bits(&xs), bits(&ys), bits(&zs), bits(&out)]);
        }
        results
    }

    #[test]
    fn every_instruction_set_makes_the_same_points() {
        for width in (0..20).chain([31, 32, 33, 63, 64, 65, 133]) {
            let doubles: Vec<f64> = numbers(width).collect();
            let floats: Vec<f32> = doubles.iter().map(|&number| number as f32).collect();
            let shorts: Vec<u16> = doubles.iter().map(|&number| number as u16).collect();
            for row in [0.0, 17.0] {
                agree("f64 to f64", |isa| points_of_a_row::<f64, f64>(isa, &doubles, row));
                agree("f32 to f32", |isa| points_of_a_row::<f32, f32>(isa, &floats, row));
                agree("u16 to f32", |isa| points_of_a_row::<u16, f32>(isa, &shorts, row));
                agree("f64 to f32", |isa| points_of_a_row::<f64, f32>(isa, &doubles, row));
            }
        }
    }
}
