//! Two published functions, value for value.
//!
//! Both take CARLA's normalised depth and give metres, and both reverse rows and columns by `w - 1 - u - cx` with
//! `cx = w / 2`, which is half a pixel off: their clouds are shifted right and down by `0.5 z / f`. They are here for
//! what was built on them; [`points_from_depth_into`](super::points_from_depth_into) has no such shift.

use nalgebra::Matrix3;

use crate::error::{CloudError, Error, Result};
use crate::parallel::check_interrupt;
use crate::view::buffer;
use crate::view::{ImageView, PointSample};

/// Metres of depth 1.
const FAR: f64 = 1000.0;

/// What `depth_to_lidar` gives.
#[derive(Debug, Clone, PartialEq)]
pub struct LidarPoints<T> {
    /// Three rows of one number for each pixel: forward, left, up.
    pub points: Vec<f64>,
    /// Depth of each pixel in metres, 0 where it was beyond the limit.
    pub metres: Vec<T>,
}

/// A point for each pixel of a normalised depth image, (0, 0, 0) where the depth exceeds `max_depth`; a depth of exactly
/// `max_depth`, and NaN, stay. The input is left alone, which the original changes.
///
/// # Errors
/// [`CloudError::Singular`], [`CloudError::DepthChannels`], [`CloudError::TooManyPoints`] and [`Error::OutOfMemory`].
pub fn depth_to_lidar<T: PointSample>(
    normalized: &ImageView<'_, T>,
    k: &Matrix3<f64>,
    max_depth: f64,
) -> Result<LidarPoints<T>> {
    let inverse = checked(normalized, k)?;
    let (width, height) = (normalized.width(), normalized.height());
    let mut points = buffer::filled("points", 3 * width * height, 0.0)?;
    let mut metres = buffer::reserved("points", width * height)?;
    let (forward, rest) = points.split_at_mut(width * height);
    let (left, up) = rest.split_at_mut(width * height);
    for y in 0..height {
        check_interrupt()?;
        for x in 0..width {
            let number = normalized.pixel(x, y)[0];
            let far = number.to_f64() > max_depth;
            let (u, v, number) = if far { (0, 0, T::default()) } else { (width - 1 - x, height - 1 - y, number) };
            let depth = in_metres(number);
            let [px, py, pz] = ray(&inverse, u, v).map(|along| along * depth.to_f64());
            let i = y * width + x;
            (forward[i], left[i], up[i]) = (pz, px, py);
            metres.push(depth);
        }
    }
    Ok(LidarPoints { points, metres })
}

/// `depth_to_local_point_cloud` of CARLA 0.8.4: left, up, forward of each pixel whose depth does not exceed `max_depth`,
/// and its `y * width + x`.
///
/// # Errors
/// [`CloudError::Singular`], [`CloudError::DepthChannels`], [`CloudError::TooManyPoints`] and [`Error::OutOfMemory`].
pub fn carla_084_points<T: PointSample>(
    normalized: &ImageView<'_, T>,
    k: &Matrix3<f64>,
    max_depth: f64,
) -> Result<(Vec<[f64; 3]>, Vec<i64>)> {
    let inverse = checked(normalized, k)?;
    let (width, height) = (normalized.width(), normalized.height());
    let mut points = buffer::reserved("points", width * height)?;
    let mut index = buffer::reserved("points", width * height)?;
    for y in 0..height {
        check_interrupt()?;
        for x in 0..width {
            let number = normalized.pixel(x, y)[0];
            if number.to_f64() > max_depth {
                continue; // NaN exceeds nothing
            }
            let depth = in_metres(number).to_f64();
            points.push(ray(&inverse, width - 1 - x, height - 1 - y).map(|along| along * depth));
            index.push((y * width + x) as i64);
        }
    }
    Ok((points, index))
}

fn checked<T: PointSample>(normalized: &ImageView<'_, T>, k: &Matrix3<f64>) -> Result<Matrix3<f64>> {
    if normalized.channels() != 1 {
        return Err(Error::Cloud(CloudError::DepthChannels { expected: 1, got: normalized.channels() }));
    }
    super::check_points("depth", (normalized.width(), normalized.height()))?;
    let inverse = k.try_inverse().filter(|inverse| inverse.iter().all(|entry| entry.is_finite()));
    inverse.ok_or_else(|| Error::Cloud(CloudError::Singular { got: super::rows(k) }))
}

/// Rounded to the depth's own precision, as NumPy does.
fn in_metres<T: PointSample>(normalized: T) -> T {
    T::from_f64(normalized.to_f64() * FAR)
}

fn ray(inverse: &Matrix3<f64>, u: usize, v: usize) -> [f64; 3] {
    let (u, v) = (u as f64, v as f64);
    std::array::from_fn(|row| inverse[(row, 0)] * u + inverse[(row, 1)] * v + inverse[(row, 2)])
}
