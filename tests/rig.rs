//! Views of several cameras against their definition: each cell is the mean of its cameras' own views by their weights.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should say so")]
use ipm_rs::error::{Error, ViewError, WarpError};
use ipm_rs::rig::{BlendMode, RigLut, RigOptions};
use ipm_rs::{
    BevGrid, Camera, Ground, ImageMask, ImageView, ImageViewMut, Interpolation, KannalaBrandt, Lut, Pinhole, SampleAt,
    WarpOptions,
};

const SIZE: (u32, u32) = (160, 120);

fn fisheye(yaw: f64, x: f64, y: f64) -> Camera {
    let model = Pinhole::new(60.0, 61.0, 80.3, 58.8, 0.0).unwrap();
    let camera = Camera::from_euler(model, SIZE, [x, y, 0.9 + 0.05 * yaw.cos()], 0.01, 0.6, yaw).unwrap();
    camera.with_lens(KannalaBrandt::new(&[0.02, -0.01, 0.002, 0.0], Some(1.5)).map(ipm_rs::Lens::from).unwrap())
}

fn cameras() -> Vec<(&'static str, Camera)> {
    vec![
        ("left", fisheye(1.55, 1.9, 0.9)),
        ("front", fisheye(0.02, 3.7, 0.0)),
        ("right", fisheye(-1.6, 1.9, -0.95)),
        ("back", fisheye(3.1, -0.9, 0.1)),
    ]
}

fn grid() -> BevGrid {
    BevGrid::new((-5.0, 8.0), (-6.0, 6.0), (0.1, 0.1), SampleAt::Center).unwrap()
}

fn image(seed: usize, channels: usize) -> Vec<u8> {
    (0..SIZE.0 as usize * SIZE.1 as usize * channels)
        .map(|k| (((k + 977 * seed) * 2_654_435_761) >> 7) as u8 / 2 + 40 * seed as u8)
        .collect()
}

fn size() -> (usize, usize) {
    (SIZE.0 as usize, SIZE.1 as usize)
}

fn warp(lut: &RigLut, images: &[Vec<u8>], channels: usize, options: &WarpOptions<u8>, gains: &[f32]) -> Vec<u8> {
    let views: Vec<_> = images.iter().map(|image| ImageView::new(image, size(), channels).unwrap()).collect();
    let mut out = vec![0; lut.rows() * lut.columns() * channels];
    let mut view = ImageViewMut::new(&mut out, (lut.columns(), lut.rows()), channels).unwrap();
    lut.warp_into(&views, &mut view, options, gains).unwrap();
    out
}

#[test]
fn each_cell_is_the_mean_of_its_cameras_by_their_weights() {
    let cameras = cameras();
    for (blend, feather) in
        [(BlendMode::Best, 0.8), (BlendMode::Feather, 1.5), (BlendMode::Priority, 0.3), (BlendMode::Best, 0.0)]
    {
        let lut =
            RigLut::new(&cameras, &grid(), &Ground::default(), &RigOptions { blend, feather, ..RigOptions::default() })
                .unwrap();
        let weights: Vec<Vec<f32>> = (0..4).map(|camera| lut.weights(camera).unwrap()).collect();
        let (mask, source) = (lut.mask().unwrap(), lut.source().unwrap());
        let own: Vec<Lut> =
            cameras.iter().map(|(_, camera)| Lut::new(camera, &grid(), &Ground::default()).unwrap()).collect();
        let seen: Vec<Vec<bool>> = own.iter().map(|lut| lut.mask().unwrap()).collect();
        let mut mixed = 0;
        for cell in 0..mask.len() {
            assert_eq!(mask[cell], seen.iter().any(|seen| seen[cell]), "{cell}");
            let sum: f32 = weights.iter().map(|weights| weights[cell]).sum();
            assert_eq!(sum, if mask[cell] { 1.0 } else { 0.0 });
            for camera in 0..4 {
                assert!(weights[camera][cell] == 0.0 || seen[camera][cell]);
                mixed += usize::from(weights[camera][cell] > 0.0 && weights[camera][cell] < 1.0);
                if source[cell] == camera as i16 {
                    assert!(weights.iter().all(|other| other[cell] <= weights[camera][cell]));
                }
            }
            assert_eq!(source[cell] >= 0, mask[cell]);
        }
        assert_eq!(mixed > 500, feather > 0.0, "{blend:?}: {mixed}");
        for channels in [1, 3] {
            let images: Vec<Vec<u8>> = (0..4).map(|seed| image(seed, channels)).collect();
            for interpolation in [Interpolation::Nearest, Interpolation::Bilinear] {
                let options = WarpOptions { interpolation, border_value: vec![9], ..WarpOptions::default() };
                let got = warp(&lut, &images, channels, &options, &[]);
                let views: Vec<Vec<u8>> = (own.iter().zip(&images))
                    .map(|(lut, image)| lut.warp(&ImageView::new(image, size(), channels).unwrap(), &options).unwrap())
                    .collect();
                for (at, &got) in got.iter().enumerate() {
                    let cell = at / channels;
                    let expected = match (interpolation, mask[cell]) {
                        (_, false) => 9,
                        (Interpolation::Nearest, _) => views[source[cell] as usize][at],
                        _ => {
                            let mean: f32 =
                                (0..4).map(|camera| weights[camera][cell] * f32::from(views[camera][at])).sum();
                            (mean + 0.5).floor() as u8
                        }
                    };
                    assert_eq!(got, expected, "{blend:?} {interpolation:?} sample {at}");
                }
            }
        }
    }
}

