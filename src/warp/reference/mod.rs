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
    if !(u > -1.0 && u < width && v > -1.0 && v < height) {
        return outside;
    }
    let valid = u >= 0.0 && u <= width - 1.0 && v >= 0.0 && v <= height - 1.0;
    let pixel = |x: f64, y: f64, channel: usize| -> f64 {
        if x >= 0.0 && x < width && y >= 0.0 && y < height {
            image.pixel(x as usize, y as usize)[channel].into()
        } else {
            border[channel]
        }
    };
    let value = |channel: usize| match interpolation {
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
    };
    Cell { values: (0..image.channels()).map(value).collect(), valid }
}
