//! Rings of cameras: `cargo bench --bench rig`. Throughput in cells.

#[path = "../tests/common/mod.rs"]
mod common;

use common::textured;
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use ipm_rs::rig::{RigLut, RigOptions};
use ipm_rs::{BevGrid, Camera, Ground, ImageView, ImageViewMut, Lut, Pinhole, SampleAt, WarpOptions};

const SIZE: (usize, usize) = (1600, 900);

/// Six cameras all around a car, one of 90 degrees and five of 65, as those of nuScenes.
fn ring() -> [(&'static str, Camera); 6] {
    let camera = |degrees: f64| {
        let (yaw, focal) = (degrees.to_radians(), if degrees == 180.0 { 810.0 } else { 1260.0 });
        let lens = Pinhole::new(focal, focal, 799.5, 449.5, 0.0).expect("the numbers are good");
        let position = [1.0 + 0.6 * yaw.cos(), 0.6 * yaw.sin(), 1.5];
        Camera::from_euler(lens, (SIZE.0 as u32, SIZE.1 as u32), position, 0.0, 0.0, yaw).expect("the numbers are good")
    };
    [
        ("front", camera(0.0)),
        ("front left", camera(55.0)),
        ("front right", camera(-55.0)),
        ("back", camera(180.0)),
        ("back left", camera(110.0)),
        ("back right", camera(-110.0)),
    ]
}

/// 60 x 60 m around it, at 5 cm.
fn around() -> BevGrid {
    BevGrid::new((-30.0, 30.0), (-30.0, 30.0), (0.05, 0.05), SampleAt::Center).expect("the numbers are good")
}

/// What the ring costs beyond the tables of its cameras: who wins each cell, and the weights along seams.
fn build(criterion: &mut Criterion) {
    let (cameras, grid, ground) = (ring(), around(), Ground::default());
    let mut group = criterion.benchmark_group("rig");
    group.throughput(Throughput::Elements((grid.rows() * grid.columns()) as u64));
    group.bench_function("six tables", |bencher| {
        bencher.iter(|| cameras.each_ref().map(|(_, camera)| Lut::new(camera, &grid, &ground).expect("memory")));
    });
    for (name, feather) in [("feathered", 0.5), ("hard seams", 0.0)] {
        let options = RigOptions { feather, ..RigOptions::default() };
        group.bench_function(name, |bencher| bencher.iter(|| RigLut::new(&cameras, &grid, &ground, &options)));
    }
    group.finish();
}

/// One view of six pictures, and the views that it is made of one by one.
fn warp(criterion: &mut Criterion) {
    let (cameras, grid, ground) = (ring(), around(), Ground::default());
    let rig = RigLut::new(&cameras, &grid, &ground, &RigOptions { feather: 0.5, ..RigOptions::default() })
        .expect("the ring fits");
    let luts = cameras.each_ref().map(|(_, camera)| Lut::new(camera, &grid, &ground).expect("memory"));
    let data = textured(SIZE.0 * SIZE.1 * 3);
    let image = ImageView::new(&data, SIZE, 3).expect("the image fits its size");
    let mut bev = vec![0; grid.rows() * grid.columns() * 3];
    let options = WarpOptions::default();

    let mut group = criterion.benchmark_group("rig, u8x3");
    group.throughput(Throughput::Elements((grid.rows() * grid.columns()) as u64));
    let mut out = ImageViewMut::new(&mut bev, (grid.columns(), grid.rows()), 3).expect("the output fits");
    group.bench_function("six warps", |bencher| {
        bencher.iter(|| luts.iter().try_for_each(|lut| lut.warp_into(&image, &mut out, &options)));
    });
    group.bench_function("bilinear", |bencher| {
        bencher.iter(|| rig.warp_into(&[image; 6], &mut out, &options, &[]));
    });
    group.finish();
}

criterion_group!(benches, build, warp);
criterion_main!(benches);
