//! Homographies of any nine numbers: refused, or the same with a table and without one.

use ipm_rs::{
    BevGrid, BorderMode, ImageView, ImageViewMut, Interpolation, Lut, Mapping, SampleAt, WarpOptions,
    inverse_homography, warp_direct_into,
};
use nalgebra::Matrix3;

use crate::input::Input;
use crate::isas::{Random, noise};
use crate::uses;

pub fn run(data: &[u8]) {
    let mut input = Input::new(data);
    let (width, height) = (input.count(1, 40), input.count(1, 30));
    let (columns, rows) = (input.count(1, 50), input.count(1, 8));
    let m = match input.byte() {
        // near to what is used
        0..100 => Matrix3::new(
            1.0 + input.number(2.0),
            input.number(2.0),
            input.number(50.0),
            input.number(2.0),
            1.0 + input.number(2.0),
            input.number(50.0),
            input.number(0.1),
            input.number(0.1),
            1.0 + input.number(1.0),
        ),
        _ => Matrix3::from_iterator(input.numbers(9, 1e3)),
    };
    let mode = input.border_mode();
    if let Ok(inverse) = inverse_homography(&m) {
        assert!(inverse.iter().all(|number| number.is_finite()), "{inverse}");
    }
    let source = (width as u32, height as u32);
    let grid = BevGrid::new((1.0, 1.0 + rows as f64), (0.0, columns as f64), (1.0, 1.0), SampleAt::Center);
    // from metres to pixels; refused or not, it ends
    let _ = Lut::from_ground_homography(&m, &grid.expect("whole cells"), source, BorderMode::Constant);
    let lut = Lut::from_homography_with(&m, (columns as u32, rows as u32), source, mode);
    let mut random = Random::new(input.bits());
    let pixels: Vec<u8> = noise(width * height * 3, &mut random);
    let view = ImageView::new(&pixels, (width, height), 3).expect("an image");
    let interpolation = input.one_of(&[Interpolation::Nearest, Interpolation::Bilinear]);
    let options =
        WarpOptions { interpolation, border_value: vec![1, 2, 3], border_mode: Some(mode), ..WarpOptions::default() };
    let mut direct = vec![9; rows * columns * 3];
    let mut out = ImageViewMut::new(&mut direct, (columns, rows), 3).expect("an output");
    let warped = warp_direct_into(&view, &Mapping::Homography(m), &mut out, &options);
    match lut {
        Ok(lut) => {
            warped.expect("a table could be made of it");
            let got = lut.warp(&view, &options).expect("the image fits the table");
            let differs = (0..rows * columns).find(|cell| got[3 * cell..][..3] != direct[3 * cell..][..3]);
            if let Some(cell) = differs {
                let at = m * nalgebra::Vector3::new((cell % columns) as f64, (cell / columns) as f64, 1.0);
                panic!("{interpolation:?}, {mode:?}: with a table and without one, cell {cell} at {at} of {m}");
            }
            uses::everything(&lut, &mut input);
        }
        Err(_) => assert!(warped.is_err() || mode == BorderMode::Transparent, "no table could be made of {m}"),
    }
}
