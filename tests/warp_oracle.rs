//! The warp against the oracle, `warp::reference`: float64, cell by cell, without table or kernels.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should say so")]

mod common;

use common::{image, seed_camera, seed_grid, textured};
use ipm_rs::error::{ThreadsError, ViewError, WarpError};
use ipm_rs::warp::reference;
use ipm_rs::{
    BevGrid, Bilinear, BrownConrady, Camera, Error, F16, Ground, ImageView, ImageViewMut, Interpolation, KannalaBrandt,
    Lens, Lut, Mei, Pinhole, WarpOptions,
};
use nalgebra::{Matrix3, Vector3};
use proptest::prelude::*;

/// How far a warp may be from the exact value; nearest must be equal.
trait Tolerance: Bilinear + Into<f64> + PartialEq + std::fmt::Debug {
    fn bilinear(range: f64) -> f64;
    fn from_byte(byte: u8) -> Self;
}

impl Tolerance for u8 {
    fn bilinear(_: f64) -> f64 {
        0.52
    }
    fn from_byte(byte: u8) -> Self {
        byte
    }
}

impl Tolerance for u16 {
    fn bilinear(_: f64) -> f64 {
        3.0
    }
    fn from_byte(byte: u8) -> Self {
        u16::from(byte) * 257
    }
}

impl Tolerance for f32 {
    fn bilinear(range: f64) -> f64 {
        range / 16384.0
    }
    fn from_byte(byte: u8) -> Self {
        f32::from(byte) * 0.37 - 40.0
    }
}

impl Tolerance for f64 {
    fn bilinear(range: f64) -> f64 {
        range / 16384.0
    }
    fn from_byte(byte: u8) -> Self {
        5e6 + f64::from(byte) * 0.004
    }
}

impl Tolerance for F16 {
    /// Its numbers lie within 64 of 0, where halves are at most 2^-5 apart.
    fn bilinear(range: f64) -> f64 {
        range / 16384.0 + 1.0 / 64.0
    }
    fn from_byte(byte: u8) -> Self {
        Self::from_f32(f32::from_byte(byte))
    }
}

impl Tolerance for i8 {
    fn bilinear(_: f64) -> f64 {
        0.52
    }
    fn from_byte(byte: u8) -> Self {
        byte as Self
    }
}

impl Tolerance for i16 {
    fn bilinear(_: f64) -> f64 {
        3.0
    }
    fn from_byte(byte: u8) -> Self {
        i16::from(byte as i8) * 255
    }
}

/// Warps with both interpolations and compares every cell; returns how many cells were valid and how many halo.
fn compare<T: Tolerance>(
    lut: &Lut,
    coordinate: impl Fn(usize, usize) -> Option<[f64; 2]>,
    channels: usize,
) -> (usize, usize) {
    let (width, height) = (lut.source_size().0 as usize, lut.source_size().1 as usize);
    let data: Vec<T> = textured(width * height * channels).into_iter().map(T::from_byte).collect();
    let view = ImageView::new(&data, (width, height), channels).unwrap();
    let border: Vec<T> = (0..channels).map(|channel| T::from_byte(50 * (channel as u8 + 1) % 251)).collect();
    let exact_border: Vec<f64> = border.iter().map(|&value| value.into()).collect();
    let range: f64 = (T::from_byte(255).into() - T::from_byte(0).into()).abs();
    let mask = lut.mask().unwrap();
    let (mut valid, mut halo) = (0, 0);
    for interpolation in [Interpolation::Nearest, Interpolation::Bilinear] {
        let options =
            WarpOptions { interpolation, border_value: border.clone(), threads: Some(2), ..WarpOptions::default() };
        let got = lut.warp(&view, &options).unwrap();
        for (cell, values) in got.chunks(channels).enumerate() {
            let (row, column) = (cell / lut.columns(), cell % lut.columns());
            let expected = reference::sample(&view, coordinate(row, column), interpolation, &exact_border);
            assert_eq!(mask[cell], expected.valid, "({row}, {column})");
            valid += usize::from(expected.valid);
            halo += usize::from(!expected.valid && expected.values != exact_border);
            for (&value, &exact) in values.iter().zip(&expected.values) {
                let error = (value.into() - exact).abs();
                let tolerance = if interpolation == Interpolation::Nearest { 0.0 } else { T::bilinear(range) };
                assert!(error <= tolerance, "({row}, {column}) {interpolation:?}: {value:?}, exact {exact}");
            }
        }
    }
    (valid, halo)
}

