//! Every instruction set gives what the scalar kernels give, with `==`; and these are within their promise of exact
//! real arithmetic.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should say so")]

mod common;
#[path = "common/isas.rs"]
mod isas;

use common::{image, seed_camera, seed_grid, textured};
use ipm_rs::warp::reference;
use ipm_rs::{Bilinear, F16, Ground, ImageView, ImageViewMut, Interpolation, Isa, Lut, WarpOptions};
use isas::{Job, Number, Random, Rows, Walk, noise};
use nalgebra::Vector3;
use proptest::prelude::*;

/// Compares one table and layout in one dtype.
fn compare<T: Number>(job: &Job<T>, lut: &Lut, rows: Rows, channels: usize, what: &str, random: &mut Random) {
    let size = (lut.source_size().0 as usize, lut.source_size().1 as usize);
    let data: Vec<T> = noise(rows.layout(size, channels).2, random);
    let border: Vec<T> = noise(channels, random);
    job.compare(lut, &rows.view(&data, size, channels), &border, &format_args!("{what}, {rows:?}"));
}

fn bilinear<T: Bilinear + Number>(lut: &Lut, rows: Rows, channels: usize, what: &str, random: &mut Random) {
    compare(&Job::<T>::bilinear(), lut, rows, channels, what, random);
}

fn area<T: Bilinear + Number>(lut: &Lut, rows: Rows, channels: usize, what: &str, random: &mut Random) {
    compare(&Job::<T>::area(), lut, rows, channels, what, random);
}

fn direct<T: Bilinear + Number>(lut: &Lut, rows: Rows, channels: usize, what: &str, random: &mut Random) {
    compare(&Job::<T>::direct(), lut, rows, channels, &format!("{what}, without a table"), random);
}

fn nearest<T: Number>(lut: &Lut, rows: Rows, channels: usize, what: &str, random: &mut Random) {
    compare(&Job::<T>::nearest(), lut, rows, channels, what, random);
}

const CHANNELS: [usize; 10] = [1, 2, 3, 4, 5, 6, 7, 8, 9, 16];

/// Every dtype and channel count, bilinear, area and nearest.
fn everything(lut: &Lut, rows: Rows, what: &str, random: &mut Random) {
    for channels in CHANNELS {
        bilinear::<u8>(lut, rows, channels, what, random);
        bilinear::<u16>(lut, rows, channels, what, random);
        bilinear::<f32>(lut, rows, channels, what, random);
        area::<u8>(lut, rows, channels, what, random);
        nearest::<u8>(lut, rows, channels, what, random);
        direct::<f32>(lut, rows, channels, what, random);
    }
    for channels in [1, 2, 3, 4, 5] {
        bilinear::<i8>(lut, rows, channels, what, random);
        bilinear::<i16>(lut, rows, channels, what, random);
        bilinear::<F16>(lut, rows, channels, what, random);
        bilinear::<f64>(lut, rows, channels, what, random);
        direct::<F16>(lut, rows, channels, what, random);
        direct::<f64>(lut, rows, channels, what, random);
    }
    direct::<u8>(lut, rows, 3, what, random);
    direct::<u16>(lut, rows, 3, what, random);
    direct::<i16>(lut, rows, 3, what, random);
    area::<u16>(lut, rows, 3, what, random);
    area::<f32>(lut, rows, 3, what, random);
    area::<i8>(lut, rows, 3, what, random);
    area::<i16>(lut, rows, 2, what, random);
    area::<F16>(lut, rows, 3, what, random);
    area::<f64>(lut, rows, 3, what, random);
    // pixels of 2, 4, 6, 8, 12 and 16 bytes in the samples in which they come; those of 1 and 3 are above
    nearest::<u16>(lut, rows, 1, what, random);
    nearest::<u16>(lut, rows, 3, what, random);
    nearest::<u16>(lut, rows, 4, what, random);
    nearest::<f32>(lut, rows, 1, what, random);
    nearest::<u32>(lut, rows, 2, what, random);
    nearest::<f32>(lut, rows, 3, what, random);
    nearest::<f32>(lut, rows, 4, what, random);
    nearest::<u64>(lut, rows, 1, what, random);
    nearest::<u64>(lut, rows, 2, what, random);
}

