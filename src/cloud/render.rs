//! Points to an image of the nearest of them: a z-buffer.

use std::sync::atomic::{AtomicU64, Ordering};

use super::project::project_chunk;
use super::{DepthKind, Projections};
use crate::camera::Camera;
use crate::error::{CloudError, Error, Result, ViewError};
use crate::isa::Isa;
use crate::parallel::{self, Work};
use crate::view::buffer;
use crate::view::{ImageView, ImageViewMut, PointSample, Sample, Strided};

/// In an index image, a pixel that no point falls on.
pub const NO_POINT: i64 = -1;

/// A pixel that no point falls on: NaN, whose bits are above those of every distance, and no number.
const EMPTY: u64 = 0x7fc0_0000_ffff_ffff;

/// Points of one job.
const CHUNK: usize = 1 << 10;

/// Points that are projected and drawn together. What is made of them is 6 KB on the stack, of which some threads have
/// no more than 32.
const TOGETHER: usize = 1 << 7;

/// How points are drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RenderOptions {
    /// What nearest means, and what the depth image measures.
    pub kind: DepthKind,
    /// A point covers the pixels whose centres lie within so many pixels of its own: 0 is that one, 1 a plus of five,
    /// 1.5 three by three.
    pub radius: f64,
    /// What is nearer is left out, metres.
    pub min_depth: f64,
    /// What is farther is left out.
    pub max_depth: f64,
    /// At most how many threads; `None` is [`num_threads`](crate::num_threads).
    pub threads: Option<usize>,
}

impl Default for RenderOptions {
    fn default() -> Self {
        Self { kind: DepthKind::default(), radius: 0.0, min_depth: 0.0, max_depth: f64::INFINITY, threads: None }
    }
}

/// Draws points of the vehicle frame as the camera sees them: each pixel takes the nearest of those that fall on it. Of
/// points whose depths are equal in float32 the first in `points` wins. Nothing depends on the number of threads.
///
/// `depth` gets the nearest depth, NaN where there is none, and `index` the number of that point or [`NO_POINT`]; each is
/// an image of one channel of the camera's size. A point falls on the pixel that its own rounds to, halves to even.
///
/// # Errors
/// [`CloudError::PointColumns`], [`CloudError::DepthLimit`], [`ViewError::OutputShape`], [`CloudError::TooManyPoints`],
/// [`ThreadsError::Zero`](crate::error::ThreadsError::Zero), [`IsaError`](crate::error::IsaError) and
/// [`Error::OutOfMemory`], before anything is written.
pub fn render_points_into<T: PointSample>(
    camera: &Camera,
    points: &Strided<'_, T>,
    options: &RenderOptions,
    depth: &mut ImageViewMut<'_, f32>,
    index: &mut ImageViewMut<'_, i64>,
) -> Result<()> {
    let (width, height) = (camera.image_size().0 as usize, camera.image_size().1 as usize);
    for got in [depth.shape(), index.shape()] {
        if got != (height, width, 1) {
            return Err(Error::View(ViewError::OutputShape { expected: (height, width, 1), got }));
        }
    }
    if points.columns() < 3 {
        return Err(Error::Cloud(CloudError::PointColumns { expected: 3, got: points.columns() }));
    }
    super::check_points("camera", (width, height))?;
    let splat = Splat::new(options, width.max(height))?;
    if points.rows() > u32::MAX as usize {
        let (got, limit) = (points.rows(), u32::MAX as usize);
        return Err(Error::Cloud(CloudError::TooManyPoints { what: "points", got, limit }));
    }
    let isa = Isa::active()?;
    let threads = Work::bytes(points.rows().saturating_mul(64) + width * height).threads(options.threads)?;
    let mut nearest: Vec<AtomicU64> = buffer::reserved("depth", width * height)?;
    nearest.resize_with(width * height, || AtomicU64::new(EMPTY));
    let canvas = Canvas { nearest: &nearest, width, height, alone: threads == 1 };
    let chunks = (0..points.rows()).step_by(CHUNK);
    parallel::for_each(threads, chunks, |first| {
        let end = points.rows().min(first + CHUNK);
        for first in (first..end).step_by(TOGETHER) {
            let count = TOGETHER.min(end - first);
            let (mut uv, mut distance, mut valid) = ([[0.0; 2]; TOGETHER], [0.0; TOGETHER], [false; TOGETHER]);
            let out = Projections { uv: &mut uv[..count], depth: &mut distance[..count], valid: &mut valid[..count] };
            project_chunk(isa, camera, points, first, out);
            if options.kind == DepthKind::Ray {
                for (i, distance) in distance[..count].iter_mut().enumerate() {
                    let row: [T; 3] = points.first(first + i);
                    let [x, y, z] = [0, 1, 2].map(|axis| row[axis].to_f64() - camera.position()[axis]);
                    *distance = (x * x + y * y + z * z).sqrt();
                }
            }
            canvas.draw(&uv[..count], &distance[..count], first, &splat);
        }
        Ok(())
    })?;
    let band = parallel::rows_per_band(height, width, threads);
    let bands = depth.bands(band).zip(index.bands(band));
    parallel::for_each(threads, bands, |((first, depths), (_, indices))| {
        for (y, (depths, indices)) in (first..).zip(depths.zip(indices)) {
            let keys = &nearest[y * width..(y + 1) * width];
            for ((key, depth), index) in keys.iter().zip(depths).zip(indices) {
                let key = key.load(Ordering::Relaxed);
                *depth = f32::from_bits((key >> 32) as u32);
                let number = i64::from(key as u32);
                *index = if key == EMPTY { NO_POINT } else { number };
            }
        }
        Ok(())
    })
}