/// The transpose of a picture, as far as one camera goes: `<warp(image), grad>` is `<image, adjoint(grad)>`.
#[test]
fn what_cells_take_from_a_camera_they_give_back_to_it() {
    let lut = RigLut::new(&cameras(), &grid(), &Ground::default(), &RigOptions::default()).unwrap();
    let cells = (lut.columns(), lut.rows());
    let mask = lut.mask().unwrap();
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    for (interpolation, channels) in
        [(Interpolation::Nearest, 1), (Interpolation::Bilinear, 2), (Interpolation::Area, 1)]
    {
        let options = WarpOptions { interpolation, border_value: vec![0.0], ..WarpOptions::default() };
        let images: Vec<Vec<f64>> =
            (0..4).map(|seed| image(seed, channels).iter().map(|&grey| f64::from(grey)).collect()).collect();
        // what no camera shows may hold anything
        let grads = [3, 5].map(|step: usize| -> Vec<f64> {
            let grad = |at: usize| if mask[at / channels] { (at * step % 17) as f64 - 8.0 } else { f64::NAN };
            (0..mask.len() * channels).map(grad).collect()
        });
        let views: Vec<_> = grads.iter().map(|grad| ImageView::new(grad, cells, channels).unwrap()).collect();
        for camera in 0..4 {
            let given: Vec<Vec<f64>> = [1, 3]
                .map(|threads| {
                    let mut outs = vec![vec![0.0; images[0].len()]; 2];
                    let mut targets: Vec<_> =
                        outs.iter_mut().map(|out| ImageViewMut::new(out, size(), channels).unwrap()).collect();
                    let options = WarpOptions { threads: Some(threads), ..options.clone() };
                    lut.warp_many_adjoint_into(camera, &views, &mut targets, &options).unwrap();
                    outs.concat()
                })
                .to_vec();
            assert_eq!(given[0], given[1], "threads");
            // the picture of this camera alone, the others black
            let black = vec![0.0; images[0].len()];
            let alone: Vec<_> = (0..4)
                .map(|other| {
                    ImageView::new(if other == camera { &images[camera] } else { &black }, size(), channels).unwrap()
                })
                .collect();
            let mut picture = vec![0.0; mask.len() * channels];
            let mut view = ImageViewMut::new(&mut picture, cells, channels).unwrap();
            lut.warp_into(&alone, &mut view, &options, &[]).unwrap();
            for (grad, adjoint) in grads.iter().zip(given[0].chunks(images[0].len())) {
                let seen: Vec<f64> = grad.iter().map(|&grad| if grad.is_nan() { 0.0 } else { grad }).collect();
                let (there, back) = (dot(&picture, &seen), dot(&images[camera], adjoint));
                assert!(dot(adjoint, adjoint) > 0.0);
                assert!(
                    (there - back).abs() < 1e-6 * there.abs().max(1e3),
                    "{interpolation:?} {camera}: {there} {back}"
                );
            }
        }
        let mut out = vec![0.0; images[0].len()];
        let mut outs = vec![ImageViewMut::new(&mut out, size(), channels).unwrap()];
        let refused = |grads: &[ImageView<'_, f64>], outs: &mut [_]| {
            lut.warp_many_adjoint_into(0, grads, outs, &options).unwrap_err()
        };
        assert!(matches!(refused(&views, &mut outs), Error::Warp(WarpError::ImageCount { images: 2, outs: 1 })));
        let small = vec![0.0; 6 * channels];
        let small = ImageView::new(&small, (3, 2), channels).unwrap();
        assert!(matches!(refused(&[small], &mut outs), Error::View(ViewError::SizeMismatch { got: (3, 2), .. })));
        // the last of seventeen has another size: none is written
        let mut memory = vec![vec![5.0; images[0].len()]; 17];
        let sizes = (0..17).map(|nth| if nth < 16 { size() } else { (size().1, size().0) });
        let mut outs: Vec<_> =
            (memory.iter_mut().zip(sizes)).map(|(out, size)| ImageViewMut::new(out, size, channels).unwrap()).collect();
        let refused = lut.warp_many_adjoint_into(0, &[views[0]; 17], &mut outs, &options);
        assert!(matches!(refused, Err(Error::View(ViewError::OutputShape { .. }))));
        assert!(memory.iter().flatten().all(|&number| number == 5.0));
    }
}

