//! The kernels in plain Rust: the definition that every other instruction set is tested against with `==`.

use super::average::Average;
use super::places::Places;
use super::{Probes, Source, sealed::Blend};
use crate::isa::Isa;
use crate::kernels::Fraction;
use crate::table::{Tap, unframed};
use crate::view::Sample;

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

/// Cells whose nearest pixels are these, counted as `y * width + x`.
#[cfg(target_arch = "x86_64")]
pub(super) fn copy<T: Sample>(source: &Source<'_, T>, pixels: &[u32], cells: &mut [T]) {
    let channels = source.channels();
    for (&pixel, cell) in pixels.iter().zip(cells.chunks_exact_mut(channels)) {
        let from = sample::<T, 0, false>(source, pixel);
        cell.copy_from_slice(&source.image.data()[from..from + channels]);
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
pub(super) fn bilinear<T: Blend, P: Places<T>, const CHANNELS: usize, const CONTIGUOUS: bool>(
    source: &Source<'_, T>,
    places: P,
    cells: &mut [T],
) {
    blend_cells::<T, P, CHANNELS, CONTIGUOUS>(source, places, cells);
}

/// [`bilinear`], in the caller's instruction set.
#[inline(always)]
pub(super) fn blend_cells<T: Blend, P: Places<T>, const CHANNELS: usize, const CONTIGUOUS: bool>(
    source: &Source<'_, T>,
    places: P,
    cells: &mut [T],
) {
    let channels = channels::<T, CHANNELS>(source);
    let (data, width) = (source.image.data(), source.image.width() as u32);
    for ((index, tap), cell) in places.taps().iter().enumerate().zip(cells.chunks_exact_mut(channels)) {
        let weights = places.weights(index);
        let from = sample::<T, CHANNELS, CONTIGUOUS>(source, tap.offset);
        let below = sample::<T, CHANNELS, CONTIGUOUS>(source, tap.offset + width);
        let (top, bottom) = (&data[from..from + 2 * channels], &data[below..below + 2 * channels]);
        for (channel, value) in cell.iter_mut().enumerate() {
            let right = channel + channels;
            *value = T::blend(weights, [top[channel], top[right], bottom[channel], bottom[right]]);
        }
    }
}

/// Averages of probes cell by cell, where the wide loads of an instruction set would leave an image of `CHANNELS` channels.
/// `taps_of` says where the probe at these offsets looks in `LANES` footprints, as offsets and as fractions of x in the low
/// and of y in the high half; the cells begin with the footprint `first`.
#[cold]
pub(super) fn probes<const CHANNELS: usize, const LANES: usize>(
    source: &Source<'_, u8>,
    probes: &Probes<'_>,
    first: usize,
    cells: &mut [u8],
    taps_of: impl Fn(i16, i16) -> ([u32; LANES], [u32; LANES]),
) {
    let (mut sums, mut blends) = ([[0; 4]; LANES], [[0; 4]; LANES]);
    let (sums, blends) = (&mut sums.as_flattened_mut()[..cells.len()], &mut blends.as_flattened_mut()[..cells.len()]);
    let all = probes.offsets[0].iter().flat_map(|&along| probes.offsets[1].iter().map(move |&down| (along, down)));
    for (index, (along, down)) in all.enumerate() {
        let (offsets, fractions) = taps_of(along, down);
        let taps: [Tap; LANES] = std::array::from_fn(|cell| Tap {
            offset: offsets[cell],
            x: fractions[cell] as u16,
            y: (fractions[cell] >> 16) as u16,
        });
        let taps = &taps[first..][..cells.len() / CHANNELS];
        if index == 0 {
            bilinear::<u8, &[Tap], CHANNELS, false>(source, taps, cells);
        } else {
            bilinear::<u8, &[Tap], CHANNELS, false>(source, taps, blends);
            <u8 as Average>::add(Isa::Scalar, cells, blends, sums);
        }
    }
    <u8 as Average>::finish(Isa::Scalar, probes.count(), probes.round_bias, sums, cells);
}

/// Cells on the rim and in the halo: missing pixels count as the border value. A pixel without weight is not looked
/// at, so that a NaN border does not reach valid cells on the last column.
pub(super) fn bilinear_edge<T: Blend, const CHANNELS: usize>(source: &Source<'_, T>, taps: &[Tap], cells: &mut [T]) {
    for (tap, cell) in taps.iter().zip(cells.chunks_exact_mut(channels::<T, CHANNELS>(source))) {
        let weights = T::weights(tap.fx(), tap.fy());
        let at = unframed(tap.offset, source.image.width() as u32);
        blend_edge(source, at, [tap.fx() != 0, tap.fy() != 0], weights, cell);
    }
}

/// Bilinear of cells on the rim and in the halo, from exact coordinates, which are above -1.
pub(super) fn exact_edge<F: Fraction, T: Blend<Weights = (F, F)>>(
    source: &Source<'_, T>,
    [us, vs]: [&[f64]; 2],
    cells: &mut [T],
) {
    let axis = |coordinate: f64| (coordinate.floor() as i64, F::of(coordinate - coordinate.floor()));
    for ((&u, &v), cell) in us.iter().zip(vs).zip(cells.chunks_exact_mut(source.channels())) {
        let ((x, fx), (y, fy)) = (axis(u), axis(v));
        blend_edge(source, (x, y), [fx, fy].map(|fraction| fraction != F::default()), (fx, fy), cell);
    }
}

/// One cell whose top-left pixel is at `(x, y)`; `beyond` tells whether it has a part in the next column and row.
#[inline(always)]
fn blend_edge<T: Blend>(
    source: &Source<'_, T>,
    (x, y): (i64, i64),
    beyond: [bool; 2],
    weights: T::Weights,
    cell: &mut [T],
) {
    let (right, below) = (x + i64::from(beyond[0]), y + i64::from(beyond[1]));
    let pixels =
        [(x, y), (right, y), (x, below), (right, below)].map(|(x, y)| &source.pixel_or_border(x, y)[..cell.len()]);
    for (channel, value) in cell.iter_mut().enumerate() {
        *value = T::blend(weights, pixels.map(|pixel| pixel[channel]));
    }
}
