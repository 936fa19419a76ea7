//! How much a frame counts in a cell, and the loop that adds it.

use std::ops::Range;

use super::contribution::Contribution;
use super::tile::{Kept, Layers, Tile, Value, insert};
use crate::error::{Error, MosaicError, Result};
use crate::isa::{self, Isa, for_each_isa};
use crate::parallel::{self, Work};
use crate::view::buffer;

/// Resolutions are kept in 1/4096 pixel a cell.
const ONE_PIXEL: u32 = 1 << 12;

/// Coarser frames are left out, as if they did not see the cell: 16 cells to a pixel.
pub(super) const COARSEST: f64 = 1.0 / 16.0;

/// The same in 1/4096 pixel.
const LEAST: u32 = ONE_PIXEL / 16;

/// Pixels a cell that are told from fewer.
const FINEST: f32 = 15.999;

/// What a frame's whole weight is.
pub(super) const WHOLE: u32 = 1 << 16;

/// The weight of a frame by how it resolves the cell: its eighth power in Q31, level from one pixel a cell on.
///
/// All that resolve a cell share it, and where none does the best one wins by far: half the resolution counts 1/256.
/// Every factor fits 32 bits and says so: of these the compiler makes vectors, of 64-bit products it does not.
#[inline(always)]
fn weight_of(resolution: u32, whole: u32) -> u32 {
    let product = |one: u32, other: u32| u64::from(one) * u64::from(other);
    let shared = if resolution < ONE_PIXEL { resolution } else { ONE_PIXEL };
    let square = shared * shared; // Q24
    let fourth = (product(square, square) >> 17) as u32; // Q31
    let eighth = (product(fourth, fourth) >> 31) as u32;
    let weight = (product(eighth, whole) >> 16) as u32; // up to 2^31
    let weight = if weight > 0 { weight } else { 1 };
    if resolution >= LEAST { weight } else { 0 }
}

/// Of the id of a frame in the key of a sample.
pub(super) const ID_BITS: u32 = 20;

/// What samples are ordered by: the resolution, in 512 steps from each to its double, then the frame's id.
#[inline(always)]
fn key(resolution: u32, id: u32) -> u32 {
    let octave = 31 - (resolution | 1).leading_zeros(); // 8 to 15 of what counts
    let steps = ((resolution << 15) >> octave >> 6) & 511;
    (octave.saturating_sub(LEAST.ilog2()) << 9 | steps) << ID_BITS | id
}

/// How far away the cells of a row are, and which distances count.
pub(super) struct Distances<'a> {
    /// The square of how far the row is away along x, of each cell that along y.
    pub(super) x_squared: f64,
    pub(super) y_squared: &'a [f64],
    /// From and to before which.
    pub(super) counted: (f64, f64),
}