/// Which pixels around its own a point covers.
struct Splat {
    /// For rows 0, 1, ... above and below: how many columns to either side.
    reach: Vec<i64>,
    limits: (f64, f64),
}

impl Splat {
    fn new(options: &RenderOptions, largest: usize) -> Result<Self> {
        let refuse = |what, expected, got| Err(Error::Cloud(CloudError::DepthLimit { what, expected, got }));
        let &RenderOptions { radius, min_depth, max_depth, .. } = options;
        if !(radius >= 0.0 && radius <= largest as f64) {
            return refuse("radius", "pixels from 0, at most those of the image's longer side", radius);
        }
        if !(min_depth >= 0.0 && min_depth.is_finite()) {
            return refuse("min_depth", "metres from 0", min_depth);
        }
        if max_depth.is_nan() || max_depth <= min_depth {
            return refuse("max_depth", "metres above min_depth", max_depth);
        }
        let half = |row: i64| (radius * radius - (row * row) as f64).max(0.0).sqrt().floor() as i64;
        let rows = radius.floor() as usize + 1;
        let reach = buffer::collected("radius", (0..rows).map(|row| half(row as i64)))?;
        Ok(Self { reach, limits: (min_depth, max_depth) })
    }
}

/// For each pixel the nearest point so far: its depth's bits, which for positive floats sort as the numbers do, above
/// its number.
struct Canvas<'a> {
    nearest: &'a [AtomicU64],
    width: usize,
    height: usize,
    /// Whether nobody else draws.
    alone: bool,
}

/// Rounds a number below 2^51 to the nearest whole one, halves to even; in the baseline build `round_ties_even` is a call.
#[inline]
fn nearest_whole(number: f64) -> i64 {
    const WHOLE: f64 = 1.5 * (1u64 << 52) as f64;
    ((number + WHOLE) - WHOLE) as i64
}

impl Canvas<'_> {
    /// Draws neighbouring points, `first` being the number of the first of them; what has no image has NaN for a pixel.
    fn draw(&self, uv: &[[f64; 2]], distances: &[f64], first: usize, splat: &Splat) {
        // those that are drawn, brought together without a branch for each: which ones they are is hard to guess
        let mut drawn = [(0.0, 0.0, 0); TOGETHER];
        let mut count = 0;
        let (least, most) = splat.limits;
        let reach = splat.reach.len() as f64 - 0.5;
        let (right, bottom) = (self.width as f64 - 1.0 + reach, self.height as f64 - 1.0 + reach);
        for (i, (&[u, v], &distance)) in uv.iter().zip(distances).enumerate() {
            let near = distance as f32;
            let close = (u >= -reach) & (v >= -reach) & (u <= right) & (v <= bottom);
            let far = (near > 0.0) & (near < f32::INFINITY) & (distance >= least) & (distance <= most);
            drawn[count] = (u, v, u64::from(near.to_bits()) << 32 | (first + i) as u64);
            count += usize::from(close & far);
        }
        let (width, height) = (self.width as i64, self.height as i64);
        let rows = splat.reach.len() as i64 - 1;
        for &(u, v, key) in &drawn[..count] {
            let (u, v) = (nearest_whole(u), nearest_whole(v));
            if rows == 0 {
                // a half rounds to even, also to one pixel outside
                if (0..width).contains(&u) && (0..height).contains(&v) {
                    self.put((v * width + u) as usize, key);
                }
                continue;
            }
            for y in (v - rows).max(0)..=(v + rows).min(height - 1) {
                let reach = splat.reach[(y - v).unsigned_abs() as usize];
                for x in (u - reach).max(0)..=(u + reach).min(width - 1) {
                    self.put((y * width + x) as usize, key);
                }
            }
        }
    }

    #[inline]
    fn put(&self, pixel: usize, key: u64) {
        let nearest = &self.nearest[pixel];
        let before = nearest.load(Ordering::Relaxed);
        if self.alone {
            nearest.store(key.min(before), Ordering::Relaxed);
        } else if key < before {
            nearest.fetch_min(key, Ordering::Relaxed);
        }
    }
}

/// Colours the image of an index: pixel by pixel the row of `values` (an image one pixel wide) that it names, and the
/// border value, one number for each channel, where it names none.
///
/// # Errors
/// [`ViewError::OutputShape`], [`ViewError::BorderChannels`] and
/// [`ThreadsError::Zero`](crate::error::ThreadsError::Zero), before anything is written.
pub fn paint_into<T: Sample>(
    index: &ImageView<'_, i64>,
    values: Option<&ImageView<'_, T>>,
    border_value: &[T],
    out: &mut ImageViewMut<'_, T>,
    threads: Option<usize>,
) -> Result<()> {
    let channels = values.map_or(border_value.len(), ImageView::channels);
    if border_value.len() != channels {
        return Err(Error::View(ViewError::BorderChannels { expected: channels, got: border_value.len() }));
    }
    let expected = (index.height(), index.width(), channels);
    if out.shape() != expected {
        return Err(Error::View(ViewError::OutputShape { expected, got: out.shape() }));
    }
    let threads = Work::bytes(index.width() * index.height() * (8 + channels * size_of::<T>())).threads(threads)?;
    let band = parallel::rows_per_band(index.height(), index.width(), threads);
    let count = values.map_or(0, ImageView::height);
    parallel::for_each(threads, out.bands(band), |(first, rows)| {
        for (y, row) in (first..).zip(rows) {
            for (x, pixel) in row.chunks_exact_mut(channels).enumerate() {
                let number = usize::try_from(index.pixel(x, y)[0]).ok().filter(|&number| number < count);
                match (values, number) {
                    (Some(values), Some(number)) => pixel.copy_from_slice(values.pixel(0, number)),
                    _ => pixel.copy_from_slice(border_value),
                }
            }
        }
        Ok(())
    })
}
