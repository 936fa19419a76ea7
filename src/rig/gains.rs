//! How bright each camera's picture is beside its neighbours', from what two of them see alike.

use nalgebra::{DMatrix, DVector};

use super::region::{Region, Sweep};
use super::{Mix, RigLut, WHAT};
use crate::error::{Error, Result, RigError};
use crate::lut::{Lut, Resolution};
use crate::parallel::check_interrupt;
use crate::table::{SpanKind, Tap};
use crate::view::{ImageView, buffer};

/// Cells that two cameras are compared in: their median is good to 0.2 % where each is off by a tenth.
const MOST_CELLS: usize = 4096;

/// Fewer cells than this say nothing.
const FEWEST_CELLS: usize = 32;

/// How far a gain is from 1 (or from the previous one) as a rule, as a logarithm. It pulls with 1 / 0.2^2, a pair whose
/// ratios spread by s with 1 / s^2: of a factor of 1.2 between two cameras 0.5 % is lost where they see a flat road alike
/// (s = 0.05), and half of the way is gone where what they see stands on the road, at another place in either view (0.3).
const USUAL: f64 = 0.2;

/// Ratios spread at least so far, however alike the pictures.
const LEAST_SPREAD: f64 = 0.02;

/// How much of the way from the previous gains to those of these images is gone: half of a change in seven frames.
const STEP: f64 = 0.1;

/// Where two cameras sample the same cells.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Overlap {
    /// Places of the tables.
    tables: [usize; 2],
    taps: Vec<[Tap; 2]>,
}

/// The overlaps of all pairs of tables: of what both see the half that they resolve best, since far away less and less of it
/// is road.
pub(super) fn overlaps(luts: &[Lut], seen: &[Region]) -> Result<Vec<Overlap>> {
    let mut overlaps = Vec::new();
    for b in 0..luts.len() {
        for a in 0..b {
            let both = [&luts[a], &luts[b]];
            let shared = shared([&seen[a], &seen[b]], both)?;
            if shared.len() < 2 * FEWEST_CELLS {
                continue;
            }
            let mut resolutions = buffer::collected(WHAT, shared.iter().map(|&(_, resolution)| resolution))?;
            let middle = resolutions.len() / 2;
            let least = *resolutions.select_nth_unstable_by(middle, f32::total_cmp).1;
            let step = (resolutions.len() - middle).div_ceil(MOST_CELLS);
            let best = shared.iter().filter(|&&(_, resolution)| resolution >= least);
            let chosen: Vec<usize> = best.map(|&(cell, _)| cell).step_by(step).collect();
            let [of_a, of_b] = both.map(|lut| inside(lut, &chosen));
            let pairs = of_a.into_iter().zip(of_b).filter_map(|(a, b)| Some([a?, b?]));
            overlaps.push(Overlap { tables: [a, b], taps: pairs.collect() });
        }
    }
    Ok(overlaps)
}

/// The cells that two views see, and how well the worse one resolves them.
fn shared(seen: [&Region; 2], luts: [&Lut; 2]) -> Result<Vec<(usize, f32)>> {
    let columns = luts[0].columns();
    let (mut shared, mut sweep) = (Vec::new(), Sweep::default());
    let [mut one, mut other] = [Resolution::of(luts[0])?, Resolution::of(luts[1])?];
    let [mut of_one, mut of_other]: [Vec<f32>; 2] = [buffer::zeroed(WHAT, columns)?, buffer::zeroed(WHAT, columns)?];
    for row in 0..seen[0].rows() {
        check_interrupt()?;
        sweep.row(columns, seen.iter().map(|seen| seen.row(row)), |cells, seeing| {
            if seeing == 0b11 {
                let count = cells.len();
                one.read(row, cells.clone(), &mut of_one[..count])?;
                other.read(row, cells.clone(), &mut of_other[..count])?;
                buffer::room_for(WHAT, &mut shared, count)?;
                let worse = of_one.iter().zip(&of_other).map(|(one, other)| one.min(*other));
                shared.extend(cells.map(|column| row * columns + column).zip(worse));
            }
            Ok(())
        })?;
    }
    Ok(shared)
}

