//! One job, once, for counting its instructions: `scripts/count_instructions.py` runs it under callgrind.
//!
//! Instructions are the same on every run and whatever else the machine does, so a kernel that has become worse shows
//! at 3 %, which no clock here does. They are not time: caches and dependencies do not count.

#[path = "../tests/common/mod.rs"]
mod common;

use std::hint::black_box;

use common::{seed_camera, seed_grid, textured};
use ipm_rs::mosaic::{Frame, Kept, OwnedTile};
use ipm_rs::rig::{RigLut, RigOptions};
use ipm_rs::{
    BevGrid, Bilinear, Camera, F16, Ground, ImageView, ImageViewMut, Interpolation, Lut, Mapping, Pinhole, SampleAt,
    WarpOptions, warp_direct_into,
};

const SIZE: (usize, usize) = (1024, 512);
const CELL: (f64, f64) = (0.1, 0.05);
const AREA_CELL: (f64, f64) = (0.1, 0.1);

/// What is counted: nothing outside this function is.
#[inline(never)]
fn counted(job: &mut dyn FnMut()) {
    job();
}

fn main() {
    // cargo bench passes `--bench`; without a job there is nothing to do
    let Some(name) = std::env::args().nth(1).filter(|name| !name.starts_with('-')) else { return };
    let camera = seed_camera().resized(SIZE.0 as u32, SIZE.1 as u32).expect("the size is good");
    let cells = match name.as_str() {
        "bilinear u8x1" => warp::<u8>(&camera, 1, Interpolation::Bilinear, |byte| byte),
        "bilinear u8x3" => warp::<u8>(&camera, 3, Interpolation::Bilinear, |byte| byte),
        "bilinear u8x4" => warp::<u8>(&camera, 4, Interpolation::Bilinear, |byte| byte),
        "bilinear u16x3" => warp::<u16>(&camera, 3, Interpolation::Bilinear, |byte| u16::from(byte) * 257),
        "bilinear f32x1" => warp::<f32>(&camera, 1, Interpolation::Bilinear, f32::from),
        "bilinear f32x3" => warp::<f32>(&camera, 3, Interpolation::Bilinear, f32::from),
        "nearest u8x1" => warp::<u8>(&camera, 1, Interpolation::Nearest, |byte| byte),
        "nearest u8x3" => warp::<u8>(&camera, 3, Interpolation::Nearest, |byte| byte),
        "nearest first" => nth_warp::<u8>(&camera, 3, Interpolation::Nearest, |byte| byte, false),
        "area u8x3" => area(&camera, 3, true),
        "area plan" => area(&camera, 1, false),
        "area f32x3" => averaged::<f32>(&camera, 3, f32::from, true),
        "table" => table(&camera),
        "cubic u8x3" => warp::<u8>(&camera, 3, Interpolation::Cubic, |byte| byte),
        "rig u8x3" => ring(&camera),
        "adjoint bilinear" => adjoint(&camera, Interpolation::Bilinear),
        "adjoint nearest" => adjoint(&camera, Interpolation::Nearest),
        "adjoint area" => adjoint(&camera, Interpolation::Area),
        "bilinear i16x3" => warp::<i16>(&camera, 3, Interpolation::Bilinear, |byte| i16::from(byte) * 257 - 3000),
        "bilinear f16x3" => warp::<F16>(&camera, 3, Interpolation::Bilinear, |byte| F16::from_f32(byte.into())),
        "bilinear f64x3" => warp::<f64>(&camera, 3, Interpolation::Bilinear, f64::from),
        "mosaic u8x1" => mosaic(1),
        "mosaic u8x3" => mosaic(3),
        "homography u8x3" => homography::<u8>(3, |byte| byte),
        "homography f32x1" => homography::<f32>(1, f32::from),
        "homography f32x3" => homography::<f32>(3, f32::from),
        other => panic!("expected a job of benches/instructions.json, got {other:?}"),
    };
    println_cells(cells);
}

#[expect(clippy::print_stdout, reason = "what the script reads")]
fn println_cells(cells: usize) {
    println!("{cells}");
}

