//! Roads of any heights, rays from anywhere, and tables of cameras above them.

use std::sync::Arc;

use ipm_rs::{BevGrid, Ground, HeightMap, Lut, Plane, SampleAt};

use crate::input::Input;
use crate::uses;

pub fn run(data: &[u8]) {
    let mut input = Input::new(data);
    let Some(ground) = ground(&mut input) else { return };
    for _ in 0..6 {
        let (eye, direction) = (input.vector(12.0), input.vector(3.0));
        let met = ground.intersect(&eye, &direction);
        if let Some(met) = met {
            assert!(met.iter().all(|number| number.is_finite()), "{eye} along {direction} meets {met}");
            let height = ground.height_at(met.x, met.y);
            // a map ends where it ends but for rounding, so there it may be unknown
            let size = 1.0 + met.norm() + eye.norm() + height.abs();
            assert!(
                !((height - met.z).abs() > 1e-6 * size),
                "{eye} along {direction} meets {met}, the road is at {height}"
            );
            ground.hides(&eye, &met);
        }
        ground.hides(&eye, &direction);
    }
    let Some(camera) = input.camera(None) else { return };
    let grid = BevGrid::new((-3.0, 9.0), (-4.0, 4.0), (1.0, 0.5), SampleAt::Center).expect("whole cells");
    let Ok(lut) = Lut::new(&camera, &grid, &ground) else { return };
    lut.plausibility();
    uses::everything(&lut, &mut input);
    let pixel = input.point(64.0);
    camera.ground_from_pixel(pixel, &ground);
    camera.range_error(pixel, &ground, 1.0, 0.01);
    if let Ground::Plane(plane) = &ground {
        let _ = camera.horizon(plane, 0.5);
    }
    let corners = [input.point(12.0), input.point(12.0), input.point(12.0)];
    let _ = camera.project_ground_polyline(&corners, &ground, 10.0, 0.5);
}

fn ground(input: &mut Input<'_>) -> Option<Ground> {
    match input.byte() {
        0..40 => {
            let plane = Plane::from_coefficients(input.number(1.0), input.number(1.0), input.number(2.0));
            Some(Ground::Plane(plane.ok()?))
        }
        40..50 => Ground::height(input.number(3.0)).ok(),
        50..60 => {
            let numbers = input.numbers(6, 2.0);
            let plane = Plane::new([numbers[0], numbers[1], numbers[2]], [numbers[3], numbers[4], numbers[5]]);
            Some(Ground::Plane(plane.ok()?))
        }
        kind => {
            let (rows, columns) = (input.count(2, 9), input.count(2, 9));
            let heights = (0..rows * columns).map(|_| match input.byte() {
                0 => f64::NAN,
                byte @ 1..240 => f64::from(byte as i8) / 100.0,
                _ => input.number(5.0),
            });
            let heights = heights.collect();
            let (origin, spacing) = if kind < 230 {
                ([input.tame(8.0), input.tame(8.0)], [input.tame(3.0), input.tame(3.0)])
            } else {
                (input.point(8.0), input.point(3.0))
            };
            let map = HeightMap::new(heights, columns, origin.into(), spacing.into());
            Some(Ground::HeightMap(Arc::new(map.ok()?)))
        }
    }
}