/// Writes the resolutions of neighbouring cells in 1/4096 pixel, of so many `pixels` a cell; 0 where a cell does not count.
pub(super) fn quantise(isa: Isa, distances: &Distances<'_>, pixels: &[f32], resolutions: &mut [u16]) {
    for_each_isa!(isa, (body, body, body)(distances: &Distances<'_>, pixels: &[f32], resolutions: &mut [u16]));
    #[inline(always)]
    fn body(distances: &Distances<'_>, pixels: &[f32], resolutions: &mut [u16]) {
        let cells = resolutions.len();
        let (near, far) = distances.counted;
        let (near, far) = (near * near.abs(), far * far); // a near one below 0 leaves out nothing
        let (pixels, y_squared) = (&pixels[..cells], &distances.y_squared[..cells]);
        for cell in 0..cells {
            let squared = distances.x_squared + y_squared[cell];
            let counts = (squared >= near) & (squared < far);
            // plain comparisons, which NaN fails: f32::max and min look for it, and block vectors
            let pixels = pixels[cell];
            let pixels = if pixels > 0.0 { pixels } else { 0.0 };
            let pixels = if pixels < FINEST { pixels } else { FINEST };
            let resolution = (pixels * ONE_PIXEL as f32) as i32;
            resolutions[cell] = if counts & (resolution >= LEAST as i32) { resolution as u16 } else { 0 };
        }
    }
}

/// Neighbouring cells of a row, and what a frame shows of them.
struct Cells<'a, T> {
    layers: Layers<'a, T>,
    kept: Kept,
    values: &'a [T],
    resolutions: &'a [u16],
    /// Of the frame: how much it counts, and its id from 1 on, in [`ID_BITS`].
    whole: u32,
    id: u32,
    /// Room for a weight of each cell.
    weights: &'a mut [u32],
}

impl<T: Value> Cells<'_, T> {
    #[inline(always)]
    fn add_channels<const C: usize>(self) {
        let Self { layers, values, kept, whole, .. } = self;
        let cells = self.resolutions.len();
        let channels = if C == 0 { kept.channels } else { C };
        let (resolutions, weights) = (&self.resolutions[..cells], &mut self.weights[..cells]);
        if kept.samples > 0 {
            let lists = layers.keys.chunks_exact_mut(kept.samples);
            let lists = lists.zip(layers.samples.chunks_exact_mut(kept.samples * channels));
            for (((keys, samples), value), &resolution) in lists.zip(values.chunks_exact(channels)).zip(resolutions) {
                if resolution > 0 {
                    insert(keys, samples, key(resolution.into(), self.id), value);
                }
            }
        }
        for (weight, &resolution) in weights.iter_mut().zip(resolutions) {
            *weight = weight_of(resolution.into(), whole);
        }
        for ((total, count), &weight) in layers.weights.iter_mut().zip(&mut *layers.counts).zip(&*weights) {
            *total += u64::from(weight);
            *count += u32::from(weight > 0);
        }
        if !kept.labels {
            let numbers = (layers.totals.chunks_exact_mut(channels).zip(layers.sums.chunks_exact_mut(channels)))
                .zip(layers.squares.chunks_exact_mut(channels).zip(values.chunks_exact(channels)));
            for (((totals, sums), (squares, values)), &weight) in numbers.zip(&*weights) {
                for channel in 0..channels {
                    let value = values[channel].widened();
                    let once = if weight > 0 { value } else { 0 };
                    totals[channel] += u64::from(weight) * u64::from(value);
                    sums[channel] += u64::from(once);
                    squares[channel] += u64::from(once * once);
                }
            }
        }
        let bests = layers.bests.chunks_exact_mut(channels).zip(&mut *layers.resolutions);
        for (((best, known), values), &resolution) in bests.zip(values.chunks_exact(channels)).zip(resolutions) {
            // of equals the largest, channel by channel: some rule that does not depend on the order of frames
            let larger = if C == 1 { values[0] > best[0] } else { values > &*best };
            let better = (resolution > *known) | ((resolution == *known) & (resolution > 0) & larger);
            if C == 1 {
                best[0] = if better { values[0] } else { best[0] };
                *known = if better { resolution } else { *known };
            } else if better {
                *known = resolution;
                best.copy_from_slice(values);
            }
        }
    }
}

impl<T: Value> isa::Body for Cells<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        match self.kept.channels {
            1 => self.add_channels::<1>(),
            3 => self.add_channels::<3>(),
            _ => self.add_channels::<0>(),
        }
    }
}

