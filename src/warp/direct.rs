//! Warps without a table, for maps that are used once: each row is packed into a few kilobytes and warped at once.

use nalgebra::Matrix3;

use super::{Bilinear, WarpOptions, kernels::RowKernels, kernels::Source, warp_segments};
use crate::camera::check_image_size;
use crate::error::{Error, Result};
use crate::grid::check_cells;
use crate::image::{ImageView, ImageViewMut, Sample};
use crate::lut::kernels::Kinds;
use crate::lut::table::{RowRuns, Tap};
use crate::lut::{check_homography, homography_row};
use crate::parallel;

/// What lies beyond the image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum BorderMode {
    /// The border value: `cv2.BORDER_CONSTANT`. The default.
    #[default]
    Constant,
    /// The nearest pixel of the edge, aaa|abcd|ddd: `cv2.BORDER_REPLICATE`.
    Replicate,
    /// The image mirrored about its outermost pixels, dcb|abcd|cba: `cv2.BORDER_REFLECT_101`.
    Reflect101,
}

impl BorderMode {
    /// Brings coordinates along an axis of `size` pixels into the image; NaN and infinity become NaN, which has no image
    /// in any mode.
    fn fold(self, coordinates: &mut [f64], size: usize) {
        if self == Self::Constant {
            return;
        }
        let last = size as f64 - 1.0;
        for coordinate in coordinates {
            if *coordinate >= 0.0 && *coordinate <= last {
                continue;
            }
            *coordinate = match self {
                _ if !coordinate.is_finite() => f64::NAN,
                Self::Constant | Self::Replicate => coordinate.clamp(0.0, last),
                Self::Reflect101 if last == 0.0 => 0.0,
                Self::Reflect101 => {
                    let within = coordinate.abs() % (2.0 * last);
                    within.min(2.0 * last - within)
                }
            };
        }
    }
}

/// Warps an image by maps, as `cv2.remap`: output cell i samples at (`map_x[i]`, `map_y[i]`). NaN and infinite entries
/// give the border value in every mode.
///
/// # Errors
/// [`Error::MapLength`] where a map has not one entry for each cell of `out`, [`Error::ImageSize`],
/// [`Error::OutputShape`] where the channels differ, [`Error::BorderChannels`], [`Error::Threads`] and [`Error::Isa`].
pub fn remap_into<T: Bilinear, M: Copy + Into<f64> + Sync>(
    image: &ImageView<'_, T>,
    (map_x, map_y): (&[M], &[M]),
    out: &mut ImageViewMut<'_, T>,
    border_mode: BorderMode,
    options: &WarpOptions<T>,
) -> Result<()> {
    remap(image, (map_x, map_y), out, border_mode, options, options.kernels(image)?)
}

/// [`remap_into`] with nearest, for samples of any kind; `options.interpolation` is not looked at.
///
/// # Errors
/// Those of [`remap_into`].
pub fn remap_nearest_into<T: Sample, M: Copy + Into<f64> + Sync>(
    image: &ImageView<'_, T>,
    (map_x, map_y): (&[M], &[M]),
    out: &mut ImageViewMut<'_, T>,
    border_mode: BorderMode,
    options: &WarpOptions<T>,
) -> Result<()> {
    remap(image, (map_x, map_y), out, border_mode, options, options.nearest_kernels(image)?)
}

/// Warps an image by a homography from output pixel to source pixel (`cv2.WARP_INVERSE_MAP`'s direction; invert the
/// matrix for the other). Both signs of its third component sample the image, because its sign is arbitrary.
///
/// # Errors
/// [`Error::Homography`], [`Error::ImageSize`], [`Error::OutputShape`] where the channels differ,
/// [`Error::BorderChannels`], [`Error::Threads`] and [`Error::Isa`].
pub fn warp_perspective_into<T: Bilinear>(
    image: &ImageView<'_, T>,
    m: &Matrix3<f64>,
    out: &mut ImageViewMut<'_, T>,
    border_mode: BorderMode,
    options: &WarpOptions<T>,
) -> Result<()> {
    warp_perspective(image, m, out, border_mode, options, options.kernels(image)?)
}

/// [`warp_perspective_into`] with nearest, for samples of any kind; `options.interpolation` is not looked at.
///
/// # Errors
/// Those of [`warp_perspective_into`].
pub fn warp_perspective_nearest_into<T: Sample>(
    image: &ImageView<'_, T>,
    m: &Matrix3<f64>,
    out: &mut ImageViewMut<'_, T>,
    border_mode: BorderMode,
    options: &WarpOptions<T>,
) -> Result<()> {
    warp_perspective(image, m, out, border_mode, options, options.nearest_kernels(image)?)
}

