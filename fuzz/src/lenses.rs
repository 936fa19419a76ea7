//! Lenses of any coefficients, to the image and back: bounded work, finite answers, and the way back leads home.

use std::f64::consts::PI;

use ipm_rs::cloud::{Projections, project_into};
use ipm_rs::view::Strided;
use ipm_rs::{
    BevGrid, BrownConrady, Cylindrical, Division, DoubleSphere, Equirectangular, Eucm, FTheta, FThetaForm, Fov, Ground,
    InverseBrownConrady, KannalaBrandt, Lens, Lut, Mei, Ocam, RadialPolynomial, SampleAt, ThinPrismFisheye,
};

use crate::input::Input;
use crate::uses;

pub fn run(data: &[u8]) {
    let mut input = Input::new(data);
    let Some(lens) = lens(&mut input) else { return };
    let end = lens.max_angle();
    assert!(end > 0.0 && end <= PI, "{lens} ends at {end}");
    assert!(!lens.to_string().is_empty());
    for _ in 0..4 {
        let direction = input.vector(10.0);
        if let Some(seen) = lens.project(&direction) {
            assert!(seen.iter().all(|number| number.is_finite()), "{lens} has {direction} at {seen:?}");
            // scaled first: near float64's end the distance from the axis is beyond it
            let scaled = direction / direction.amax();
            let angle = scaled.x.hypot(scaled.y).atan2(scaled.z);
            assert!(angle <= end + 1e-7, "{lens} has an image of {direction}, {angle} from its axis");
            back(&lens, seen);
        }
        back(&lens, input.point(2.0));
    }
    let Some(camera) = input.camera(lens) else { return };
    let points: Vec<f64> = input.numbers(3 * 9, 30.0);
    let (mut uv, mut depth, mut valid) = ([[0.0; 2]; 9], [0.0; 9], [false; 9]);
    let out = Projections { uv: &mut uv, depth: &mut depth, valid: &mut valid };
    project_into(&camera, &Strided::new(&points, 3).expect("nine points"), out, None).expect("nine places");
    for (i, point) in points.chunks(3).enumerate() {
        let one = camera.project(&nalgebra::Vector3::new(point[0], point[1], point[2]));
        assert_eq!(one.valid, valid[i], "{camera} and {point:?}");
        let near = |a: f64, b: f64| a == b || a.is_nan() && b.is_nan() || (a - b).abs() <= 1e-9 * a.abs().max(1.0);
        assert!(near(one.pixel[0], uv[i][0]) && near(one.pixel[1], uv[i][1]), "{camera} and {point:?}: {one:?} {uv:?}");
    }
    let grid = BevGrid::new((-3.0, 9.0), (-4.0, 4.0), (1.0, 0.5), SampleAt::Center).expect("whole cells");
    if let Ok(lut) = Lut::new(&camera, &grid, &Ground::default()) {
        lut.plausibility();
        let map = lut.maps(f32::NAN).expect("memory");
        for (cell, valid) in lut.mask().expect("memory").into_iter().enumerate() {
            let (row, column) = (cell / grid.columns(), cell % grid.columns());
            let one = camera.project_ground(grid.ground_from_cell([row as f64, column as f64]), &Ground::default());
            let near = |at: f32, exact: f64| (f64::from(at) - exact).abs() < 0.01;
            if valid {
                assert!(
                    near(map.0[cell], one.pixel[0]) && near(map.1[cell], one.pixel[1]),
                    "{camera}: {cell}, {one:?}"
                );
            }
        }
        uses::everything(&lut, &mut input);
    }
    let _ = camera.plausibility();
    let pixel = input.point(64.0);
    if let Some(point) = camera.ground_from_pixel(pixel, &Ground::default()) {
        assert!(point.iter().all(|number| number.is_finite()), "{camera} sees {point} at {pixel:?}");
    }
    camera.range_error(pixel, &Ground::default(), 1.0, 0.01);
}

/// The way back from a place on the lens's plane, if there is one, leads to where that place is.
fn back(lens: &Lens, seen: [f64; 2]) {
    let Some(ray) = lens.unproject(seen) else { return };
    assert!((ray.norm() - 1.0).abs() < 1e-12, "{lens} has {ray} at {seen:?}");
    assert!(lens.project(&ray).is_some(), "{lens} looks along {ray} at {seen:?} and has no image of it");
}

fn lens(input: &mut Input<'_>) -> Option<Lens> {
    let limit = match input.byte() {
        0..180 => None,
        180..240 => Some(input.tame(1.6).abs()),
        _ => Some(input.number(4.0)),
    };
    // small numbers as lenses have, or anything
    let scale = input.one_of(&[0.01, 0.1, 1.0, 30.0]);
    let affine = |input: &mut Input<'_>| match input.byte() {
        0..160 => [1.0, 0.0, 0.0],
        160..240 => [1.0 + input.tame(0.1), input.tame(0.1), input.tame(0.1)],
        _ => [input.number(2.0), input.number(2.0), input.number(2.0)],
    };
    // what is given in pixels begins with a focal length, most of the time
    let pixels = |input: &mut Input<'_>, count: usize, first: f64| {
        let mut numbers = input.numbers(count, scale);
        if input.byte() < 240 {
            numbers[0] = first * (1.0 + input.tame(0.5));
        }
        numbers
    };
    match input.byte() % 14 {
        0 => {
            let count = input.one_of(&[4, 5, 8, 12, 14]);
            BrownConrady::new(&input.numbers(count, scale), limit).ok().map(Lens::from)
        }
        1 => KannalaBrandt::new(&input.numbers(4, scale), limit).ok().map(Lens::from),
        2 => Mei::new(input.number(2.0), &input.numbers(4, scale), limit).ok().map(Lens::from),
        3 => DoubleSphere::new(input.number(1.0), input.number(1.0), limit).ok().map(Lens::from),
        4 => Eucm::new(input.number(1.0), input.number(2.0), limit).ok().map(Lens::from),
        5 => RadialPolynomial::new(&pixels(input, 4, 30.0), limit).ok().map(Lens::from),
        6 => {
            let count = input.count(1, 12);
            let polynomial = pixels(input, count, -30.0);
            Ocam::new(&polynomial, affine(input), limit).ok().map(Lens::from)
        }
        7 => {
            let count = input.count(1, 11);
            let form = input.one_of(&[FThetaForm::Forward, FThetaForm::Backward]);
            let first = if form == FThetaForm::Forward { 30.0 } else { 0.03 };
            let polynomial = [vec![0.0], pixels(input, count, first)].concat();
            FTheta::new(&polynomial, form, affine(input), limit).ok().map(Lens::from)
        }
        8 => Fov::new(input.number(3.0), limit).ok().map(Lens::from),
        9 => Division::new(input.number(scale), limit).ok().map(Lens::from),
        10 => {
            let count = input.one_of(&[4, 5]);
            InverseBrownConrady::new(&input.numbers(count, scale), limit).ok().map(Lens::from)
        }
        11 => {
            let count = input.one_of(&[4, 8, 12, 16]);
            ThinPrismFisheye::new(&input.numbers(count, scale), limit).ok().map(Lens::from)
        }
        12 => Cylindrical::new(limit).ok().map(Lens::from),
        _ => Equirectangular::new(limit).ok().map(Lens::from),
    }
}