impl<T: Value> Tile<'_, T> {
    /// Adds what frames show, in whatever order: row by row, so that a row of sums is read and written once for all of them.
    ///
    /// # Errors
    /// [`MosaicError`], and [`IsaError`](crate::error::IsaError) and [`Error::OutOfMemory`]; nothing has been added then.
    pub fn add(&mut self, contributions: &[Contribution<'_, T>], threads: Option<usize>) -> Result<()> {
        let (side, kept, isa) = (self.side, self.kept, Isa::active()?);
        for contribution in contributions {
            self.check(contribution)?;
        }
        let Some(first) = contributions.iter().map(|one| one.rows().start).min() else { return Ok(()) };
        let end = contributions.iter().map(|one| one.rows().end).max().unwrap_or(first);
        let (rows, cells) = (end - first, contributions.iter().map(|one| one.resolutions.len()).sum::<usize>());
        let threads = Work::bytes(cells * (8 + (8 + 4 * kept.samples) * kept.channels)).threads(threads)?;
        let band_rows = parallel::rows_per_band(rows, side * contributions.len(), threads);
        let mut bands = buffer::reserved("mosaic", rows.div_ceil(band_rows.max(1)))?;
        let mut left = self.layers.cells(first * side..end * side, kept);
        for band in (first..end).step_by(band_rows.max(1)) {
            let band_rows = band_rows.min(end - band);
            let (layers, below) = left.split(band_rows * side, kept);
            let weights = buffer::zeroed("mosaic", side)?;
            bands.push(Band { layers, rows: band..band + band_rows, weights });
            left = below;
        }
        parallel::for_each(threads, bands.iter_mut(), |band: &mut Band<'_, T>| {
            band.add(isa, (side, kept), contributions);
            Ok(())
        })
    }

    /// Refuses what does not fit the tile.
    fn check(&self, contribution: &Contribution<'_, T>) -> Result<()> {
        let (side, Kept { channels, .. }) = (self.side, self.kept);
        let (at, columns, rows) = (contribution.at, contribution.columns, contribution.rows().len());
        let fits = contribution.rows().end <= side && at.1.saturating_add(columns) <= side;
        if !fits || rows * columns != contribution.resolutions.len() {
            return Err(Error::Mosaic(MosaicError::Window { side, rows, columns, at }));
        }
        if contribution.values.len() != rows * columns * channels {
            let got = contribution.values.len() / (rows * columns).max(1);
            return Err(Error::Mosaic(MosaicError::Channels { expected: channels, got }));
        }
        Ok(())
    }
}

/// Some rows of a tile.
struct Band<'a, T> {
    layers: Layers<'a, T>,
    rows: Range<usize>,
    /// Room for a weight of each cell of a row.
    weights: Vec<u32>,
}