/// The inverse of a homography.
///
/// # Errors
/// [`Error::Homography`] where it has none.
pub fn inverse_homography(m: &Matrix3<f64>) -> Result<Matrix3<f64>> {
    check_homography(m)?;
    let inverse = m.try_inverse().unwrap_or_else(Matrix3::zeros);
    check_homography(&inverse)?; // one that overflows is no inverse
    Ok(inverse)
}

fn remap<T: Sample, M: Copy + Into<f64> + Sync>(
    image: &ImageView<'_, T>,
    (map_x, map_y): (&[M], &[M]),
    out: &mut ImageViewMut<'_, T>,
    border_mode: BorderMode,
    options: &WarpOptions<T>,
    kernels: RowKernels<T>,
) -> Result<()> {
    let (rows, columns, _) = out.shape();
    for map in [map_x, map_y] {
        if map.len() != rows * columns {
            return Err(Error::MapLength { expected: rows * columns, got: map.len() });
        }
    }
    run(image, out, border_mode, options, kernels, |row, us, vs| {
        let cells = row * columns..(row + 1) * columns;
        us.iter_mut().zip(&map_x[cells.clone()]).for_each(|(u, &map)| *u = map.into());
        vs.iter_mut().zip(&map_y[cells]).for_each(|(v, &map)| *v = map.into());
    })
}

fn warp_perspective<T: Sample>(
    image: &ImageView<'_, T>,
    m: &Matrix3<f64>,
    out: &mut ImageViewMut<'_, T>,
    border_mode: BorderMode,
    options: &WarpOptions<T>,
    kernels: RowKernels<T>,
) -> Result<()> {
    check_homography(m)?;
    let isa = options.isa()?;
    let columns: Vec<f64> = (0..out.shape().1).map(|column| column as f64).collect();
    run(image, out, border_mode, options, kernels, |row, us, vs| homography_row(m, row).fill(isa, &columns, us, vs))
}

/// What one thread needs for a row, used for all of its rows.
struct Scratch {
    us: Vec<f64>,
    vs: Vec<f64>,
    taps: Vec<Tap>,
    runs: RowRuns,
    kinds: Kinds,
}

fn run<T: Sample>(
    image: &ImageView<'_, T>,
    out: &mut ImageViewMut<'_, T>,
    border_mode: BorderMode,
    options: &WarpOptions<T>,
    kernels: RowKernels<T>,
    fill: impl Fn(usize, &mut [f64], &mut [f64]) + Sync,
) -> Result<()> {
    let (rows, columns, channels) = out.shape();
    let source_size = check_image_size("image", image.width() as u64, image.height() as u64)?;
    check_cells("out", rows as f64, columns as f64)?;
    if channels != image.channels() {
        return Err(Error::OutputShape { expected: (rows, columns, image.channels()), got: out.shape() });
    }
    let border = options.border(image.channels())?;
    let (threads, isa) = (options.threads_for(rows * columns)?, options.isa()?);
    let source = Source::new(image, &border);
    let bands = out.bands(parallel::rows_per_band(rows, columns, threads));
    parallel::for_each(threads, bands, |(first, band)| {
        let mut scratch = Scratch {
            us: vec![0.0; columns],
            vs: vec![0.0; columns],
            taps: vec![Tap::default(); columns],
            runs: RowRuns::default(),
            kinds: Kinds::default(),
        };
        let Scratch { us, vs, taps, runs, kinds } = &mut scratch;
        for (row, cells) in (first..).zip(band) {
            fill(row, us, vs);
            border_mode.fold(us, image.width());
            border_mode.fold(vs, image.height());
            runs.clear();
            runs.push(isa, (us, vs), source_size, taps, kinds);
            warp_segments(runs.segments(0, taps), &source, cells, &kernels);
        }
    });
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folded(mode: BorderMode, coordinate: f64, size: usize) -> f64 {
        let mut one = [coordinate];
        mode.fold(&mut one, size);
        one[0]
    }

    #[test]
    fn borders_fold_as_opencv_names_them() {
        for (coordinate, replicate, reflect) in
            [(-0.25, 0.0, 0.25), (-3.5, 0.0, 3.5), (4.5, 4.0, 3.5), (8.0, 4.0, 0.0), (11.0, 4.0, 3.0), (2.5, 2.5, 2.5)]
        {
            assert_eq!(folded(BorderMode::Replicate, coordinate, 5), replicate, "{coordinate}");
            assert_eq!(folded(BorderMode::Reflect101, coordinate, 5), reflect, "{coordinate}");
            assert_eq!(folded(BorderMode::Constant, coordinate, 5), coordinate);
        }
        assert_eq!(folded(BorderMode::Reflect101, 3.7, 1), 0.0);
        for mode in [BorderMode::Replicate, BorderMode::Reflect101] {
            for none in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                assert!(folded(mode, none, 5).is_nan());
            }
        }
    }
}