fn camera_coordinate(camera: &Camera, grid: &BevGrid, height: f64) -> impl Fn(usize, usize) -> Option<[f64; 2]> {
    move |row, column| {
        let point = Vector3::new(grid.x_of_row(row as f64), grid.y_of_column(column as f64), height);
        let pixel = camera.project(&point).pixel;
        pixel[0].is_finite().then_some(pixel)
    }
}

#[test]
fn the_seed_job_in_every_dtype() {
    // the picture and the grid an eighth as fine: the same geometry in a tenth of a second
    let camera = seed_camera().resized(256, 128).unwrap();
    let grid = seed_grid((0.43, 0.2));
    let lut = Lut::new(&camera, &grid, &Ground::default()).unwrap();
    let coordinate = camera_coordinate(&camera, &grid, 0.0);
    for channels in [1, 2, 3, 4, 5] {
        let (valid, halo) = compare::<u8>(&lut, &coordinate, channels);
        assert!(valid > 10_000 && halo > 10, "{valid} {halo}");
        compare::<u16>(&lut, &coordinate, channels);
        compare::<f32>(&lut, &coordinate, channels);
        compare::<f64>(&lut, &coordinate, channels);
        compare::<F16>(&lut, &coordinate, channels);
        compare::<i8>(&lut, &coordinate, channels);
        compare::<i16>(&lut, &coordinate, channels);
    }
}

#[test]
fn through_lenses_all_round() {
    let pixels = |lens: Lens| {
        let model = Pinhole::new(90.0, 91.0, 160.2, 120.4, 0.5).unwrap();
        Camera::from_euler(model, (320, 240), [0.5, 0.1, 1.4], 0.05, 0.6, 0.3).unwrap().with_lens(lens)
    };
    let grid = BevGrid::new((-12.0, 12.0), (-12.0, 12.0), (0.2, 0.2), Default::default()).unwrap();
    for lens in [
        Lens::from(BrownConrady::new(&[0.05, 0.02, 1e-3, -5e-4, -0.002], None).unwrap()),
        KannalaBrandt::new(&[-0.02, 0.004, -0.003, 0.0004], None).unwrap().into(),
        Mei::new(0.9, &[-0.02, 0.001, 4e-4, -5e-4], None).unwrap().into(),
    ] {
        let camera = pixels(lens);
        let lut = Lut::new(&camera, &grid, &Ground::default()).unwrap();
        let (valid, halo) = compare::<u8>(&lut, camera_coordinate(&camera, &grid, 0.0), 3);
        assert!(valid > 3000 && halo > 5, "{lens}: {valid} {halo}");
    }
}

#[test]
fn nothing_behind_the_camera_is_painted() {
    let camera = seed_camera();
    let grid = BevGrid::new((-60.0, 60.0), (-60.0, 60.0), (0.5, 0.5), Default::default()).unwrap();
    let lut = Lut::new(&camera, &grid, &Ground::default()).unwrap();
    let white = vec![255u8; 2048 * 1024];
    let bev = lut.warp(&ImageView::new(&white, (2048, 1024), 1).unwrap(), &WarpOptions::default()).unwrap();
    let (mut behind, mut painted) = (0, 0);
    for (cell, &value) in bev.iter().enumerate() {
        let (row, column) = ((cell / grid.columns()) as f64, (cell % grid.columns()) as f64);
        let point = Vector3::new(grid.x_of_row(row), grid.y_of_column(column), 0.0);
        if camera.camera_from_vehicle().transform(&point).z <= 0.0 {
            behind += 1;
            assert_eq!(value, 0, "{point}");
        } else {
            painted += usize::from(value > 0);
        }
    }
    assert!(behind > 25_000 && painted > 5_000, "{behind} {painted}");
}

#[test]
fn the_answer_does_not_depend_on_threads_strides_or_the_output() {
    let camera = seed_camera().resized(512, 256).unwrap();
    let lut = Lut::new(&camera, &seed_grid((0.1, 0.05)), &Ground::default()).unwrap();
    let data = textured(512 * 256 * 3);
    let view = image(&data, 512, 256, 3);
    let warp = |view: &ImageView<'_, u8>, threads| {
        lut.warp(view, &WarpOptions { threads: Some(threads), ..WarpOptions::default() }).unwrap()
    };
    let expected = warp(&view, 1);
    for threads in [2, 3, 64] {
        assert_eq!(warp(&view, threads), expected);
    }
    // the same picture with 7 samples of padding, and upside down
    let stride = 512 * 3 + 7;
    let mut padded = vec![99u8; stride * 256];
    let mut flipped = vec![99u8; stride * 256];
    for y in 0..256 {
        padded[y * stride..][..1536].copy_from_slice(&data[y * 1536..][..1536]);
        flipped[(255 - y) * stride..][..1536].copy_from_slice(&data[y * 1536..][..1536]);
    }
    let padded = ImageView::with_row_stride(&padded, (512, 256), 3, 0, stride as isize).unwrap();
    let flipped = ImageView::with_row_stride(&flipped, (512, 256), 3, 255 * stride, -(stride as isize)).unwrap();
    assert_eq!(warp(&padded, 2), expected);
    assert_eq!(warp(&flipped, 2), expected);
    // rows of the output anywhere
    let (rows, columns) = (lut.rows(), lut.columns());
    let mut canvas = vec![7u8; rows * (columns * 3 + 5)];
    let stride = columns * 3 + 5;
    let mut out = ImageViewMut::with_row_stride(&mut canvas, (columns, rows), 3, 0, stride as isize).unwrap();
    lut.warp_into(&view, &mut out, &WarpOptions::default()).unwrap();
    for (row, cells) in canvas.chunks(columns * 3 + 5).enumerate() {
        assert_eq!(cells[..columns * 3], expected[row * columns * 3..][..columns * 3]);
        assert_eq!(cells[columns * 3..], [7; 5]);
    }
}

