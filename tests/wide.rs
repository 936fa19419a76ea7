//! Cubic and Lanczos: every instruction set, layout and number of channels gives the same bits, and these are what the
//! formulas give in float64.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should say so")]

#[path = "common/isas.rs"]
mod isas;

use ipm_rs::warp::reference;
use ipm_rs::{
    Bilinear, BorderMode, F16, ImageView, ImageViewMut, Interpolation, Lut, Mapping, WarpOptions, warp_direct_into,
};
use isas::{Job, Number, Random, Rows, Walk, Warp, noise};

const WIDE: [Interpolation; 2] = [Interpolation::Cubic, Interpolation::Lanczos4];

fn same_bits<T: Bilinear + Number>(lut: &Lut, rows: Rows, channels: usize, what: &str, random: &mut Random) {
    let size = (lut.source_size().0 as usize, lut.source_size().1 as usize);
    let data: Vec<T> = noise(rows.layout(size, channels).2, random);
    let border: Vec<T> = noise(channels, random);
    let direct: Warp<T> = |lut, view, out, options| {
        let (map_x, map_y) = lut.maps(f32::NAN).unwrap();
        warp_direct_into(view, &Mapping::MapsF32(&map_x, &map_y), out, options)
    };
    for interpolation in WIDE {
        for warp in [Lut::warp_into as Warp<T>, direct] {
            let job = Job { warp, interpolation };
            job.compare(lut, &rows.view(&data, size, channels), &border, &format_args!("{what}, {rows:?}"));
        }
    }
}

#[test]
fn every_instruction_set_gives_the_bits_of_scalar() {
    let mut random = Random::new(11);
    for size in [(97, 11), (8, 8), (5, 4), (1, 7)] {
        for (index, walk) in Walk::ALL.into_iter().enumerate() {
            if size.0 == 1 && !matches!(walk, Walk::Borders) {
                continue; // walks want an inside
            }
            let lut = walk.lut((size.0.max(2), size.1), 2, 29, &mut random);
            let (rows, what) = (Rows::ALL[index % Rows::ALL.len()], format!("{walk:?} of {size:?}"));
            for channels in [1, 2, 3, 4, 5, 8, 11, 16] {
                same_bits::<u8>(&lut, rows, channels, &what, &mut random);
                same_bits::<f32>(&lut, rows, channels, &what, &mut random);
            }
            for channels in [1, 3, 9] {
                same_bits::<i8>(&lut, rows, channels, &what, &mut random);
                same_bits::<u16>(&lut, rows, channels, &what, &mut random);
                same_bits::<i16>(&lut, rows, channels, &what, &mut random);
                same_bits::<F16>(&lut, rows, channels, &what, &mut random);
                same_bits::<f64>(&lut, rows, channels, &what, &mut random);
            }
        }
    }
}

/// Planes of an image, one by one, are the channels of it as a whole.
#[test]
fn a_channel_does_not_depend_on_how_many_there_are() {
    let mut random = Random::new(12);
    let lut = Walk::Borders.lut((31, 17), 5, 41, &mut random);
    for channels in [2, 3, 4, 9] {
        let data: Vec<f32> = noise(31 * 17 * channels, &mut random);
        let data: Vec<f32> = data.into_iter().map(|x| if x.is_finite() { x % 256.0 } else { 0.0 }).collect();
        for interpolation in WIDE {
            let options = WarpOptions { interpolation, ..WarpOptions::default() };
            let whole = lut.warp(&ImageView::new(&data, (31, 17), channels).unwrap(), &options).unwrap();
            for channel in 0..channels {
                let plane: Vec<f32> = data.iter().skip(channel).step_by(channels).copied().collect();
                let alone = lut.warp(&ImageView::new(&plane, (31, 17), 1).unwrap(), &options).unwrap();
                assert!(whole.iter().skip(channel).step_by(channels).eq(&alone), "{interpolation:?} x{channels}");
            }
        }
    }
}

/// A sample that the oracle knows, and how far from it a warp may be: without a table and with one, of pixels that lie a
/// range apart.
trait Exact: Bilinear + Number + Into<f64> {
    fn of(byte: u8) -> Self;
    const LOWEST: f64;
    const HIGHEST: f64;
    const ALLOWED: [f64; 2];
}

macro_rules! exact {
    ($($type:ty: |$byte:ident| $of:expr, $range:expr, $allowed:expr;)*) => {$(
        impl Exact for $type {
            fn of($byte: u8) -> Self {
                $of
            }
            const LOWEST: f64 = $range.0;
            const HIGHEST: f64 = $range.1;
            const ALLOWED: [f64; 2] = $allowed;
        }
    )*};
}
const ALL: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);
exact! {
    u8: |byte| byte, (0.0, 255.0), [0.501, 0.52];
    i8: |byte| byte.wrapping_sub(128) as i8, (-128.0, 127.0), [0.501, 0.52];
    u16: |byte| u16::from(byte) * 257, (0.0, 65535.0), [0.55, 5.0];
    i16: |byte| i16::from(byte as i8) * 255, (-32768.0, 32767.0), [0.55, 5.0];
    f32: |byte| f32::from(byte), ALL, [255.0 / (1 << 18) as f64, 255.0 / (1 << 13) as f64];
    F16: |byte| F16::from_f32(byte.into()), ALL, [0.13, 0.16];
    f64: |byte| f64::from(byte), ALL, [1e-11, 255.0 / (1 << 13) as f64];
}

