//! Transposes of warps: `<warp(x), y> == <x, adjoint(y)>` for tables of any maps, and of rings of cameras.

use ipm_rs::rig::{BlendMode, RigLut, RigOptions};
use ipm_rs::{BevGrid, BorderMode, Ground, ImageView, ImageViewMut, Interpolation, Lut, SampleAt, WarpOptions};

use crate::input::Input;

pub fn run(data: &[u8]) {
    let mut input = Input::new(data);
    let interpolation = input.one_of(&[Interpolation::Nearest, Interpolation::Bilinear, Interpolation::Area]);
    if input.flag() { table(&mut input, interpolation) } else { ring(&mut input, interpolation) }
}

/// Whole numbers, so that sums are exact but for the weights.
fn whole(count: usize, input: &mut Input<'_>) -> Vec<f64> {
    let mut state = input.bits() | 1;
    let mut next = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        ((state >> 32) & 0xff) as f64
    };
    (0..count).map(|_| next()).collect()
}

fn close(warped: f64, adjoint: f64, what: &str) {
    assert!((warped - adjoint).abs() <= 1e-5 * (1.0 + warped.abs()), "{what}: {warped} {adjoint}");
}

fn product(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn table(input: &mut Input<'_>, interpolation: Interpolation) {
    let (width, height) = (input.count(1, 24), input.count(1, 24));
    let (rows, columns, channels) = (input.count(1, 6), input.count(1, 40), input.count(1, 4));
    let scale = 1.2 * width.max(height) as f64;
    let smooth = input.flag();
    let step = [input.number(3.0), input.number(3.0)];
    let (x, y): (Vec<f64>, Vec<f64>) = (0..rows * columns)
        .map(|cell| {
            let (row, column) = ((cell / columns) as f64, (cell % columns) as f64);
            let [x, y] = if smooth { [step[0] * column, step[1] * row] } else { input.point(scale) };
            (x, y)
        })
        .unzip();
    let mode = input.one_of(&[BorderMode::Constant, BorderMode::Replicate, BorderMode::Reflect101, BorderMode::Wrap]);
    let wraps = input.flag();
    let lut = Lut::from_maps_with(&x, &y, columns, (width as u32, height as u32), mode, wraps).expect("good maps");
    let options =
        WarpOptions { interpolation, border_value: vec![0.0; channels], threads: Some(2), ..WarpOptions::default() };
    let (pixels, cells) = (whole(width * height * channels, input), whole(rows * columns * channels, input));
    let image = ImageView::new(&pixels, (width, height), channels).expect("an image");
    let warped = lut.warp(&image, &options).expect("the image fits the table");
    let grad = ImageView::new(&cells, (columns, rows), channels).expect("a gradient");
    let mut back = vec![f64::NAN; pixels.len()];
    let mut out = ImageViewMut::new(&mut back, (width, height), channels).expect("an image");
    let adjoint = lut.warp_adjoint_into(&grad, &mut out, &options);
    if mode != BorderMode::Constant || wraps {
        assert!(adjoint.is_err(), "what the image repeats of has no transpose here");
        return;
    }
    adjoint.expect("the gradient fits the table");
    // area averages 64-bit floats in float32
    close(product(&warped, &cells), product(&pixels, &back), &format!("{interpolation:?} {mode:?} wraps {wraps}"));
}

fn ring(input: &mut Input<'_>, interpolation: Interpolation) {
    let names = ["a", "b", "c"];
    let count = input.count(1, 3);
    let cameras: Vec<_> = (0..count).filter_map(|k| Some((names[k], input.camera(None)?))).collect();
    let grid = BevGrid::new((-3.0, 6.0), (-3.0, 3.0), (0.5, 0.5), SampleAt::Center).expect("whole cells");
    let blend = input.one_of(&[BlendMode::Best, BlendMode::Feather, BlendMode::Priority]);
    let polygon = vec![input.point(5.0), input.point(5.0), input.point(5.0)];
    let exclude = if input.flag() { vec![polygon] } else { vec![] };
    let options = RigOptions { blend, exclude, feather: input.number(1.0).abs(), ..RigOptions::default() };
    let Ok(lut) = RigLut::new(&cameras, &grid, &Ground::default(), &options) else { return };
    let owners = lut.source().expect("memory");
    assert!(owners.iter().all(|&owner| (-1..cameras.len() as i16).contains(&owner)));
    for cell in 0..owners.len() {
        let sum: f32 = (0..cameras.len()).map(|k| lut.weights(k).expect("a camera")[cell]).sum();
        assert!((sum - f32::from(u8::from(owners[cell] >= 0))).abs() < 1e-4, "weights of cell {cell} sum to {sum}");
    }
    let sizes: Vec<_> = (0..lut.cameras()).map(|k| lut.source_size(k)).collect();
    let pixels: Vec<Vec<f64>> = sizes.iter().map(|&(w, h)| whole((w * h) as usize, input)).collect();
    let images: Vec<_> = pixels
        .iter()
        .zip(&sizes)
        .map(|(data, &(w, h))| ImageView::new(data, (w as usize, h as usize), 1).expect("an image"))
        .collect();
    let options = WarpOptions { interpolation, border_value: vec![0.0], threads: Some(2), ..WarpOptions::default() };
    let mut picture = vec![f64::NAN; owners.len()];
    let mut out = ImageViewMut::new(&mut picture, (grid.columns(), grid.rows()), 1).expect("a picture");
    lut.warp_into(&images, &mut out, &options, &[]).expect("the images fit the table");
    let cells = whole(owners.len(), input);
    let grad = [ImageView::new(&cells, (grid.columns(), grid.rows()), 1).expect("a gradient")];
    let mut sum = 0.0;
    for (k, &(w, h)) in sizes.iter().enumerate() {
        let mut back = vec![f64::NAN; pixels[k].len()];
        let mut outs = [ImageViewMut::new(&mut back, (w as usize, h as usize), 1).expect("an image")];
        lut.warp_many_adjoint_into(k, &grad, &mut outs, &options).expect("the gradient fits the table");
        sum += product(&pixels[k], &back);
    }
    // seams mix in Q15
    let warped = product(&picture, &cells);
    assert!((warped - sum).abs() <= 2e-4 * (1.0 + warped.abs()), "{interpolation:?} of a ring: {warped} {sum}");
}
