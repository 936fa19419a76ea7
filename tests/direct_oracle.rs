//! Warps without a table against the oracle: floats to the rounding of their own arithmetic, integers as a table has them.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should say so")]

mod common;

use common::textured;
use ipm_rs::warp::reference;
use ipm_rs::{
    Bilinear, BorderMode, F16, ImageView, ImageViewMut, Interpolation, Mapping, WarpOptions, warp_direct_into,
};
use nalgebra::{Matrix3, Vector3};
use proptest::prelude::*;

/// A dtype, pictures of it, and how far a value may be from the exact one.
trait Direct: Bilinear + Into<f64> {
    fn from_byte(byte: u8) -> Self;

    /// Of a blend of pixels that lie `range` apart and at most `largest` from 0.
    fn allowed(range: f64, largest: f64) -> f64;
}

/// Of the range of the pixels: what is promised of floats.
const OF_RANGE: f64 = 1.0 / (1 << 20) as f64;

impl Direct for f32 {
    fn from_byte(byte: u8) -> Self {
        f32::from(byte) * 0.37 - 40.0
    }
    /// Each of the three roundings of a blend is half a unit.
    fn allowed(range: f64, largest: f64) -> f64 {
        range * OF_RANGE + 1.5 * largest * f64::from(f32::EPSILON)
    }
}

impl Direct for f64 {
    /// Eastings in metres: what varies is a 10^-6 part of the number.
    fn from_byte(byte: u8) -> Self {
        5e6 + f64::from(byte) * 0.004
    }
    fn allowed(range: f64, _: f64) -> f64 {
        range * OF_RANGE / 64.0
    }
}

impl Direct for F16 {
    fn from_byte(byte: u8) -> Self {
        F16::from_f32(f32::from_byte(byte))
    }
    /// Half a unit of the last of eleven bits.
    fn allowed(range: f64, largest: f64) -> f64 {
        range * OF_RANGE + largest / 2048.0
    }
}

impl Direct for u8 {
    fn from_byte(byte: u8) -> Self {
        byte
    }
    fn allowed(_: f64, _: f64) -> f64 {
        0.52
    }
}

impl Direct for i16 {
    fn from_byte(byte: u8) -> Self {
        i16::from(byte as i8) * 255
    }
    fn allowed(_: f64, _: f64) -> f64 {
        3.0
    }
}

/// Where a mode has what lies at a place, for bilinear. None of a coordinate that is no number.
fn folded(mode: BorderMode, at: f64, size: usize) -> f64 {
    let (count, last) = (size as f64, size as f64 - 1.0);
    match mode {
        BorderMode::Constant | BorderMode::Transparent => at,
        _ if !at.is_finite() => f64::NAN,
        BorderMode::Replicate => at.clamp(0.0, last),
        BorderMode::Reflect => {
            let within = (at + 0.5).rem_euclid(2.0 * count);
            (if within > count { 2.0 * count - within } else { within } - 0.5).clamp(0.0, last)
        }
        BorderMode::Reflect101 if last == 0.0 => 0.0,
        BorderMode::Reflect101 => {
            let within = at.rem_euclid(2.0 * last);
            if within > last { 2.0 * last - within } else { within }
        }
        BorderMode::Wrap => at.rem_euclid(count),
    }
}

/// The exact value where a mode has it: of a wrapped image from one that has its first column and row again at the end.
fn exact<T: Direct>(
    image: &ImageView<'_, T>,
    [u, v]: [f64; 2],
    border: &[f64],
    mode: BorderMode,
    kept: f64,
) -> Vec<f64> {
    let (width, height, channels) = (image.width(), image.height(), image.channels());
    let at = [folded(mode, u, width), folded(mode, v, height)];
    if mode == BorderMode::Wrap {
        let data: Vec<T> = (0..=height)
            .flat_map(|y| (0..=width).flat_map(move |x| image.pixel(x % width, y % height).iter().copied()))
            .collect();
        let twice = ImageView::new(&data, (width + 1, height + 1), channels).unwrap();
        return reference::sample(&twice, Some(at), Interpolation::Bilinear, border).values;
    }
    let cell = reference::sample(image, Some(at), Interpolation::Bilinear, border);
    if mode == BorderMode::Transparent && !cell.valid { vec![kept; channels] } else { cell.values }
}

