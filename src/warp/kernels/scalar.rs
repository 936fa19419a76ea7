//! The kernels in plain Rust: the definition that every other instruction set is tested against with `==`.

use super::{Bilinear, Source, sealed::Blend};
use crate::image::Sample;
use crate::lut::table::{Tap, unframed};

/// Samples of a pixel: the constant where the kernel was compiled for one, else the source's (`CHANNELS == 0`).
#[inline(always)]
fn channels<T: Sample, const CHANNELS: usize>(source: &Source<'_, T>) -> usize {
    if CHANNELS == 0 { source.channels() } else { CHANNELS }
}

/// Index of the first sample of the pixel at `y * width + x`. A contiguous image needs no division.
#[inline(always)]
fn sample<T: Sample, const CHANNELS: usize, const CONTIGUOUS: bool>(source: &Source<'_, T>, offset: u32) -> usize {
    let offset = offset as usize;
    if CONTIGUOUS {
        return offset * channels::<T, CHANNELS>(source);
    }
    let (y, x) = (offset / source.image.width(), offset % source.image.width());
    source.image.row_start(y) + x * channels::<T, CHANNELS>(source)
}

/// Cells whose four pixels exist: the nearest of them.
pub(super) fn nearest<T: Sample, const CHANNELS: usize, const CONTIGUOUS: bool>(
    source: &Source<'_, T>,
    taps: &[Tap],
    cells: &mut [T],
) {
    let channels = channels::<T, CHANNELS>(source);
    let (data, width) = (source.image.data(), source.image.width() as u32);
    for (tap, cell) in taps.iter().zip(cells.chunks_exact_mut(channels)) {
        let offset = tap.offset + tap.step_x() + tap.step_y() * width;
        let from = sample::<T, CHANNELS, CONTIGUOUS>(source, offset);
        cell.copy_from_slice(&data[from..from + channels]);
    }
}

/// Cells on the rim and in the halo: the nearest pixel if it exists.
pub(super) fn nearest_edge<T: Sample, const CHANNELS: usize>(source: &Source<'_, T>, taps: &[Tap], cells: &mut [T]) {
    for (tap, cell) in taps.iter().zip(cells.chunks_exact_mut(channels::<T, CHANNELS>(source))) {
        let (x, y) = unframed(tap.offset, source.image.width() as u32);
        cell.copy_from_slice(source.pixel_or_border(x + i64::from(tap.step_x()), y + i64::from(tap.step_y())));
    }
}

/// Cells whose four pixels exist: their blend.
pub(super) fn bilinear<T: Bilinear, const CHANNELS: usize, const CONTIGUOUS: bool>(
    source: &Source<'_, T>,
    taps: &[Tap],
    cells: &mut [T],
) {
    let channels = channels::<T, CHANNELS>(source);
    let (data, width) = (source.image.data(), source.image.width() as u32);
    for (tap, cell) in taps.iter().zip(cells.chunks_exact_mut(channels)) {
        let weights = T::weights(tap.fx(), tap.fy());
        let from = sample::<T, CHANNELS, CONTIGUOUS>(source, tap.offset);
        let below = sample::<T, CHANNELS, CONTIGUOUS>(source, tap.offset + width);
        let (top, bottom) = (&data[from..from + 2 * channels], &data[below..below + 2 * channels]);
        for (channel, value) in cell.iter_mut().enumerate() {
            let right = channel + channels;
            *value = T::blend(weights, [top[channel], top[right], bottom[channel], bottom[right]]);
        }
    }
}

/// Cells on the rim and in the halo: missing pixels count as the border value. A pixel without weight is not looked
/// at, so that a NaN border does not reach valid cells on the last column.
pub(super) fn bilinear_edge<T: Bilinear, const CHANNELS: usize>(source: &Source<'_, T>, taps: &[Tap], cells: &mut [T]) {
    let channels = channels::<T, CHANNELS>(source);
    for (tap, cell) in taps.iter().zip(cells.chunks_exact_mut(channels)) {
        let weights = T::weights(tap.fx(), tap.fy());
        let (x, y) = unframed(tap.offset, source.image.width() as u32);
        let (right, below) = (x + i64::from(tap.fx() != 0), y + i64::from(tap.fy() != 0));
        let pixels =
            [(x, y), (right, y), (x, below), (right, below)].map(|(x, y)| &source.pixel_or_border(x, y)[..channels]);
        for (channel, value) in cell.iter_mut().enumerate() {
            *value = <T as Blend>::blend(weights, pixels.map(|pixel| pixel[channel]));
        }
    }
}