/// The taps of cells, in rising order, whose four pixels all exist.
fn inside(lut: &Lut, cells: &[usize]) -> Vec<Option<Tap>> {
    let mut taps = Vec::with_capacity(cells.len());
    let (columns, mut next) = (lut.columns(), cells.iter().peekable());
    for row in 0..lut.rows() {
        for span in lut.table().row(row) {
            let first = row * columns + span.first;
            while let Some(cell) = next.next_if(|&&cell| cell < first + span.cells) {
                taps.push((span.kind == SpanKind::Inside).then(|| span.taps[cell - first]));
            }
        }
    }
    taps
}

impl RigLut {
    /// A factor for each channel of each camera, in the rig's order, that makes neighbours equally bright where both
    /// see the road: the least-squares solution for the medians of the ratios of all pairs, of mean 1 (geometric). A pair counts
    /// by how little its ratios spread.
    /// Samples at either end of an integer type's range, and those that are not above 0, do not count.
    ///
    /// From frame to frame, give those of the frame before as `previous`: the result goes a tenth of the way from them to
    /// those of these images.
    ///
    /// # Errors
    /// Those of [`RigLut::warp_into`] for images and `previous`.
    pub fn gains<T: Mix>(&self, images: &[ImageView<'_, T>], previous: &[f32]) -> Result<Vec<f32>> {
        self.check_images(images)?;
        let (channels, cameras) = (images[0].channels(), self.cameras());
        self.check_gains(previous, channels)?;
        if let Some(&got) = previous.iter().find(|&&gain| gain <= 0.0) {
            return Err(Error::Rig(RigError::PreviousGain { got }));
        }
        let mut gains = buffer::filled(WHAT, cameras * channels, 1.0)?;
        for channel in 0..channels {
            let before =
                |camera: usize| previous.get(camera * channels + channel).map_or(0.0, |&gain| f64::from(gain).ln());
            // normal equations of log gains: for each pair, gain a + ratio = gain b
            let mut normal = DMatrix::from_diagonal_element(cameras, cameras, USUAL.powi(-2));
            let mut right = DVector::from_fn(cameras, |camera, _| before(camera) * USUAL.powi(-2));
            for overlap in self.overlaps()? {
                let [a, b] = overlap.tables.map(|table| self.cameras[table]);
                let Some((ratio, spread)) = overlap.log_ratio([&images[a], &images[b]], channel) else { continue };
                let weight = spread.max(LEAST_SPREAD).powi(-2);
                for (one, other, ratio) in [(a, b, -ratio), (b, a, ratio)] {
                    normal[(one, one)] += weight;
                    normal[(one, other)] -= weight;
                    right[one] += weight * ratio;
                }
            }
            let solved = normal.cholesky().map_or_else(|| DVector::zeros(cameras), |normal| normal.solve(&right));
            let mean = solved.mean();
            for camera in 0..cameras {
                let now = solved[camera] - mean;
                let log = if previous.is_empty() { now } else { before(camera) + STEP * (now - before(camera)) };
                gains[camera * channels + channel] = log.exp() as f32;
            }
        }
        Ok(gains)
    }
}

impl Overlap {
    /// The median of log(a / b) over the cells where both can be compared, and the median of how far they are from it.
    fn log_ratio<T: Mix>(&self, images: [&ImageView<'_, T>; 2], channel: usize) -> Option<(f64, f64)> {
        let mut ratios: Vec<f64> = (self.taps.iter())
            .filter_map(|taps| {
                let [a, b] = [0, 1].map(|side| brightness(images[side], taps[side], channel));
                Some((a? / b?).ln())
            })
            .collect();
        if ratios.len() < FEWEST_CELLS {
            return None;
        }
        let middle = ratios.len() / 2;
        let median = *ratios.select_nth_unstable_by(middle, f64::total_cmp).1;
        ratios.iter_mut().for_each(|ratio| *ratio = (*ratio - median).abs());
        Some((median, *ratios.select_nth_unstable_by(middle, f64::total_cmp).1))
    }
}

/// The mean of a tap's four pixels; none where one of them is saturated, or not above 0.
fn brightness<T: Mix>(image: &ImageView<'_, T>, tap: Tap, channel: usize) -> Option<f64> {
    let (x, y) = (tap.offset as usize % image.width(), tap.offset as usize / image.width());
    let mut sum = 0.0;
    for (x, y) in [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)] {
        sum += image.pixel(x, y)[channel].measured()?;
    }
    Some(sum / 4.0)
}
