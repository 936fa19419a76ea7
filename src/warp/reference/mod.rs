//! The oracle of the tests: the warp written for obviousness, in float64, cell by cell, without table or kernels.

mod footprint;

pub use footprint::{Footprint, area, covered_area, ids, parallelogram};

use crate::view::ImageView;
use crate::warp::Interpolation;

/// One output cell: its value in each channel, exact but for float64, and whether it is valid.
#[derive(Debug, Clone, PartialEq)]
pub struct Cell {
    /// A value for each channel; for bilinear not rounded to the image's dtype.
    pub values: Vec<f64>,
    /// Inside the rectangle of pixel centres.
    pub valid: bool,
}

/// The value of an image at (u, v). `border` has one value for each channel; `None` is a cell without an image.
pub fn sample<T: Copy + Into<f64>>(
    image: &ImageView<'_, T>,
    coordinate: Option<[f64; 2]>,
    interpolation: Interpolation,
    border: &[f64],
) -> Cell {
    let outside = Cell { values: border.to_vec(), valid: false };
    let Some([u, v]) = coordinate else { return outside };
    let (width, height) = (image.width() as f64, image.height() as f64);
    let valid = u >= 0.0 && u <= width - 1.0 && v >= 0.0 && v <= height - 1.0;
    let reach = match interpolation {
        Interpolation::Nearest | Interpolation::Bilinear | Interpolation::Area => 1.0,
        Interpolation::Cubic => 2.0,
        Interpolation::Lanczos4 => 4.0,
    };
    if !(u > -reach && u < width - 1.0 + reach && v > -reach && v < height - 1.0 + reach) {
        return outside;
    }
    let pixel = |x: f64, y: f64, channel: usize| -> f64 {
        if x >= 0.0 && x < width && y >= 0.0 && y < height {
            image.pixel(x as usize, y as usize)[channel].into()
        } else {
            border[channel]
        }
    };
    let value = |channel: usize| {
        // the sum over so many pixels on each side, by weights that are brought to a sum of 1
        let convolved = |kernel: fn(f64) -> f64, side: i32| {
            let weights = |at: f64| -> Vec<(f64, f64)> {
                let pixels = (1 - side..=side).map(|k| at.floor() + f64::from(k));
                let weights: Vec<_> = pixels.map(|pixel| (pixel, kernel(at - pixel))).collect();
                let sum: f64 = weights.iter().map(|(_, weight)| weight).sum();
                weights.into_iter().filter(|(_, weight)| *weight != 0.0).map(|(pixel, w)| (pixel, w / sum)).collect()
            };
            let (across, down) = (weights(u), weights(v));
            let row = |(y, b): &(f64, f64)| -> f64 { across.iter().map(|(x, a)| a * b * pixel(*x, *y, channel)).sum() };
            down.iter().map(row).sum()
        };
        match interpolation {
            Interpolation::Nearest => pixel(u.round_ties_even(), v.round_ties_even(), channel),
            // area and mode of a footprint of a pixel
            Interpolation::Bilinear | Interpolation::Area => {
                let (x, y) = (u.floor(), v.floor());
                let (fx, fy) = (u - x, v - y);
                // a pixel without weight must not count, even where it is NaN
                let weighted = |weight: f64, x, y| if weight == 0.0 { 0.0 } else { weight * pixel(x, y, channel) };
                weighted((1.0 - fx) * (1.0 - fy), x, y)
                    + weighted(fx * (1.0 - fy), x + 1.0, y)
                    + weighted((1.0 - fx) * fy, x, y + 1.0)
                    + weighted(fx * fy, x + 1.0, y + 1.0)
            }
            Interpolation::Cubic => convolved(cubic, 2),
            Interpolation::Lanczos4 => convolved(lanczos4, 4),
        }
    };
    Cell { values: (0..image.channels()).map(value).collect(), valid }
}

/// Keys, Cubic convolution interpolation for digital image processing, 1981, with OpenCV's a.
fn cubic(distance: f64) -> f64 {
    const A: f64 = -0.75;
    let d = distance.abs();
    if d <= 1.0 {
        ((A + 2.0) * d - (A + 3.0)) * d * d + 1.0
    } else if d < 2.0 {
        ((A * d - 5.0 * A) * d + 8.0 * A) * d - 4.0 * A
    } else {
        0.0
    }
}

/// The sinc, windowed by a sinc of four times its width.
fn lanczos4(distance: f64) -> f64 {
    let sinc = |x: f64| if x == 0.0 { 1.0 } else { x.sin() / x };
    let whole = distance.fract() == 0.0;
    let angle = std::f64::consts::PI * distance;
    match distance {
        0.0 => 1.0,
        _ if whole || distance.abs() >= 4.0 => 0.0,
        _ => sinc(angle) * sinc(angle / 4.0),
    }
}