#[test]
fn neither_threads_nor_the_order_of_cameras_change_a_bit() {
    let cameras = cameras();
    let options = RigOptions { feather: 1.0, ..RigOptions::default() };
    let images: Vec<Vec<u8>> = (0..4).map(|seed| image(seed, 3)).collect();
    let lut = RigLut::new(&cameras, &grid(), &Ground::default(), &options).unwrap();
    for interpolation in [Interpolation::Bilinear, Interpolation::Area, Interpolation::Nearest] {
        let one = WarpOptions { interpolation, threads: Some(1), ..WarpOptions::default() };
        let expected = warp(&lut, &images, 3, &one, &[]);
        assert_eq!(warp(&lut, &images, 3, &WarpOptions { threads: Some(3), ..one.clone() }, &[]), expected);
        for order in [[3, 1, 0, 2], [2, 3, 1, 0]] {
            let moved: Vec<_> = order.iter().map(|&index| cameras[index]).collect();
            let lut = RigLut::new(&moved, &grid(), &Ground::default(), &options).unwrap();
            let images: Vec<_> = order.iter().map(|&index| images[index].clone()).collect();
            assert_eq!(warp(&lut, &images, 3, &one, &[]), expected);
        }
    }
}

#[test]
fn gains_undo_what_brightened_the_images() {
    let lut = RigLut::new(&cameras(), &grid(), &Ground::default(), &RigOptions::default()).unwrap();
    // all cameras see a road of one grey that changes slowly over the ground, each through its own gain
    let factors = [0.8f32, 1.2, 1.05, 0.95];
    let images: Vec<Vec<u8>> = cameras()
        .iter()
        .zip(factors)
        .map(|((_, camera), factor)| {
            (0..SIZE.0 as usize * SIZE.1 as usize)
                .map(|k| {
                    let pixel = [(k % SIZE.0 as usize) as f64, (k / SIZE.0 as usize) as f64];
                    let point = camera.ground_from_pixel(pixel, &Ground::default());
                    let grey = point.map_or(200.0, |p| 110.0 + 40.0 * (0.7 * p.x).sin() * (0.5 * p.y + 0.3).cos());
                    (grey as f32 * factor).round() as u8
                })
                .collect()
        })
        .collect();
    let views: Vec<_> = images.iter().map(|image| ImageView::new(image, size(), 1).unwrap()).collect();
    let gains = lut.gains(&views, &[]).unwrap();
    let mean = factors.iter().map(|factor| factor.ln()).sum::<f32>() / 4.0;
    for (gain, factor) in gains.iter().zip(factors) {
        assert!((gain * factor / mean.exp() - 1.0).abs() < 0.02, "{gains:?}");
    }
    let again = lut.gains(&views, &gains).unwrap();
    assert!(gains.iter().zip(&again).all(|(gain, again)| (gain - again).abs() < 1e-3));
    let next = lut.gains(&views, &[1.0; 4]).unwrap();
    assert!((next[0] - 1.0) / (gains[0] - 1.0) > 0.05 && (next[0] - 1.0) / (gains[0] - 1.0) < 0.15);
    let bright = warp(&lut, &images, 1, &WarpOptions::default(), &[2.0; 4]);
    let plain = warp(&lut, &images, 1, &WarpOptions::default(), &[]);
    assert!(
        bright
            .iter()
            .zip(&plain)
            .all(|(&bright, &plain)| u16::from(bright).abs_diff((2 * u16::from(plain)).min(255)) <= 1)
    );
}

