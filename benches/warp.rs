//! Warping the seed job by interpolation, dtype, channels and threads: `cargo bench --bench warp`. Throughput in cells.
//!
//! The image is noise on real geometry: constant images and identity maps hit one cache line and zero weights. Every
//! answer is checked against the oracle before it is timed. Area has cells of its own, which cover many pixels each.

#[path = "../tests/common/mod.rs"]
mod common;

use common::{seed_camera, seed_grid, textured};
use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, Criterion, Throughput, criterion_group, criterion_main};
use ipm_rs::warp::reference::{self, Cell};
use ipm_rs::{BevGrid, Bilinear, Camera, Ground, ImageView, ImageViewMut, Interpolation, Lut, WarpOptions};
use nalgebra::Vector3;

const SIZE: (usize, usize) = (2048, 1024);

struct Job {
    camera: Camera,
    grid: BevGrid,
    lut: Lut,
}

impl Job {
    /// The seed job with cells of so many metres.
    fn new(resolution: (f64, f64)) -> Self {
        let (camera, grid) = (seed_camera(), seed_grid(resolution));
        let lut = Lut::new(&camera, &grid, &Ground::default()).expect("the seed job fits");
        Self { camera, grid, lut }
    }

    fn throughput(&self) -> Throughput {
        Throughput::Elements((self.grid.rows() * self.grid.columns()) as u64)
    }

    /// Times one dtype and channel count, by interpolation, on one thread and on two.
    fn bench<T: Bilinear + Into<f64>>(
        &self,
        group: &mut BenchmarkGroup<'_, WallTime>,
        name: &str,
        channels: usize,
        interpolations: &[Interpolation],
        sample: fn(u8) -> T,
    ) {
        let data: Vec<T> = textured(SIZE.0 * SIZE.1 * channels).into_iter().map(sample).collect();
        let image = ImageView::new(&data, SIZE, channels).expect("the image fits its size");
        let mut out = vec![T::default(); self.grid.rows() * self.grid.columns() * channels];
        let size = (self.grid.columns(), self.grid.rows());
        for &interpolation in interpolations {
            let mode = interpolation.name();
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
                if interpolation == Interpolation::Area {
                    self.check_area(&image, &out);
                } else {
                    self.check(&image, &out, interpolation);
                }
            }
        }
    }

    /// Every 97th cell against the oracle.
    fn check<T: Bilinear + Into<f64>>(&self, image: &ImageView<'_, T>, out: &[T], interpolation: Interpolation) {
        for (cell, values) in out.chunks(image.channels()).enumerate().step_by(97) {
            let expected = self.sample(image, cell, (0.0, 0.0), interpolation);
            for (&value, exact) in values.iter().zip(expected.values) {
                assert!((value.into() - exact).abs() <= 3.0, "{interpolation:?} cell {cell}");
            }
        }
    }

    /// Every 97th cell that the image covers against the mean of 16 x 16 samples. The root-mean-square difference on noise
    /// is 7.8 grey levels at 10 cm and 5.5 at 20 cm; bilinear's is 44 and 47.
    fn check_area<T: Bilinear + Into<f64>>(&self, image: &ImageView<'_, T>, out: &[T]) {
        let offsets = || (0..16).map(|step| (f64::from(step) + 0.5) / 16.0 - 0.5);
        let mut squares = Vec::new();
        for (cell, values) in out.chunks(image.channels()).enumerate().step_by(97) {
            let samples: Vec<_> = offsets()
                .flat_map(|down| offsets().map(move |across| (down, across)))
                .map(|into_cell| self.sample(image, cell, into_cell, Interpolation::Bilinear))
                .collect();
            if samples.iter().all(|sample| sample.valid) {
                for (channel, &value) in values.iter().enumerate() {
                    let sum: f64 = samples.iter().map(|sample| sample.values[channel]).sum();
                    squares.push((value.into() - sum / 256.0).powi(2));
                }
            }
        }
        let error = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
        assert!(error <= 10.0, "area is {error} off");
    }

    /// The oracle's answer at a place of a cell, in cells from the cell's own sample.
    fn sample<T: Bilinear + Into<f64>>(
        &self,
        image: &ImageView<'_, T>,
        cell: usize,
        (down, across): (f64, f64),
        interpolation: Interpolation,
    ) -> Cell {
        let (row, column) = ((cell / self.grid.columns()) as f64, (cell % self.grid.columns()) as f64);
        let point = Vector3::new(self.grid.x_of_row(row + down), self.grid.y_of_column(column + across), 0.0);
        reference::sample(image, Some(self.camera.project(&point).pixel), interpolation, &vec![0.0; image.channels()])
    }
}

fn warp(criterion: &mut Criterion) {
    let job = Job::new((0.05, 0.025));
    let mut group = criterion.benchmark_group("warp");
    group.throughput(job.throughput());
    let four_pixels_at_most = [Interpolation::Nearest, Interpolation::Bilinear];
    for channels in [1, 3, 4] {
        job.bench::<u8>(&mut group, "u8", channels, &four_pixels_at_most, |byte| byte);
    }
    for channels in [1, 3] {
        job.bench::<u16>(&mut group, "u16", channels, &four_pixels_at_most, |byte| u16::from(byte) * 257);
        job.bench::<f32>(&mut group, "f32", channels, &four_pixels_at_most, f32::from);
    }
    job.bench::<f32>(&mut group, "f32", 16, &four_pixels_at_most, f32::from);
    for (name, metres) in [("10 cm/u8", 0.1), ("20 cm/u8", 0.2)] {
        let job = Job::new((metres, metres));
        group.throughput(job.throughput());
        job.bench::<u8>(&mut group, name, 3, &[Interpolation::Area], |byte| byte);
    }
    group.finish();
}

criterion_group!(benches, warp);
criterion_main!(benches);