/// Run lengths over every walk: all tails of every group size up to 64.
#[test]
fn every_run_length() {
    let mut random = Random::new(1);
    for cells in 1..=70 {
        for (index, walk) in Walk::ALL.into_iter().enumerate() {
            let lut = walk.lut((97, 11), 1, cells, &mut random);
            // all layouts in five lengths
            let rows = Rows::ALL[(cells + index) % Rows::ALL.len()];
            everything(&lut, rows, &format!("{walk:?}"), &mut random);
        }
    }
}

/// Every layout of every walk in images from the smallest that has an inside to some wider than a window.
#[test]
fn every_size_and_layout() {
    let mut random = Random::new(2);
    for size in [(2, 2), (3, 2), (2, 3), (5, 4), (9, 2), (23, 3), (64, 5), (200, 2)] {
        for rows in Rows::ALL {
            for walk in Walk::ALL {
                let lut = walk.lut(size, 2, 37, &mut random);
                everything(&lut, rows, &format!("{walk:?} of {size:?}"), &mut random);
            }
        }
    }
}

/// Images of one row or column have no cell with four pixels, only rim and halo.
#[test]
fn images_without_an_inside() {
    let mut random = Random::new(3);
    for size in [(1, 1), (1, 7), (40, 1)] {
        for rows in Rows::ALL {
            let mut coordinate = |size: usize| (0..40).map(|_| random.unit() * (size as f64 + 2.0) - 1.0).collect();
            let (map_x, map_y): (Vec<f64>, Vec<f64>) = (coordinate(size.0), coordinate(size.1));
            let lut = Lut::from_maps(&map_x, &map_y, 40, (size.0 as u32, size.1 as u32)).unwrap();
            everything(&lut, rows, &format!("{size:?}"), &mut random);
        }
    }
}

/// The seed job, half as fine, on two threads: long runs, and all that a real view does to offsets.
#[test]
fn the_seed_job() {
    let mut random = Random::new(4);
    let camera = seed_camera().resized(1024, 512).unwrap();
    let lut = Lut::new(&camera, &seed_grid((0.2, 0.05)), &Ground::default()).unwrap();
    let coarse = Lut::new(&camera, &seed_grid((0.5, 0.2)), &Ground::default()).unwrap();
    for channels in [1, 2, 3, 4] {
        for (lut, what) in [(&lut, "seed"), (&coarse, "coarse seed")] {
            area::<u8>(lut, Rows::Contiguous, channels, what, &mut random);
            area::<u8>(lut, Rows::Padded(67), channels, what, &mut random);
            area::<u16>(lut, Rows::Contiguous, channels, what, &mut random);
            area::<f32>(lut, Rows::Contiguous, channels, what, &mut random);
        }
        bilinear::<u8>(&lut, Rows::Contiguous, channels, "seed", &mut random);
        bilinear::<u8>(&lut, Rows::Padded(67), channels, "seed", &mut random);
        bilinear::<u16>(&lut, Rows::Contiguous, channels, "seed", &mut random);
        bilinear::<f32>(&lut, Rows::Contiguous, channels, "seed", &mut random);
        nearest::<u8>(&lut, Rows::Contiguous, channels, "seed", &mut random);
        nearest::<u16>(&lut, Rows::Contiguous, channels, "seed", &mut random);
        nearest::<f32>(&lut, Rows::Contiguous, channels, "seed", &mut random);
    }
    bilinear::<f32>(&lut, Rows::Contiguous, 16, "seed", &mut random);
    nearest::<u64>(&lut, Rows::Contiguous, 1, "seed", &mut random);
}

