//! Points drawn as an image, against a loop over all of them, and two published functions, against their own arithmetic.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should say so")]
#[path = "common/isas.rs"]
mod isas;

use ipm_rs::cloud::{
    CarlaDepth, ChannelOrder, DepthKind, DepthRows, NO_POINT, RenderOptions, carla_084_points, depth_to_lidar,
    paint_into, render_points_into,
};
use ipm_rs::error::{CloudError, Error, ViewError};
use ipm_rs::raster::Coordinates;
use ipm_rs::view::Strided;
use ipm_rs::{Camera, ImageView, ImageViewMut, Isa, Pinhole};
use isas::Random;
use nalgebra::{Matrix3, Vector3};

const SIZE: (usize, usize) = (64, 40);

fn camera() -> Camera {
    let model = Pinhole::new(50.0, 52.0, 30.7, 19.2, 0.4).unwrap();
    Camera::from_euler(model, (SIZE.0 as u32, SIZE.1 as u32), [1.5, -0.2, 1.4], 0.02, 0.2, 0.1).unwrap()
}

/// Points around the vehicle, some of them behind the camera, many on the same pixel and a few that are none.
fn points(count: usize) -> Vec<[f64; 3]> {
    let mut random = Random::new(7);
    let mut between = |least: f64, most: f64| least + (most - least) * random.unit();
    let mut points: Vec<_> =
        (0..count).map(|_| [between(-8.0, 20.0), between(-7.0, 7.0), between(-0.5, 4.0)]).collect();
    points[3] = [f64::NAN, 1.0, 1.0];
    points[4] = [9.0, f64::INFINITY, 1.0];
    // the same place twice: the first is drawn
    points[count - 1] = points[5];
    points
}

struct Drawn {
    depth: Vec<f32>,
    index: Vec<i64>,
}

fn draw(points: &[[f64; 3]], options: &RenderOptions) -> Result<Drawn, Error> {
    let (mut depth, mut index) = (vec![7.0; SIZE.0 * SIZE.1], vec![7; SIZE.0 * SIZE.1]);
    let table = Strided::new(points.as_flattened(), 3)?;
    let drawn = render_points_into(
        &camera(),
        &table,
        options,
        &mut ImageViewMut::new(&mut depth, SIZE, 1)?,
        &mut ImageViewMut::new(&mut index, SIZE, 1)?,
    );
    if drawn.is_err() {
        assert!(depth.iter().all(|&depth| depth == 7.0) && index.iter().all(|&index| index == 7), "nothing half done");
    }
    drawn.map(|()| Drawn { depth, index })
}

/// The definition: every pixel asks every point.
fn expected(points: &[[f64; 3]], options: &RenderOptions) -> Drawn {
    let camera = camera();
    let seen: Vec<(f64, f64, f64, usize)> = (points.iter().enumerate())
        .filter_map(|(index, &point)| {
            let at = camera.project(&Vector3::from(point));
            let distance = match options.kind {
                DepthKind::Planar => at.depth,
                DepthKind::Ray => (Vector3::from(point) - camera.position()).norm(),
            };
            let drawn = at.depth > 0.0 && at.pixel.iter().all(|number| number.is_finite());
            (drawn && (options.min_depth..=options.max_depth).contains(&distance)).then_some((
                at.pixel[0].round_ties_even(),
                at.pixel[1].round_ties_even(),
                distance,
                index,
            ))
        })
        .collect();
    let (mut depth, mut index) = (Vec::new(), Vec::new());
    for (x, y) in (0..SIZE.1).flat_map(|y| (0..SIZE.0).map(move |x| (x as f64, y as f64))) {
        let covering = seen.iter().filter(|(u, v, ..)| (u - x).hypot(v - y) <= options.radius);
        let nearest = covering.min_by(|a, b| (a.2 as f32).total_cmp(&(b.2 as f32)).then(a.3.cmp(&b.3)));
        depth.push(nearest.map_or(f32::NAN, |point| point.2 as f32));
        index.push(nearest.map_or(NO_POINT, |point| point.3 as i64));
    }
    Drawn { depth, index }
}

