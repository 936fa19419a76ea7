//! Colour-coded depth and clouds made of it, of any bytes, through cameras of any intrinsics; points back to an image.

use ipm_rs::cloud::{
    CarlaDepth, ChannelOrder, DepthKind, DepthOptions, DepthUnit, NO_POINT, RenderOptions, cloud_from_depth,
    decode_carla_depth_into, depth_to_lidar, encode_carla_depth_into, points_from_depth_into, points_size,
    render_points_into,
};
use ipm_rs::geometry::Pose;
use ipm_rs::view::Strided;
use ipm_rs::{Camera, ImageView, ImageViewMut};

use crate::input::Input;
use crate::isas::{Random, noise};

pub fn run(data: &[u8]) {
    let mut input = Input::new(data);
    let Some(camera) = input.camera(None) else { return };
    let size = (camera.image_size().0 as usize, camera.image_size().1 as usize);
    let order = input.one_of(&ChannelOrder::ALL);
    let mut random = Random::new(input.bits());
    let codes: Vec<u8> = noise(size.0 * size.1 * order.channels(), &mut random);
    let image = ImageView::new(&codes, size, order.channels()).expect("an image");
    let unit = input.one_of(&[DepthUnit::Metres, DepthUnit::Normalized]);
    let mut depth = vec![0.0f32; size.0 * size.1];
    decode_carla_depth_into(&image, order, unit, &mut view(&mut depth, size, 1), Some(2)).expect("it fits");
    let largest = if unit == DepthUnit::Metres { 1000.0 } else { 1.0 };
    for (pixel, &got) in codes.chunks(order.channels()).zip(&depth) {
        let red_first = matches!(order, ChannelOrder::Rgb | ChannelOrder::Rgba);
        let [r, g, b] = if red_first { [pixel[0], pixel[1], pixel[2]] } else { [pixel[2], pixel[1], pixel[0]] };
        let code = f64::from(u32::from(r) + 256 * u32::from(g) + 65536 * u32::from(b));
        assert!((f64::from(got) - code / 16_777_215.0 * largest).abs() <= 6.1e-8 * largest, "{pixel:?}: {got}");
    }
    // back: float32 tells all codes of a normalized depth apart but those of the upper half
    let mut again = vec![0u8; codes.len()];
    let numbers: Vec<f64> = depth.iter().map(|&number| f64::from(number)).collect();
    let numbers = ImageView::new(&numbers, size, 1).expect("an image");
    let mut room = view(&mut again, size, order.channels());
    encode_carla_depth_into(&numbers, order, unit, &mut room, None).expect("all are at least 0");
    // and numbers of any kind: refused where they are negative or NaN, and not before all is written
    let any: Vec<f64> = (0..size.0 * size.1).map(|_| input.number(1e3)).collect();
    let any_view = ImageView::new(&any, size, 1).expect("an image");
    let encoded = encode_carla_depth_into(&any_view, order, unit, &mut view(&mut again, size, order.channels()), None);
    assert_eq!(encoded.is_ok(), any.iter().all(|number| *number >= 0.0));
    clouds(&camera, &any_view, &CarlaDepth::new(&image, order).expect("as many channels"), &mut input);
}

fn clouds(camera: &Camera, depth: &ImageView<'_, f64>, coded: &CarlaDepth<'_>, input: &mut Input<'_>) {
    let size = (depth.width(), depth.height());
    let options = DepthOptions {
        kind: input.one_of(&[DepthKind::Planar, DepthKind::Ray]),
        scale: if input.flag() { 1.0 } else { input.number(10.0) },
        min_depth: if input.flag() { 0.0 } else { input.number(10.0) },
        max_depth: if input.flag() { f64::INFINITY } else { input.number(900.0) },
        stride: input.count(0, 5),
        threads: Some(2),
    };
    let pose: Pose = camera.vehicle_from_camera().to_owned();
    let small = points_size(size, options.stride);
    let mut points = vec![0.0f64; 3 * small.0 * small.1];
    let organised = points_from_depth_into(depth, camera, &pose, None, &options, &mut view(&mut points, small, 3));
    let cloud = cloud_from_depth::<_, f64>(depth, camera, &pose, None, &options);
    assert_eq!(organised.is_ok(), cloud.is_ok());
    let Ok(cloud) = cloud else { return };
    let known: Vec<f64> = points.chunks(3).filter(|point| !point[2].is_nan()).flatten().copied().collect();
    let same = |a: &f64, b: &f64| a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan();
    assert!(cloud.points.as_flattened().len() == known.len());
    assert!(cloud.points.as_flattened().iter().zip(&known).all(|(a, b)| same(a, b)));
    assert!(cloud.index.iter().all(|&index| (0..(size.0 * size.1) as i64).contains(&index)));
    let _ = cloud_from_depth::<_, f32>(coded, camera, &pose, None, &options).expect("as good as the other");
    let _ = depth_to_lidar(depth, &camera.intrinsics(), input.number(1.0));
    let (mut nearest, mut index) = (vec![0.0f32; size.0 * size.1], vec![0i64; size.0 * size.1]);
    let options = RenderOptions { radius: input.number(4.0), ..RenderOptions::default() };
    let table = Strided::new(cloud.points.as_flattened(), 3).expect("whole rows");
    let rendered =
        render_points_into(camera, &table, &options, &mut view(&mut nearest, size, 1), &mut view(&mut index, size, 1));
    if rendered.is_ok() {
        let range = 0..cloud.points.len() as i64;
        assert!(index.iter().all(|number| *number == NO_POINT || range.contains(number)));
    }
}

fn view<T>(data: &mut [T], size: (usize, usize), channels: usize) -> ImageViewMut<'_, T> {
    ImageViewMut::new(data, size, channels).expect("the buffer fits")
}
