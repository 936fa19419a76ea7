//! Maps with any numbers, in every border mode, through a table and without one, against the oracle.

use ipm_rs::warp::reference;
use ipm_rs::{BorderMode, ImageView, ImageViewMut, Interpolation, Lut, Mapping, WarpOptions, warp_direct_into};

use crate::input::Input;
use crate::uses;

pub fn run(data: &[u8]) {
    let mut input = Input::new(data);
    let (width, height) = (input.count(1, 40), input.count(1, 30));
    let (rows, columns) = (input.count(1, 6), input.count(1, 50));
    let (mode, wraps, single) = (input.border_mode(), input.flag(), input.flag());
    let scale = 1.5 * width.max(height) as f64;
    let cell = |input: &mut Input<'_>| {
        let [x, y] = input.point(scale);
        // the same coordinates for a map of either kind
        if single { (f64::from(x as f32), f64::from(y as f32)) } else { (x, y) }
    };
    let (x, y): (Vec<f64>, Vec<f64>) = (0..rows * columns).map(|_| cell(&mut input)).unzip();
    let source = (width as u32, height as u32);
    let lut = Lut::from_maps_with(&x, &y, columns, source, mode, wraps);
    let Ok(lut) = lut else {
        assert!(mode == BorderMode::Transparent, "maps with any numbers are good");
        return;
    };
    if single {
        let (x, y): (Vec<f32>, Vec<f32>) = x.iter().zip(&y).map(|(&x, &y)| (x as f32, y as f32)).unzip();
        assert!(lut == Lut::from_maps_with(&x, &y, columns, source, mode, wraps).expect("the same maps"));
    }
    if mode == BorderMode::Constant && !wraps {
        against_the_oracle(&lut, &x, &y, &mut input);
    }
    uses::everything(&lut, &mut input);
}

/// Nearest is equal, bilinear within 0.52, the mask exact; and what needs no table gives the same.
fn against_the_oracle(lut: &Lut, x: &[f64], y: &[f64], input: &mut Input<'_>) {
    let size = (lut.source_size().0 as usize, lut.source_size().1 as usize);
    let mut noise = input.bits() | 1;
    let pixels: Vec<u8> = (0..size.0 * size.1)
        .map(|_| {
            noise ^= noise << 13;
            noise ^= noise >> 7;
            noise ^= noise << 17;
            (noise >> 32) as u8
        })
        .collect();
    let view = ImageView::new(&pixels, size, 1).expect("an image");
    let mask = lut.mask().expect("memory");
    for interpolation in [Interpolation::Nearest, Interpolation::Bilinear] {
        let options = WarpOptions { interpolation, border_value: vec![77], ..WarpOptions::default() };
        let got = lut.warp(&view, &options).expect("the image fits the table");
        for (cell, &value) in got.iter().enumerate() {
            let coordinate = (x[cell].is_finite() && y[cell].is_finite()).then_some([x[cell], y[cell]]);
            let expected = reference::sample(&view, coordinate, interpolation, &[77.0]);
            assert_eq!(mask[cell], expected.valid, "cell {cell} at {coordinate:?}");
            let error = (f64::from(value) - expected.values[0]).abs();
            let most = if interpolation == Interpolation::Nearest { 0.0 } else { 0.52 };
            assert!(error <= most, "cell {cell} at {coordinate:?}: {value}, exact {}", expected.values[0]);
        }
        let mut direct = vec![0; got.len()];
        let mut out = ImageViewMut::new(&mut direct, (lut.columns(), lut.rows()), 1).expect("an output");
        warp_direct_into(&view, &Mapping::MapsF64(x, y), &mut out, &options).expect("the maps fit");
        assert_eq!(direct, got, "{interpolation:?} without a table");
    }
}