#[test]
fn masks_and_polygons_take_cells_away() {
    let cameras = cameras();
    let plain = RigLut::new(&cameras, &grid(), &Ground::default(), &RigOptions::default()).unwrap();
    let bonnet: Vec<bool> = (0..SIZE.0 as usize * SIZE.1 as usize).map(|k| k / (SIZE.0 as usize) < 70).collect();
    let bonnet = ImageMask::new(SIZE, bonnet).unwrap();
    let masks = vec![None, Some(&bonnet), None, None];
    let masked =
        RigLut::new(&cameras, &grid(), &Ground::default(), &RigOptions { masks, ..RigOptions::default() }).unwrap();
    let count =
        |lut: &RigLut, camera: usize| lut.weights(camera).unwrap().iter().filter(|&&weight| weight > 0.0).count();
    assert!(count(&masked, 1) < count(&plain, 1) && count(&masked, 1) > 0);
    let car = vec![vec![[-1.0, -0.9], [3.7, -0.9], [3.7, 0.9], [-1.0, 0.9]]];
    let options = RigOptions { exclude: car, ..RigOptions::default() };
    let without = RigLut::new(&cameras, &grid(), &Ground::default(), &options).unwrap();
    let (mask, all) = (without.mask().unwrap(), plain.mask().unwrap());
    for cell in 0..mask.len() {
        let [x, y] = grid().ground_from_cell([(cell / grid().columns()) as f64, (cell % grid().columns()) as f64]);
        let in_car = x > -1.0 && x < 3.7 && y.abs() < 0.9;
        assert_eq!(mask[cell], all[cell] && !in_car, "({x}, {y})");
    }
    let everything = vec![vec![[-9.0, -9.0], [9.0, -9.0], [9.0, 9.0], [-9.0, 9.0]]];
    let options = RigOptions { exclude: everything, ..RigOptions::default() };
    let none = RigLut::new(&cameras, &grid(), &Ground::default(), &options).unwrap();
    assert!(none.mask().unwrap().iter().all(|seen| !seen));
    let images: Vec<Vec<u8>> = (0..4).map(|seed| image(seed, 3)).collect();
    assert!(
        warp(&none, &images, 3, &WarpOptions { border_value: vec![7], ..WarpOptions::default() }, &[])
            .iter()
            .all(|&v| v == 7)
    );
}

#[test]
fn without_a_camera_its_cells_go_to_those_that_share_them() {
    let cameras = cameras();
    let options = RigOptions { feather: 1.0, ..RigOptions::default() };
    let lut = RigLut::new(&cameras, &grid(), &Ground::default(), &options).unwrap();
    let fewer = lut.without(&[1]).unwrap();
    assert_eq!(fewer.cameras(), 3);
    let before: Vec<_> = (0..4).map(|camera| lut.weights(camera).unwrap()).collect();
    let after: Vec<_> = (0..3).map(|camera| fewer.weights(camera).unwrap()).collect();
    let (mut alone, mut shared) = (0, 0);
    for cell in 0..before[0].len() {
        let left = 1.0 - before[1][cell];
        for (camera, index) in [(0, 0), (2, 1), (3, 2)] {
            let expected = if left > 0.0 { before[camera][cell] / left } else { 0.0 };
            assert!((after[index][cell] - expected).abs() < 0.02, "{cell}");
        }
        alone += usize::from(before[1][cell] == 1.0);
        shared += usize::from(before[1][cell] > 0.0 && left > 0.0);
    }
    assert!(alone > 500 && shared > 100, "{alone} {shared}");
    let images: Vec<Vec<u8>> = [0, 2, 3].map(|seed| image(seed, 3)).to_vec();
    warp(&fewer, &images, 3, &WarpOptions::default(), &[]);
    assert!(lut.without(&[0, 1, 2, 3]).is_err());
}