/// Warps through a table that has been warped through; returns the valid cells.
fn warp<T: Bilinear>(camera: &Camera, channels: usize, interpolation: Interpolation, sample: fn(u8) -> T) -> usize {
    nth_warp(camera, channels, interpolation, sample, true)
}

/// Warps through a table, by the first warp, which works out what the table keeps for the next, or by the second.
fn nth_warp<T: Bilinear>(
    camera: &Camera,
    channels: usize,
    interpolation: Interpolation,
    sample: fn(u8) -> T,
    once_before: bool,
) -> usize {
    let lut = Lut::new(camera, &seed_grid(CELL), &Ground::default()).expect("the seed job fits");
    let data: Vec<T> = textured(SIZE.0 * SIZE.1 * channels).into_iter().map(sample).collect();
    let image = ImageView::new(&data, SIZE, channels).expect("the image fits its size");
    let mut out = vec![T::default(); lut.rows() * lut.columns() * channels];
    let mut out = ImageViewMut::new(&mut out, (lut.columns(), lut.rows()), channels).expect("the output fits");
    let options = WarpOptions { interpolation, threads: Some(1), ..WarpOptions::default() };
    let mut warp = || lut.warp_into(black_box(&image), &mut out, &options).expect("the image fits the table");
    if once_before {
        warp();
    }
    counted(&mut warp);
    lut.valid_cells()
}

/// Averages bytes over cells.
fn area(camera: &Camera, channels: usize, planned: bool) -> usize {
    averaged::<u8>(camera, channels, |byte| byte, planned)
}

/// Averages over cells through a table, by the first warp, which makes the plan, or by a later one; returns the valid cells.
fn averaged<T: Bilinear>(camera: &Camera, channels: usize, sample: fn(u8) -> T, planned: bool) -> usize {
    ipm_rs::set_num_threads(1).expect("one is a number of threads");
    let lut = Lut::new(camera, &seed_grid(AREA_CELL), &Ground::default()).expect("the seed job fits");
    let data: Vec<T> = textured(SIZE.0 * SIZE.1 * channels).into_iter().map(sample).collect();
    let image = ImageView::new(&data, SIZE, channels).expect("the image fits its size");
    let mut out = vec![T::default(); lut.rows() * lut.columns() * channels];
    let mut out = ImageViewMut::new(&mut out, (lut.columns(), lut.rows()), channels).expect("the output fits");
    let options = WarpOptions { interpolation: Interpolation::Area, threads: Some(1), ..WarpOptions::default() };
    let mut warp = || lut.warp_into(black_box(&image), &mut out, &options).expect("the image fits the table");
    if planned {
        warp();
    }
    counted(&mut warp);
    lut.valid_cells()
}

/// Warps three cameras onto one grid, with seams between them, by a later warp; returns the valid cells.
fn ring(camera: &Camera) -> usize {
    ipm_rs::set_num_threads(1).expect("one is a number of threads");
    let turned = |yaw: f64| {
        let position = [1.7, 0.0, 1.2];
        Camera::from_euler(*camera.model(), camera.image_size(), position, 0.0, 0.04, yaw).expect("a camera")
    };
    let cameras = [("ahead", turned(0.0)), ("left", turned(0.5)), ("right", turned(-0.5))];
    let lut = RigLut::new(&cameras, &seed_grid(AREA_CELL), &Ground::default(), &RigOptions::default()).expect("a ring");
    let data = textured(SIZE.0 * SIZE.1 * 3);
    let image = ImageView::new(&data, SIZE, 3).expect("the image fits its size");
    let mut out = vec![0; lut.rows() * lut.columns() * 3];
    let mut out = ImageViewMut::new(&mut out, (lut.columns(), lut.rows()), 3).expect("the output fits");
    let options = WarpOptions { threads: Some(1), ..WarpOptions::default() };
    let mut warp = || lut.warp_into(black_box(&[image; 3]), &mut out, &options, &[]).expect("the images fit the table");
    warp();
    counted(&mut warp);
    lut.mask().expect("memory for a mask").into_iter().filter(|valid| *valid).count()
}

