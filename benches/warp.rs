//! Warping the seed job by interpolation, dtype, channels and threads: `cargo bench --bench warp`. Throughput in cells.
//!
//! The image is noise on real geometry: constant images and identity maps hit one cache line and zero weights. Every
//! answer is checked against the oracle before it is timed.

#[path = "../tests/common/mod.rs"]
mod common;

use common::{seed_camera, seed_grid, textured};
use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, Criterion, Throughput, criterion_group, criterion_main};
use ipm_rs::warp::reference;
use ipm_rs::{BevGrid, Bilinear, Camera, Ground, ImageView, ImageViewMut, Interpolation, Lut, WarpOptions};
use nalgebra::Vector3;

const SIZE: (usize, usize) = (2048, 1024);

struct Job {
    camera: Camera,
    grid: BevGrid,
    lut: Lut,
}

impl Job {
    /// Times one dtype and channel count, nearest and bilinear, on one thread and on two.
    fn bench<T: Bilinear + Into<f64>>(
        &self,
        group: &mut BenchmarkGroup<'_, WallTime>,
        name: &str,
        channels: usize,
        sample: fn(u8) -> T,
    ) {
        let data: Vec<T> = textured(SIZE.0 * SIZE.1 * channels).into_iter().map(sample).collect();
        let image = ImageView::new(&data, SIZE, channels).expect("the image fits its size");
        let mut out = vec![T::default(); self.grid.rows() * self.grid.columns() * channels];
        let size = (self.grid.columns(), self.grid.rows());
        for (mode, interpolation) in [("nearest", Interpolation::Nearest), ("bilinear", Interpolation::Bilinear)] {
            for threads in [1, 2] {
                let options = WarpOptions { interpolation, threads: Some(threads), ..WarpOptions::default() };
                let mut warp = || {
                    let mut out = ImageViewMut::new(&mut out, size, channels).expect("the output fits the grid");
                    self.lut.warp_into(&image, &mut out, &options).expect("the image fits the table");
                };
                warp();
                group.bench_function(format!("{mode}/{name}x{channels}/{threads} thread"), |bencher| {
                    bencher.iter(&mut warp);
                });
                self.check(&image, &out, interpolation);
            }
        }
    }

    /// Every 97th cell against the oracle.
    fn check<T: Bilinear + Into<f64>>(&self, image: &ImageView<'_, T>, out: &[T], interpolation: Interpolation) {
        let border = vec![0.0; image.channels()];
        for (cell, values) in out.chunks(image.channels()).enumerate().step_by(97) {
            let (row, column) = ((cell / self.grid.columns()) as f64, (cell % self.grid.columns()) as f64);
            let point = Vector3::new(self.grid.x_of_row(row), self.grid.y_of_column(column), 0.0);
            let pixel = self.camera.project(&point).pixel;
            let expected = reference::sample(image, Some(pixel), interpolation, &border);
            for (&value, exact) in values.iter().zip(expected.values) {
                assert!((value.into() - exact).abs() <= 3.0, "{interpolation:?} cell {cell}");
            }
        }
    }
}

fn warp(criterion: &mut Criterion) {
    let (camera, grid) = (seed_camera(), seed_grid((0.05, 0.025)));
    let lut = Lut::new(&camera, &grid, &Ground::default()).expect("the seed job fits");
    let job = Job { camera, grid, lut };
    let mut group = criterion.benchmark_group("warp");
    group.throughput(Throughput::Elements((grid.rows() * grid.columns()) as u64));
    for channels in [1, 3, 4] {
        job.bench::<u8>(&mut group, "u8", channels, |byte| byte);
    }
    for channels in [1, 3] {
        job.bench::<u16>(&mut group, "u16", channels, |byte| u16::from(byte) * 257);
        job.bench::<f32>(&mut group, "f32", channels, f32::from);
    }
    job.bench::<f32>(&mut group, "f32", 16, f32::from);
    group.finish();
}

criterion_group!(benches, warp);
criterion_main!(benches);