#[test]
fn each_pixel_has_the_nearest_of_the_points_that_cover_it() {
    let points = points(3000);
    for (kind, radius, limits) in [
        (DepthKind::Planar, 0.0, (0.0, f64::INFINITY)),
        (DepthKind::Ray, 0.0, (0.0, f64::INFINITY)),
        (DepthKind::Planar, 1.0, (3.0, 15.0)),
        (DepthKind::Ray, 1.5, (3.0, 15.0)),
        (DepthKind::Planar, 3.7, (0.0, 9.0)),
    ] {
        let options =
            RenderOptions { kind, radius, min_depth: limits.0, max_depth: limits.1, ..RenderOptions::default() };
        let expected = expected(&points, &options);
        let (empty, shown) = (expected.index.iter().filter(|&&index| index == NO_POINT).count(), SIZE.0 * SIZE.1);
        assert!(empty > 0 && empty < shown - 300, "{options:?}: {empty}");
        for threads in [1, 3] {
            let drawn = draw(&points, &RenderOptions { threads: Some(threads), ..options }).unwrap();
            assert_eq!(drawn.index, expected.index, "{options:?}");
            for (got, expected) in drawn.depth.iter().zip(&expected.depth) {
                let same = (got - expected).abs() <= 1e-6 * expected || (got.is_nan() && expected.is_nan());
                assert!(same, "{got} {expected}");
            }
        }
    }
}

#[test]
fn what_cannot_be_drawn_is_an_error_and_touches_nothing() {
    let points = points(100);
    let limit = |options: RenderOptions| match draw(&points, &options) {
        Err(Error::Cloud(CloudError::DepthLimit { what, .. })) => what,
        other => panic!("{:?}", other.map(|drawn| drawn.depth)),
    };
    let plain = RenderOptions::default();
    for radius in [-0.5, f64::NAN, 65.0] {
        assert_eq!(limit(RenderOptions { radius, ..plain }), "radius");
    }
    for min_depth in [-1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(limit(RenderOptions { min_depth, ..plain }), "min_depth");
    }
    for max_depth in [0.0, f64::NAN] {
        assert_eq!(limit(RenderOptions { max_depth, ..plain }), "max_depth");
    }
    assert!(matches!(draw(&points, &RenderOptions { threads: Some(0), ..plain }), Err(Error::Threads(_))));

    let (mut depth, mut index) = (vec![7.0; SIZE.0 * SIZE.1], vec![7; SIZE.0 * SIZE.1]);
    let flat = Strided::new(points.as_flattened(), 2).unwrap();
    let refused = render_points_into(
        &camera(),
        &flat,
        &plain,
        &mut ImageViewMut::new(&mut depth, SIZE, 1).unwrap(),
        &mut ImageViewMut::new(&mut index, SIZE, 1).unwrap(),
    );
    assert_eq!(refused, Err(Error::Cloud(CloudError::PointColumns { expected: 3, got: 2 })));
    let table = Strided::new(points.as_flattened(), 3).unwrap();
    let refused = render_points_into(
        &camera(),
        &table,
        &plain,
        &mut ImageViewMut::new(&mut depth, (SIZE.1, SIZE.0), 1).unwrap(),
        &mut ImageViewMut::new(&mut index, SIZE, 1).unwrap(),
    );
    assert!(matches!(refused, Err(Error::View(ViewError::OutputShape { .. }))));
}

/// What a caller names without having looked for it is the plain one.
#[test]
fn rows_are_decoded_also_with_an_instruction_set_that_the_cpu_lacks() {
    let image: Vec<u8> = (0..4 * 40).map(|k| (k * 37 % 251) as u8).collect();
    let image = ImageView::new(&image, (40, 1), 4).unwrap();
    let depth = CarlaDepth::new(&image, ChannelOrder::Bgra).unwrap();
    let mut rooms = [vec![0f32; 40], vec![0f32; 40]];
    let points: Vec<f64> = (0..90).map(f64::from).collect();
    let table = Strided::new(&points, 3).unwrap();
    for isa in [Isa::Scalar, Isa::Avx2, Isa::Avx512, Isa::Neon] {
        let [first, room] = &mut rooms;
        let decoded = depth.row(isa, 0, room).to_vec();
        if isa == Isa::Scalar {
            first.clone_from(&decoded);
        }
        assert_eq!(&decoded, first, "{isa:?}");
        let [mut x, mut y, mut z] = [[0.0; 30]; 3];
        table.load(isa, 0, [&mut x, &mut y, &mut z]);
        assert!((0..30).all(|i| [x[i], y[i], z[i]] == [0, 1, 2].map(|axis| f64::from(3 * i as u32 + axis))), "{isa:?}");
    }
}

