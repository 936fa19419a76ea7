//! The seed job of tests and benches: the Cityscapes camera and grid, and images with texture.

#![allow(dead_code, reason = "each test and bench uses its part")]

use ipm_rs::{BevGrid, Camera, ImageView, Pinhole, SampleAt};

/// The camera of the Cityscapes tutorial, 2048 x 1024.
pub(crate) fn seed_camera() -> Camera {
    let lens = Pinhole::new(2263.54773399985, 2250.3728170599807, 1079.0175620000632, 515.006600600019, 0.0)
        .expect("the numbers are good");
    let position = [1.7, 0.026239999999999368, 1.212400000000026];
    Camera::from_euler(lens, (2048, 1024), position, 0.0, 0.03842560000000292, -0.009726800000000934)
        .expect("the numbers are good")
}

/// Its grid, x 7..50 and y -10..10, with cells of any size that fits.
pub(crate) fn seed_grid(resolution: (f64, f64)) -> BevGrid {
    BevGrid::new((7.0, 50.0), (-10.0, 10.0), resolution, SampleAt::Corner).expect("the numbers are good")
}

/// Noise, the same every time.
pub(crate) fn textured(samples: usize) -> Vec<u8> {
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    let mut next = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 32) as u8
    };
    (0..samples).map(|_| next()).collect()
}

/// A contiguous image.
pub(crate) fn image(data: &[u8], width: usize, height: usize, channels: usize) -> ImageView<'_, u8> {
    ImageView::new(data, (width, height), channels).expect("the numbers are good")
}