fn check<T: Exact>(random: &mut Random, channels: usize) {
    let size = (23, 19);
    let data: Vec<T> = (0..size.0 * size.1 * channels).map(|_| T::of(random.bits() as u8)).collect();
    let view = ImageView::new(&data, size, channels).unwrap();
    let border: Vec<T> = (0..channels).map(|channel| T::of(50 * channel as u8 + 9)).collect();
    let exact_border: Vec<f64> = border.iter().map(|&value| value.into()).collect();
    let cells = 1500;
    let mut along = |size: usize| -> Vec<f64> {
        (0..cells)
            .map(|cell| match cell % 5 {
                0 => (random.unit() * (size as f64 + 12.0) - 6.0).round(),
                1 => random.unit() * (size as f64 + 12.0) - 6.0,
                2 => (random.unit() * size as f64).round() + (random.unit() - 0.5) * 1e-7,
                _ => random.unit() * (size as f64 - 1.0),
            })
            .collect()
    };
    let (map_x, map_y) = (along(size.0), along(size.1));
    let lut = Lut::from_maps(&map_x, &map_y, cells, (size.0 as u32, size.1 as u32)).unwrap();
    for interpolation in WIDE {
        let options = WarpOptions { interpolation, border_value: border.clone(), ..WarpOptions::default() };
        let by_table = lut.warp(&view, &options).unwrap();
        let mut direct = vec![T::default(); cells * channels];
        let mut out = ImageViewMut::new(&mut direct, (cells, 1), channels).unwrap();
        warp_direct_into(&view, &Mapping::MapsF64(&map_x, &map_y), &mut out, &options).unwrap();
        let mut compared = 0;
        for cell in 0..cells {
            let at = [map_x[cell], map_y[cell]];
            let exact = reference::sample(&view, Some(at), interpolation, &exact_border).values;
            let in_halo = at[0] > -1.0 && at[1] > -1.0 && at[0] < size.0 as f64 && at[1] < size.1 as f64;
            for (channel, exact) in exact.into_iter().enumerate() {
                let exact = exact.clamp(T::LOWEST, T::HIGHEST);
                let index = cell * channels + channel;
                let error = (direct[index].into() - exact).abs();
                assert!(error <= T::ALLOWED[0], "{interpolation:?} {at:?}: {:?}, exact {exact}", direct[index]);
                // a table holds no place further out
                let exact = if in_halo { exact } else { exact_border[channel] };
                let error = (by_table[index].into() - exact).abs();
                assert!(error <= T::ALLOWED[1], "{interpolation:?} {at:?}: {:?}, exact {exact}", by_table[index]);
                compared += usize::from(in_halo);
            }
        }
        assert!(compared > 1000, "{compared}");
    }
}

#[test]
fn all_dtypes_are_what_the_formulas_give() {
    let mut random = Random::new(13);
    for channels in [1, 3, 5] {
        check::<u8>(&mut random, channels);
        check::<i8>(&mut random, channels);
        check::<u16>(&mut random, channels);
        check::<i16>(&mut random, channels);
        check::<f32>(&mut random, channels);
        check::<F16>(&mut random, channels);
        check::<f64>(&mut random, channels);
    }
}

/// Sums of weights are 1 to the rounding of float32, so that a sky stays one grey.
#[test]
fn constant_images_stay_constant_and_edges_are_clipped() {
    let mut random = Random::new(14);
    let lut = Walk::Borders.lut((31, 17), 5, 200, &mut random);
    for value in [0u8, 1, 77, 254, 255] {
        for interpolation in WIDE {
            let wide = u16::from(value) * 257;
            let options = WarpOptions { interpolation, border_value: vec![value], ..WarpOptions::default() };
            let image = vec![value; 31 * 17 * 3];
            let got = lut.warp(&ImageView::new(&image, (31, 17), 3).unwrap(), &options).unwrap();
            assert!(got.iter().all(|&cell| cell == value));
            let options = WarpOptions { interpolation, border_value: vec![wide], ..WarpOptions::default() };
            let image = vec![wide; 31 * 17];
            let got = lut.warp(&ImageView::new(&image, (31, 17), 1).unwrap(), &options).unwrap();
            assert!(got.iter().all(|&cell| cell == wide));
        }
    }
}

/// Valid cells near the rim see no border value where cells outside keep what they hold.
#[test]
fn transparent_mirrors_what_valid_cells_reach_beyond_the_image() {
    let (map_x, map_y) = ([0.4, 20.0, 5.5, -0.5], [8.0, 0.25, 15.9, 3.0]);
    let lut = Lut::from_maps(&map_x, &map_y, 4, (21, 17)).unwrap();
    let image: Vec<f32> = (0..21 * 17).map(|i| (i * i % 251) as f32).collect();
    let view = ImageView::new(&image, (21, 17), 1).unwrap();
    for interpolation in WIDE {
        let run = |border_mode, by_table: bool| {
            let options =
                WarpOptions { interpolation, border_mode, border_value: vec![f32::NAN], ..Default::default() };
            let mut cells = [-7.0f32; 4];
            let mut out = ImageViewMut::new(&mut cells, (4, 1), 1).unwrap();
            match by_table {
                true => lut.warp_into(&view, &mut out, &options).unwrap(),
                false => warp_direct_into(&view, &Mapping::MapsF64(&map_x, &map_y), &mut out, &options).unwrap(),
            }
            cells
        };
        let expected = run(Some(BorderMode::Reflect101), false);
        for by_table in [true, false] {
            let got = run(Some(BorderMode::Transparent), by_table);
            for cell in 0..3 {
                assert!((got[cell] - expected[cell]).abs() < 0.05, "{got:?} {expected:?}");
            }
            assert_eq!(got[3], -7.0);
        }
    }
}