#[test]
fn an_index_is_painted_with_the_values_that_it_names() {
    // -1 names nothing, nor do 3 and what is far beyond
    let index = [0, 2, -1, 3, 1, i64::MIN, i64::MAX, 2];
    let index = ImageView::new(&index, (4, 2), 1).unwrap();
    let values = [10u8, 11, 20, 21, 30, 31];
    let values = ImageView::new(&values, (1, 3), 2).unwrap();
    for threads in [1, 2] {
        let mut out = [0; 16];
        let mut view = ImageViewMut::new(&mut out, (4, 2), 2).unwrap();
        paint_into(&index, Some(&values), &[1, 2], &mut view, Some(threads)).unwrap();
        assert_eq!(out, [10, 11, 30, 31, 1, 2, 1, 2, 20, 21, 1, 2, 1, 2, 30, 31]);
    }
    let mut out = [0.5f32; 8];
    let mut view = ImageViewMut::new(&mut out, (4, 2), 1).unwrap();
    paint_into(&index, None, &[f32::INFINITY], &mut view, None).unwrap();
    assert_eq!(out, [f32::INFINITY; 8], "nothing to name");

    let mut out = [9u8; 16];
    let mut view = ImageViewMut::new(&mut out, (4, 2), 2).unwrap();
    let border = paint_into(&index, Some(&values), &[1], &mut view, None);
    assert_eq!(border, Err(Error::View(ViewError::BorderChannels { expected: 2, got: 1 })));
    let mut view = ImageViewMut::new(&mut out, (2, 4), 2).unwrap();
    let shape = paint_into(&index, Some(&values), &[1, 2], &mut view, None);
    assert_eq!(shape, Err(Error::View(ViewError::OutputShape { expected: (2, 4, 2), got: (4, 2, 2) })));
    assert_eq!(out, [9; 16]);
}

/// Both published functions, as they are written: numbers of the reversed row and column, through the inverse of K.
#[test]
fn published_functions_give_what_they_publish() {
    let (width, height) = (5, 3);
    let k = Matrix3::new(4.0, 0.0, 2.5, 0.0, 4.0, 1.5, 0.0, 0.0, 1.0);
    let mut normalized: Vec<f64> = (0..width * height).map(|k| 0.001 * (k + 1) as f64).collect();
    normalized[2] = 0.9;
    normalized[11] = 0.008; // the limit itself
    let view = ImageView::new(&normalized, (width, height), 1).unwrap();
    let (limit, pixels) = (0.008, width * height);
    let point = |index: usize, depth: f64| {
        let (u, v) = ((width - 1 - index % width) as f64, (height - 1 - index / width) as f64);
        [depth * (u - 2.5) / 4.0, depth * (v - 1.5) / 4.0, depth]
    };
    let close = |got: [f64; 3], expected: [f64; 3]| got.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12);

    let (points, index) = carla_084_points(&view, &k, limit).unwrap();
    let kept: Vec<usize> = (0..pixels).filter(|&index| normalized[index] <= limit).collect();
    assert_eq!(index, kept.iter().map(|&index| index as i64).collect::<Vec<_>>());
    assert_eq!(kept.len(), 8); // 0, 1, 3 .. 7 and 11
    for (&got, &index) in points.iter().zip(&kept) {
        assert!(close(got, point(index, 1000.0 * normalized[index])), "{index}: {got:?}");
    }

    let lidar = depth_to_lidar(&view, &k, limit).unwrap();
    for (index, &number) in normalized.iter().enumerate() {
        let [forward, left, up] = [0, 1, 2].map(|row| lidar.points[row * pixels + index]);
        let metres = if kept.contains(&index) { 1000.0 * number } else { 0.0 };
        let [x, y, z] = point(index, metres);
        assert!(close([forward, left, up], [z, x, y]), "{index}");
        assert_eq!(lidar.metres[index], metres);
    }

    // in float32 metres are rounded as they are there
    let single: Vec<f32> = normalized.iter().map(|&number| number as f32).collect();
    let lidar = depth_to_lidar(&ImageView::new(&single, (width, height), 1).unwrap(), &k, 1.0).unwrap();
    assert_eq!(lidar.metres[5], (f64::from(single[5]) * 1000.0) as f32);

    let endless = ImageView::with_row_stride(&[0.5f32; 4], (4, 1 << 60), 1, 0, 0).unwrap();
    assert!(matches!(depth_to_lidar(&endless, &k, limit), Err(Error::Cloud(CloudError::TooManyPoints { .. }))));
    assert!(matches!(carla_084_points(&endless, &k, limit), Err(Error::Cloud(CloudError::TooManyPoints { .. }))));

    let flat = Matrix3::new(4.0, 0.0, 2.5, 8.0, 0.0, 5.0, 0.0, 0.0, 1.0);
    assert!(matches!(depth_to_lidar(&view, &flat, limit), Err(Error::Cloud(CloudError::Singular { .. }))));
    let coloured = ImageView::new(&normalized, (1, 5), 3).unwrap();
    let channels = Error::Cloud(CloudError::DepthChannels { expected: 1, got: 3 });
    assert_eq!(depth_to_lidar(&coloured, &k, limit), Err(channels.clone()));
    assert_eq!(carla_084_points(&coloured, &k, limit), Err(channels));
}