#[test]
fn many_images_at_once_are_each_of_them_alone() {
    let camera = seed_camera().resized(256, 128).unwrap();
    // from one row to one band to many bands an image; so many images that several make a job
    for (resolution, count) in [((43.0, 0.4), 300), ((0.86, 0.4), 60), ((0.1, 0.05), 6)] {
        let lut = Lut::new(&camera, &seed_grid(resolution), &Ground::default()).unwrap();
        let size = (lut.columns(), lut.rows());
        for channels in [1, 3] {
            let data = textured(256 * 128 * channels * count);
            let images: Vec<_> = data.chunks(256 * 128 * channels).map(|one| image(one, 256, 128, channels)).collect();
            for (values, threads) in [(1, 1), (3, 2), (3, 5)] {
                let border: Vec<u8> = (0..values).map(|value| 40 * value + 7).collect();
                let options = |border_value| WarpOptions { border_value, threads: Some(threads), ..Default::default() };
                let length = size.0 * size.1 * channels;
                let mut got = vec![0u8; length * count];
                let mut outs: Vec<_> =
                    got.chunks_mut(length).map(|one| ImageViewMut::new(one, size, channels).unwrap()).collect();
                lut.warp_many_into(&images, &mut outs, &options(border.clone())).unwrap();
                for (index, (image, got)) in images.iter().zip(got.chunks(length)).enumerate() {
                    let own = if channels == 1 { vec![border[index % border.len()]] } else { border.clone() };
                    assert!(got == lut.warp(image, &options(own)).unwrap(), "image {index} of {count}, {size:?}");
                }
            }
        }
    }
}

#[test]
fn images_that_do_not_go_together_are_refused() {
    let lut = Lut::from_maps(&[0.0f32, 1.0], &[0.0, 0.0], 2, (4, 3)).unwrap();
    let data = textured(4 * 3 * 6);
    let planes: Vec<_> = data.chunks(12).map(|one| image(one, 4, 3, 1)).collect();
    let colour = image(&data[..36], 4, 3, 3);
    let refused = |images: &[ImageView<'_, u8>], count: usize, border_value: Vec<u8>| {
        let mut canvas = vec![9u8; 2 * count];
        let mut outs: Vec<_> = canvas.chunks_mut(2).map(|one| ImageViewMut::new(one, (2, 1), 1).unwrap()).collect();
        let options = WarpOptions { border_value, ..WarpOptions::default() };
        let error = lut.warp_many_into(images, &mut outs, &options).unwrap_err();
        assert_eq!(canvas, vec![9; 2 * count]);
        error
    };
    assert_eq!(refused(&[], 0, vec![0]), Error::Warp(WarpError::ImageCount { images: 0, outs: 0 }));
    assert_eq!(refused(&planes, 5, vec![0]), Error::Warp(WarpError::ImageCount { images: 6, outs: 5 }));
    assert_eq!(
        refused(&[planes[0], colour], 2, vec![0]),
        Error::Warp(WarpError::MixedChannels { expected: 1, got: 3 })
    );
    assert_eq!(refused(&planes, 6, vec![0; 4]), Error::View(ViewError::BorderChannels { expected: 1, got: 4 }));
    assert_eq!(refused(&planes, 6, vec![]), Error::View(ViewError::BorderChannels { expected: 1, got: 0 }));
    assert!(matches!(refused(&[colour], 1, vec![0]), Error::View(ViewError::OutputShape { .. })));
}