impl<T: Value> Band<'_, T> {
    fn add(&mut self, isa: Isa, (side, kept): (usize, Kept), contributions: &[Contribution<'_, T>]) {
        for row in self.rows.clone() {
            for one in contributions.iter().filter(|one| one.rows().contains(&row)) {
                let columns = one.counted_columns(row);
                let own = |columns: Range<usize>| {
                    let before = (row - one.at.0) * one.columns;
                    before + columns.start..before + columns.end
                };
                let numbers = own(columns.clone());
                let first = (row - self.rows.start) * side + one.at.1 + columns.start;
                isa::run(
                    isa,
                    Cells {
                        layers: self.layers.cells(first..first + columns.len(), kept),
                        kept,
                        values: &one.values[numbers.start * kept.channels..numbers.end * kept.channels],
                        resolutions: &one.resolutions[numbers],
                        whole: one.weight.clamp(1, WHOLE),
                        id: 1 + one.id % ((1 << ID_BITS) - 1), // 0 is of no frame
                        weights: &mut self.weights,
                    },
                );
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mosaic::OwnedTile;

    #[test]
    fn keys_grow_with_the_resolution() {
        assert_eq!(key(LEAST, 1), 1);
        assert_eq!(key(u16::MAX.into(), 5), (4095 << ID_BITS) | 5);
        assert_eq!(key(ONE_PIXEL, 0) >> ID_BITS, 4 * 512);
        for resolution in LEAST..u32::from(u16::MAX) {
            let (low, high) = (key(resolution, 0) >> ID_BITS, key(resolution + 1, 0) >> ID_BITS);
            assert!(low <= high && high <= low + 2, "{resolution}");
            let octave = f64::from(1u32 << (low >> 9)) * f64::from(LEAST);
            let value = octave * (1.0 + f64::from(low & 511) / 512.0);
            assert!((value / f64::from(resolution) - 1.0).abs() < 1.0 / 256.0, "{resolution}: {value}");
        }
    }

    #[test]
    fn weights_are_the_eighth_power_and_level_from_one_pixel_on() {
        assert_eq!(weight_of(ONE_PIXEL, WHOLE), 1 << 31);
        assert_eq!(weight_of(10 * ONE_PIXEL, WHOLE), 1 << 31);
        assert_eq!(weight_of(ONE_PIXEL / 2, WHOLE), 1 << 23);
        assert_eq!(weight_of(ONE_PIXEL, WHOLE / 2), 1 << 30);
        assert_eq!(weight_of(LEAST, WHOLE), 1, "what counts at all counts something");
        assert_eq!(weight_of(LEAST - 1, WHOLE), 0);
        for resolution in LEAST..ONE_PIXEL {
            let exact = (f64::from(resolution) / f64::from(ONE_PIXEL)).powi(8) * f64::from(1u32 << 31);
            let got = f64::from(weight_of(resolution, WHOLE));
            assert!((got - exact).abs() <= 1.0 + exact * 1e-4, "{resolution}: {got}, {exact}");
        }
    }

    /// All numbers of a tile, one after another.
    fn all<T: Value>(tile: &OwnedTile<T>) -> Vec<u64> {
        let OwnedTile { weights, totals, sums, squares, .. } = tile;
        let small = |values: &[T]| values.iter().map(|value| value.widened().into()).collect::<Vec<u64>>();
        let words = |values: &[u32]| values.iter().map(|&value| value.into()).collect::<Vec<u64>>();
        let resolutions = tile.resolutions.iter().map(|&value| value.into()).collect();
        let others = [words(&tile.counts), words(&tile.keys), small(&tile.bests), small(&tile.samples), resolutions];
        [weights, totals, sums, squares].into_iter().chain(&others).flatten().copied().collect()
    }

    const SIDE: usize = if cfg!(miri) { 8 } else { 37 };

    fn noise(state: &mut u64) -> u32 {
        *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*state >> 33) as u32
    }

    /// Windows of noise: of all sizes, with cells that do not count and some that are as good as others.
    fn contributions<T: Value>(channels: usize, of: impl Fn(u32) -> T) -> Vec<Contribution<'static, T>> {
        let mut state = 7;
        let (all, last, most) = (SIDE, SIDE - 1, ((SIDE / 7, SIDE / 5), SIDE / 2 + 2, SIDE - SIDE / 5));
        let windows = [((0, 0), all, all), most, most, ((last, 0), 1, all), ((SIDE / 12, last), SIDE / 4, 1)];
        let one = |(id, &(at, rows, columns)): (usize, &((usize, usize), usize, usize))| {
            let cells = rows * columns;
            let values = (0..cells * channels).map(|_| of(noise(&mut state))).collect();
            let resolution = |bits: u32| [0, 300, (bits >> 8) as u16 | 256][bits as usize % 3];
            let resolutions = (0..cells).map(|_| resolution(noise(&mut state))).collect();
            Contribution { at, columns, values, resolutions, weight: [65536, 1, 9000][id % 3], id: id as u32 }
        };
        windows.iter().enumerate().map(one).collect()
    }

    /// What adding is: cell by cell.
    fn by_definition<T: Value>(kept: Kept, contributions: &[Contribution<'_, T>]) -> Vec<u64> {
        let (channels, count) = (kept.channels, kept.samples);
        let mut sums = OwnedTile::new(SIDE, kept).unwrap();
        for one in contributions {
            for (index, &resolution) in one.resolutions.iter().enumerate().filter(|&(_, &resolution)| resolution > 0) {
                let cell = (one.at.0 + index / one.columns) * SIDE + one.at.1 + index % one.columns;
                let values = &one.values[index * channels..(index + 1) * channels];
                let weight = u64::from(weight_of(resolution.into(), one.weight));
                sums.weights[cell] += weight;
                sums.counts[cell] += 1;
                let own = cell * channels..(cell + 1) * channels;
                if !kept.labels {
                    for (number, value) in own.clone().zip(values.iter().map(|value| u64::from(value.widened()))) {
                        sums.totals[number] += weight * value;
                        sums.sums[number] += value;
                        sums.squares[number] += value * value;
                    }
                }
                if (resolution, values) > (sums.resolutions[cell], &sums.bests[own.clone()]) {
                    sums.resolutions[cell] = resolution;
                    sums.bests[own].copy_from_slice(values);
                }
                let lists = (cell * count..(cell + 1) * count, cell * count * channels..(cell + 1) * count * channels);
                let key = key(resolution.into(), 1 + one.id);
                insert(&mut sums.keys[lists.0], &mut sums.samples[lists.1], key, values);
            }
        }
        all(&sums)
    }

    fn check<T: Value>(of: impl Fn(u32) -> T + Copy) {
        for (channels, samples, labels) in [(1, 0, false), (2, 3, false), (3, 0, false), (3, 2, false), (1, 2, true)] {
            let kept = Kept { channels, samples, labels };
            let contributions = contributions(channels, of);
            let expected = by_definition(kept, &contributions);
            for &isa in Isa::available() {
                let mut sums = OwnedTile::new(SIDE, kept).unwrap();
                let mut band = Band { layers: sums.tile().unwrap().layers, rows: 0..SIDE, weights: vec![0; SIDE] };
                band.add(isa, (SIDE, kept), &contributions);
                assert!(all(&sums) == expected, "{isa:?} {kept:?}");
            }
            let mut reversed = contributions.clone();
            reversed.reverse();
            for (parts, threads) in [(1, 1), (1, 3), (2, 1), (5, 2)] {
                let mut sums = OwnedTile::new(SIDE, kept).unwrap();
                for part in reversed.chunks(reversed.len().div_ceil(parts)) {
                    let mut tile = sums.tile().unwrap();
                    tile.add(part, Some(threads)).unwrap();
                }
                assert!(all(&sums) == expected, "{parts} parts {kept:?}");
            }
        }
    }

    #[test]
    fn frames_that_wait_are_added_as_one_by_one_in_any_order_on_every_instruction_set() {
        check(|bits| bits as u8);
        check(|bits| bits as u16);
    }

    #[test]
    fn what_is_no_tile_is_refused() {
        let one = Kept { channels: 1, samples: 0, labels: false };
        let none = Kept { channels: 0, ..one };
        let refused = OwnedTile::<u8>::new(4, none).unwrap().tile().map(|_| ());
        assert!(matches!(refused, Err(Error::Mosaic(MosaicError::Channels { got: 0, .. }))), "{refused:?}");
        let mut empty = OwnedTile::<u8>::new(0, one).unwrap();
        let refused = Tile::new(1 << 32, one, empty.tile().unwrap().layers).map(|_| ());
        assert!(matches!(refused, Err(Error::Mosaic(MosaicError::Layer { layer: "weights", got: 0, .. }))));
    }

    #[test]
    fn a_near_distance_below_0_leaves_out_nothing() {
        let y_squared = [0.0, 0.25, 4.0, 100.0];
        let mut resolutions = [0; 4];
        let distances = Distances { x_squared: 0.0, y_squared: &y_squared, counted: (-1.0, 5.0) };
        quantise(Isa::Scalar, &distances, &[1.0; 4], &mut resolutions);
        assert_eq!(resolutions.map(|resolution| resolution > 0), [true, true, true, false]);
    }

    #[test]
    fn what_does_not_fit_the_tile_is_refused_and_nothing_is_added() {
        let kept = Kept { channels: 1, samples: 0, labels: false };
        let good = contributions(1, |bits| bits as u8).remove(1);
        let outside = Contribution { at: (SIDE / 2, good.at.1), ..good.clone() };
        let ragged = Contribution { columns: good.columns + 1, ..good.clone() };
        let deep = Contribution { values: vec![0; good.values.len() * 3].into(), ..good.clone() };
        let far = Contribution { at: (usize::MAX, usize::MAX - 3), ..good.clone() };
        for wrong in [outside, ragged, deep, far] {
            let mut sums = OwnedTile::new(SIDE, kept).unwrap();
            let mut tile = sums.tile().unwrap();
            let refused = tile.add(&[good.clone(), wrong], None);
            assert!(matches!(refused, Err(Error::Mosaic(_))), "{refused:?}");
            assert!(all(&sums).iter().all(|&number| number == 0));
        }
    }
}