/// Sends a gradient of three channels back to the image, by a later call; returns the valid cells.
fn adjoint(camera: &Camera, interpolation: Interpolation) -> usize {
    ipm_rs::set_num_threads(1).expect("one is a number of threads");
    let lut = Lut::new(camera, &seed_grid(AREA_CELL), &Ground::default()).expect("the seed job fits");
    let size = (lut.columns(), lut.rows());
    let data: Vec<f32> = textured(size.0 * size.1 * 3).into_iter().map(f32::from).collect();
    let grad = ImageView::new(&data, size, 3).expect("a value for each cell");
    let mut out = vec![0.0; SIZE.0 * SIZE.1 * 3];
    let mut out = ImageViewMut::new(&mut out, SIZE, 3).expect("the output fits");
    let options = WarpOptions { interpolation, threads: Some(1), ..WarpOptions::default() };
    let mut back = || lut.warp_adjoint_into(black_box(&grad), &mut out, &options).expect("it fits the table");
    back();
    counted(&mut back);
    lut.valid_cells()
}

/// Builds a table; returns its cells.
fn table(camera: &Camera) -> usize {
    ipm_rs::set_num_threads(1).expect("one is a number of threads");
    let grid = seed_grid(CELL);
    let mut lut = None;
    counted(&mut || lut = Some(Lut::new(black_box(camera), &grid, &Ground::default()).expect("the seed job fits")));
    lut.map_or(0, |lut| lut.rows() * lut.columns())
}

/// Adds a picture of KITTI's size to a tile of a map that has one already; returns the cells that it is counted in.
fn mosaic(channels: usize) -> usize {
    const SIDE: usize = 512;
    const CELL: f64 = 0.05;
    const PIXELS: (usize, usize) = (1226, 370);
    ipm_rs::set_num_threads(1).expect("one is a number of threads");
    let lens = Pinhole::new(707.0, 707.0, 602.0, 183.0, 0.0).expect("a lens");
    let size = (PIXELS.0 as u32, PIXELS.1 as u32);
    let camera = Camera::from_euler(lens, size, [0.0, 0.0, 1.65], 0.0, 0.02, 0.1).expect("a camera");
    let half = CELL * SIDE as f64 / 2.0;
    let window = BevGrid::new((3.2, 20.0), (-half, half), (CELL, CELL), SampleAt::Center).expect("a grid");
    let (ground, distance) = (Ground::default(), (4.0, 20.0));
    let frame = Frame { camera, mask: None, ground: &ground, from: [0.0, 0.0], distance, weight: 1.0, id: 0 };
    let data = textured(PIXELS.0 * PIXELS.1 * channels);
    let image = ImageView::new(&data, PIXELS, channels).expect("the image fits its size");
    let mut tile = OwnedTile::new(SIDE, Kept { channels, samples: 0, labels: false }).expect("memory for a tile");
    let mut add = || {
        let tile = tile.tile().expect("layers of one tile");
        frame.add(black_box(&image), &window, tile, (0, 0), Some(1)).expect("it fits the tile")
    };
    let cells = add();
    counted(&mut || {
        black_box(add());
    });
    cells
}

/// Warps by a homography, without a table; returns the cells.
fn homography<T: Bilinear>(channels: usize, sample: fn(u8) -> T) -> usize {
    let data: Vec<T> = textured(SIZE.0 * SIZE.1 * channels).into_iter().map(sample).collect();
    let image = ImageView::new(&data, SIZE, channels).expect("the image fits its size");
    let mut out = vec![T::default(); 400 * 400 * channels];
    let mut out = ImageViewMut::new(&mut out, (400, 400), channels).expect("the output fits");
    let m = nalgebra::Matrix3::new(2.1, -0.3, 60.0, 0.1, 1.1, 20.0, 1e-4, 2e-4, 1.0);
    let options = WarpOptions { threads: Some(1), ..WarpOptions::default() };
    let mapping = Mapping::Homography(m);
    counted(&mut || {
        warp_direct_into(black_box(&image), &mapping, &mut out, &options).expect("it fits");
    });
    400 * 400
}