/// Several images of one channel, which a kernel may blend together: each as scalar has it alone.
#[test]
fn planes_equal_images_one_by_one() {
    fn planes<T: Bilinear + Number>(lut: &Lut, count: usize, what: &str, random: &mut Random) {
        let size = (lut.source_size().0 as usize, lut.source_size().1 as usize);
        let data: Vec<T> = noise(size.0 * size.1 * count, random);
        let images: Vec<_> =
            data.chunks(size.0 * size.1).map(|plane| ImageView::new(plane, size, 1).unwrap()).collect();
        let border_value: Vec<T> = noise(count, random);
        for isa in isas::compared() {
            for threads in [1, 2] {
                let cells = lut.rows() * lut.columns();
                let mut out = vec![T::default(); cells * count];
                let mut outs: Vec<_> = out
                    .chunks_mut(cells)
                    .map(|plane| ImageViewMut::new(plane, (lut.columns(), lut.rows()), 1).unwrap())
                    .collect();
                let options = WarpOptions {
                    border_value: border_value.clone(),
                    isa: Some(isa),
                    threads: Some(threads),
                    ..WarpOptions::default()
                };
                lut.warp_many_into(&images, &mut outs, &options).unwrap();
                for (plane, got) in out.chunks(cells).enumerate() {
                    let border_value = vec![border_value[plane]];
                    let alone = WarpOptions { border_value, isa: Some(Isa::Scalar), ..WarpOptions::default() };
                    let expected = lut.warp(&images[plane], &alone).unwrap();
                    let differs = got.iter().zip(&expected).position(|(got, expected)| !got.same(*expected));
                    assert_eq!(differs, None, "{}, plane {plane} of {count}, {what}", isa.name());
                }
            }
        }
    }
    let mut random = Random::new(6);
    for count in 1..=9 {
        for walk in Walk::ALL {
            let cells = 1 + (random.bits() >> 32) as usize % 70;
            let lut = walk.lut((61, 7), 3, cells, &mut random);
            planes::<f32>(&lut, count, &format!("{walk:?}"), &mut random);
            planes::<u8>(&lut, count, &format!("{walk:?}"), &mut random);
        }
    }
    // larger than what threads share out at once
    let camera = seed_camera().resized(512, 256).unwrap();
    let lut = Lut::new(&camera, &seed_grid((0.2, 0.05)), &Ground::default()).unwrap();
    planes::<f32>(&lut, 6, "seed", &mut random);
}

/// Unless the environment names another, a warp uses the last of those available.
#[test]
fn the_best_is_in_use() {
    if std::env::var_os("IPM_RS_ISA").is_none() {
        assert_eq!(Isa::active().unwrap(), *Isa::available().last().unwrap());
    }
    isas::compared().for_each(|isa| assert_eq!(isa.checked(), Ok(isa)));
}

/// Scalar against float64 on noise, over the whole seed job; what holds for it holds for all.
#[test]
fn scalar_is_within_its_promise_of_exact_arithmetic() {
    let (camera, grid) = (seed_camera(), seed_grid((0.05, 0.025)));
    let lut = Lut::new(&camera, &grid, &Ground::default()).unwrap();
    let data = textured(2048 * 1024 * 3);
    let view = image(&data, 2048, 1024, 3);
    let options = WarpOptions { isa: Some(Isa::Scalar), ..WarpOptions::default() };
    let got = lut.warp(&view, &options).unwrap();
    let (mut samples, mut rounded, mut worst) = (0usize, 0usize, 0.0f64);
    // every third row: one is a cut through all distances
    for row in (0..grid.rows()).step_by(3) {
        for column in 0..grid.columns() {
            let point = Vector3::new(grid.x_of_row(row as f64), grid.y_of_column(column as f64), 0.0);
            let pixel = camera.project(&point).pixel;
            let exact = reference::sample(&view, Some(pixel), Interpolation::Bilinear, &[0.0; 3]);
            if !exact.valid {
                continue;
            }
            let cell = &got[(row * grid.columns() + column) * 3..][..3];
            for (&value, exact) in cell.iter().zip(exact.values) {
                let error = (f64::from(value) - exact).abs();
                worst = worst.max(error);
                rounded += usize::from(error <= 0.5);
                samples += 1;
            }
        }
    }
    let share = rounded as f64 / samples as f64;
    assert!(samples > 500_000, "{samples}");
    assert!(worst <= 0.52, "{worst}");
    assert!(share >= 0.995, "{share}");
}

proptest! {
    #[test]
    fn any_size_layout_walk_and_length(
        (width, height) in (2usize..150, 2usize..20),
        (rows, cells) in (1usize..4, 1usize..300),
        (gap, layout) in (0usize..80, 0usize..4),
        walk in walk(),
        seed: u64,
    ) {
        let layout = [Rows::Contiguous, Rows::Padded(gap), Rows::Backwards(gap), Rows::Repeated][layout];
        let mut random = Random::new(seed);
        let lut = walk.lut((width, height), rows, cells, &mut random);
        everything(&lut, layout, &format!("{walk:?} of {width} x {height}"), &mut random);
    }
}

fn walk() -> impl Strategy<Value = Walk> {
    prop_oneof![
        (0.0..12.0f64).prop_map(Walk::FromStart),
        (0.0..12.0f64).prop_map(Walk::ToEnd),
        (0.0..12.0f64).prop_map(Walk::Mirrored),
        (1usize..20).prop_map(Walk::Jumps),
        prop::sample::select(&Walk::ALL[..]),
    ]
}