#[test]
fn refusals_come_before_anything_is_written() {
    let lut = Lut::from_maps(&[0.0f32, 1.0], &[0.0, 0.0], 2, (4, 3)).unwrap();
    let data = textured(5 * 3 * 2);
    let mut out = [9u8; 4];
    let mut refused = |size: (usize, usize), out_size, options: WarpOptions<u8>| {
        let view = ImageView::new(&data[..size.0 * size.1 * 2], size, 2).unwrap();
        let mut out = ImageViewMut::new(&mut out, out_size, 2).unwrap();
        lut.warp_into(&view, &mut out, &options).unwrap_err()
    };
    let good = WarpOptions::default;
    assert!(matches!(refused((5, 3), (2, 1), good()), Error::View(ViewError::SizeMismatch { .. })));
    assert!(matches!(refused((4, 3), (1, 2), good()), Error::View(ViewError::OutputShape { .. })));
    let border = WarpOptions { border_value: vec![1, 2, 3], ..good() };
    assert!(matches!(refused((4, 3), (2, 1), border), Error::View(ViewError::BorderChannels { expected: 2, got: 3 })));
    let threads = WarpOptions { threads: Some(0), ..good() };
    assert!(matches!(refused((4, 3), (2, 1), threads), Error::Threads(ThreadsError::Zero { .. })));
    assert_eq!(out, [9; 4]);
}

#[test]
fn a_nan_border_does_not_reach_valid_cells() {
    let lut = Lut::from_maps(&[3.0, 0.5, 3.5], &[2.0, 2.0, 1.0], 3, (4, 3)).unwrap();
    let data = vec![2.0f32; 12];
    let options = WarpOptions { border_value: vec![f32::NAN], ..WarpOptions::default() };
    let got = lut.warp(&ImageView::new(&data, (4, 3), 1).unwrap(), &options).unwrap();
    assert_eq!(got[..2], [2.0, 2.0]);
    assert!(got[2].is_nan());
}

proptest! {
    #[test]
    fn maps_of_any_numbers_agree_with_the_oracle(
        (width, height, channels) in (1u32..9, 1u32..9, 1usize..6),
        coordinates in prop::collection::vec((coordinate(), coordinate()), 1..200),
    ) {
        let map_x: Vec<f64> = coordinates.iter().map(|c| c.0).collect();
        let map_y: Vec<f64> = coordinates.iter().map(|c| c.1).collect();
        let lut = Lut::from_maps(&map_x, &map_y, map_x.len(), (width, height)).unwrap();
        let at = |_, column| Some([map_x[column], map_y[column]]);
        let cells = map_x.len();
        prop_assert!(lut.nbytes() <= 12 * cells + 16);
        compare::<u8>(&lut, at, channels);
        compare::<u16>(&lut, at, channels);
        compare::<f32>(&lut, at, channels);
        compare::<f64>(&lut, at, channels);
        compare::<F16>(&lut, at, channels);
        compare::<i8>(&lut, at, channels);
        compare::<i16>(&lut, at, channels);
        prop_assert!(lut.nbytes() <= 16 * cells + 64, "what nearest keeps, 4 bytes a cell");
        prop_assert_eq!(Lut::from_bytes(&lut.to_bytes().unwrap()).unwrap(), lut);
    }

    #[test]
    fn homographies_agree_with_the_oracle(entries in prop::array::uniform9(-2.0..2.0f64)) {
        let m = Matrix3::from_row_slice(&entries);
        let Ok(lut) = Lut::from_homography(&m, (23, 17), (19, 13)) else { return Ok(()) };
        let at = |row: usize, column: usize| {
            let q = m * Vector3::new(column as f64, row as f64, 1.0);
            Some([q.x / q.z, q.y / q.z])
        };
        // the two evaluate the same map in another order: cells within rounding of a decision are left out
        let near_a_decision = |row, column| {
            let [u, v] = at(row, column).unwrap_or([0.0; 2]);
            [u, v].iter().any(|c| (c * 2.0 - (c * 2.0).round()).abs() < 1e-9)
        };
        prop_assume!(!(0..17).any(|row| (0..23).any(|column| near_a_decision(row, column))));
        compare::<u8>(&lut, at, 3);
    }
}

/// Coordinates of every kind: inside, on pixel centres and halves, in the halo, far outside, not finite.
fn coordinate() -> impl Strategy<Value = f64> {
    prop_oneof![
        6 => -2.0..10.0f64,
        2 => (-4..20i32).prop_map(|halves| f64::from(halves) * 0.5),
        1 => (-4..20i32, -1.0..1.0f64).prop_map(|(halves, tiny)| f64::from(halves) * 0.5 + tiny * 1e-9),
        1 => prop_oneof![Just(f64::NAN), Just(f64::INFINITY), Just(f64::NEG_INFINITY), Just(1e300), Just(-1e300), Just(-0.0)],
    ]
}