fn compare<T: Direct>(
    mapping: &Mapping<'_>,
    (columns, rows): (usize, usize),
    coordinate: impl Fn(usize) -> [f64; 2],
    (width, height): (usize, usize),
    channels: usize,
    border_mode: BorderMode,
) {
    let data: Vec<T> = textured(width * height * channels).into_iter().map(T::from_byte).collect();
    let view = ImageView::new(&data, (width, height), channels).unwrap();
    let border: Vec<T> = (0..channels).map(|channel| T::from_byte(50 * (channel as u8 + 1) % 251)).collect();
    let exact_border: Vec<f64> = border.iter().map(|&value| value.into()).collect();
    let all = data.iter().chain(&border).map(|&value| value.into());
    let (low, high) = all.fold((f64::MAX, f64::MIN), |(low, high), value| (low.min(value), high.max(value)));
    let allowed = T::allowed(high - low, low.abs().max(high.abs()));
    let options = WarpOptions {
        border_value: border,
        border_mode: Some(border_mode),
        threads: Some(2),
        ..WarpOptions::default()
    };
    let kept = T::from_byte(77);
    let mut got = vec![kept; columns * rows * channels];
    let mut out = ImageViewMut::new(&mut got, (columns, rows), channels).unwrap();
    warp_direct_into(&view, mapping, &mut out, &options).unwrap();
    for (cell, values) in got.chunks(channels).enumerate() {
        let [u, v] = coordinate(cell);
        let expected = exact(&view, [u, v], &exact_border, border_mode, kept.into());
        for (&value, exact) in values.iter().zip(expected) {
            let value: f64 = value.into();
            assert!(
                (value - exact).abs() <= allowed,
                "{} ({u}, {v}) {border_mode:?} of {width} x {height}: {value}, exact {exact}, allowed {allowed}",
                std::any::type_name::<T>()
            );
        }
    }
}

proptest! {
    #[test]
    fn maps_of_any_numbers(
        (width, height, channels) in (1usize..9, 1usize..9, 1usize..6),
        coordinates in prop::collection::vec((coordinate(), coordinate()), 1..700),
        mode in prop::sample::select(&BorderMode::ALL[..]),
    ) {
        let map_x: Vec<f64> = coordinates.iter().map(|c| c.0).collect();
        let map_y: Vec<f64> = coordinates.iter().map(|c| c.1).collect();
        let (mapping, cells) = (Mapping::MapsF64(&map_x, &map_y), (map_x.len(), 1));
        let at = |cell: usize| [map_x[cell], map_y[cell]];
        compare::<f32>(&mapping, cells, at, (width, height), channels, mode);
        compare::<f64>(&mapping, cells, at, (width, height), channels, mode);
        compare::<F16>(&mapping, cells, at, (width, height), channels, mode);
        compare::<u8>(&mapping, cells, at, (width, height), channels, mode);
        compare::<i16>(&mapping, cells, at, (width, height), channels, mode);
    }
}

#[test]
fn homographies() {
    let m = Matrix3::new(0.9, 0.02, -3.0, -0.03, 1.02, -2.0, 1e-3, 2e-3, 1.0);
    let (columns, rows) = (61, 40);
    let at = |cell: usize| {
        let q = m * Vector3::new((cell % columns) as f64, (cell / columns) as f64, 1.0);
        [q.x / q.z, q.y / q.z]
    };
    for mode in BorderMode::ALL {
        for channels in 1..=5 {
            compare::<f32>(&Mapping::Homography(m), (columns, rows), at, (50, 37), channels, mode);
            compare::<f64>(&Mapping::Homography(m), (columns, rows), at, (50, 37), channels, mode);
            compare::<F16>(&Mapping::Homography(m), (columns, rows), at, (50, 37), channels, mode);
        }
    }
}

/// Within a step of a table of the next pixel, where a rounded coordinate would be that pixel.
#[test]
fn close_below_a_pixel() {
    let map_x: Vec<f64> = (0..40).map(|i| f64::from(i % 4 + 1) - 1e-5).collect();
    let map_y: Vec<f64> = (0..40).map(|i| f64::from(i / 10) - if i > 10 { 1e-6 } else { 0.0 }).collect();
    let at = |cell: usize| [map_x[cell], map_y[cell]];
    compare::<f32>(&Mapping::MapsF64(&map_x, &map_y), (40, 1), at, (6, 4), 1, BorderMode::Constant);
    compare::<f64>(&Mapping::MapsF64(&map_x, &map_y), (40, 1), at, (6, 4), 3, BorderMode::Constant);
}

/// Coordinates of every kind: inside, on pixel centres and halves, in the halo, far outside, not finite.
fn coordinate() -> impl Strategy<Value = f64> {
    prop_oneof![
        6 => -2.0..10.0f64,
        2 => (-4..20i32).prop_map(|halves| f64::from(halves) * 0.5),
        1 => (-4..20i32, -1.0..1.0f64).prop_map(|(halves, tiny)| f64::from(halves) * 0.5 + tiny * 1e-6),
        1 => prop_oneof![Just(f64::NAN), Just(f64::INFINITY), Just(f64::NEG_INFINITY), Just(-0.0)],
    ]
}
