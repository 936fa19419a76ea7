//! `area`: each cell is the mean of the source over the cell's footprint.
//!
//! Cells whose footprint is no larger than a pixel are bilinear. The others are the mean of a lattice of bilinear probes
//! into averages over boxes, which are made first, where they are needed; see [`Plan`] for how it is chosen. Probes are
//! taps of the ordinary kernels, so every dtype, channel count and instruction set is served, and all agree to the last
//! bit.

mod average;
mod levels;
mod pairs;
mod probes;

use std::slice;

pub(crate) use average::Average;

use super::WarpOptions;
use super::kernels::{Bilinear, ProbesKernel, RowKernels, Source, sealed::Blend};
use crate::cpu::Isa;
use crate::error::Result;
use crate::image::{ImageView, ImageViewMut, RowsMut};
use crate::lut::Lut;
use crate::lut::area::{Cells, PADDING, Piece, Plan, Shape};
use crate::lut::table::{RunKind, Segment, Tap};
use crate::parallel;
use levels::{Levels, Room};
use probes::{Lattice, is_lean};

/// So many cells are probed at once, and at the end of a piece up to a vector more: taps, one probe and the sums of three
/// channels are 1.5 KB.
const BATCH: usize = 64;

/// Room for a batch, rounded up to whole vectors.
const ROOM: usize = BATCH + PADDING;

/// Warps images that fit the table, the options and the outputs.
pub(super) fn warp<T: Bilinear>(
    lut: &Lut,
    images: &[ImageView<'_, T>],
    outs: &mut [ImageViewMut<'_, T>],
    border: &[T],
    options: &WarpOptions<T>,
) -> Result<()> {
    let plan = lut.area_plan()?;
    let (rows, columns, channels) = (lut.rows(), lut.columns(), images[0].channels());
    let isa = options.isa()?;
    let threads = options.threads_for(rows * columns, channels)?;
    let mut room = Room::new(plan, images[0].width(), channels * size_of::<T>())?;
    for (index, (image, out)) in images.iter().zip(outs).enumerate() {
        // of one value for each channel, all; of one for each plane, its own
        let own = if border.len() == channels { 0 } else { index % border.len() };
        let source = Source::new(image, &border[own..own + channels]);
        let levels = Levels::new(plan, image, &mut room, (isa, threads))?;
        let job = Job {
            lut,
            plan,
            isa,
            bilinear: options.kernels(slice::from_ref(image))?,
            on_levels: RowKernels::bilinear(isa, channels, true),
            fused: T::probes(isa, channels),
            levels: &levels,
            source: &source,
        };
        let band_rows = parallel::rows_per_band(rows, columns, threads);
        parallel::for_each(threads, out.bands(band_rows), |(first, band)| job.run(first, band));
    }
    Ok(())
}

/// The warp of one image.
struct Job<'a, T> {
    lut: &'a Lut,
    plan: &'a Plan,
    isa: Isa,
    bilinear: RowKernels<T>,
    on_levels: RowKernels<T>,
    /// All probes of a footprint at once, where there is a kernel for it.
    fused: Option<ProbesKernel<T>>,
    levels: &'a Levels<'a, T>,
    source: &'a Source<'a, T>,
}

/// What a thread needs for a batch.
struct Scratch<T: Average> {
    taps: [Tap; ROOM],
    probe: Vec<T>,
    sums: Vec<T::Sum>,
}

impl<T: Bilinear> Job<'_, T> {
    /// Fills rows of the output from row `first` on.
    fn run(&self, first: usize, rows: RowsMut<'_, T>) {
        let channels = self.source.channels();
        let mut scratch = Scratch {
            taps: [Tap::default(); ROOM],
            probe: vec![T::default(); ROOM * channels],
            sums: vec![T::Sum::default(); ROOM * channels],
        };
        for (row, cells) in (first..).zip(rows) {
            let (mut pieces, footprints) = self.plan.row(row);
            for segment in self.lut.table().row(row) {
                pieces = self.segment(segment, pieces, cells);
            }
            let (pieces, _) = self.plan.row(row);
            for piece in pieces {
                let own = piece.first as usize * channels..(piece.first + piece.cells) as usize * channels;
                self.piece(piece, footprints, &mut cells[own], &mut scratch);
            }
        }
    }

    /// Fills the cells of a segment that are no part of a piece; returns the pieces that come after it.
    fn segment<'a>(&self, segment: Segment<'_>, mut pieces: &'a [Piece], cells: &mut [T]) -> &'a [Piece] {
        let channels = self.source.channels();
        let end = segment.first + segment.cells;
        let of = |from: usize, to: usize| from * channels..to * channels;
        let kernel = match segment.kind {
            RunKind::Outside => {
                self.source.fill_border(&mut cells[of(segment.first, end)]);
                return pieces;
            }
            RunKind::Inside => self.bilinear.inside,
            RunKind::Rim | RunKind::Halo => self.bilinear.edge,
        };
        let mut from = segment.first;
        while from < end {
            let begin = pieces.first().map_or(end, |piece| piece.first as usize).clamp(from, end);
            if begin > from {
                let taps = &segment.taps[from - segment.first..begin - segment.first];
                kernel(self.source, taps, &mut cells[of(from, begin)]);
            }
            // a piece may go on in the next segment
            from = end;
            if let Some((piece, rest)) = pieces.split_first()
                && begin < end
            {
                let after = (piece.first + piece.cells) as usize;
                from = after.min(end);
                pieces = if after <= end { rest } else { pieces };
            }
        }
        pieces
    }

    /// Averages the footprints of a piece.
    fn piece(&self, piece: &Piece, footprints: &Cells, cells: &mut [T], scratch: &mut Scratch<T>) {
        let (level, first_row) = self.levels.get(piece.shape.kx, piece.shape.ky);
        let lattice = Lattice::new(piece, first_row, level.width());
        let channels = self.source.channels();
        let start = piece.start as usize;
        if piece.clipped {
            for (cell, values) in (start..).zip(cells.chunks_exact_mut(channels)) {
                self.clipped(lattice, (level, first_row), footprints, cell, values, scratch);
            }
            return;
        }
        let (kernel, border) = if piece.shape.halvings() == 0 {
            (self.bilinear.inside, self.source.border())
        } else {
            (self.on_levels.inside, self.source.border())
        };
        let level = Source::new(level, border);
        if let Some(fused) = self.fused {
            return fused(&level, &lattice.probes(footprints, start), cells);
        }
        let (mut first, mut rest) = (start, cells);
        while !rest.is_empty() {
            // no rest of a few cells, for which kernels have no vectors
            let left = rest.len() / channels;
            let count = if left < ROOM { left } else { BATCH };
            let values;
            (values, rest) = rest.split_at_mut(count * channels);
            let samples = count.max(PADDING) * channels;
            let (probe, sums) = (&mut scratch.probe[..samples], &mut scratch.sums[..values.len()]);
            for (index, at) in lattice_of(piece.shape).enumerate() {
                lattice.taps(self.isa, at, footprints, first, &mut scratch.taps[..count.next_multiple_of(PADDING)]);
                if count < PADDING {
                    // kernels have no vectors for a few cells: the last is probed more than once
                    let last = scratch.taps[count - 1];
                    scratch.taps[count..PADDING].fill(last);
                }
                let taps = &scratch.taps[..count.max(PADDING)];
                if index == 0 && count >= PADDING {
                    kernel(&level, taps, values);
                } else {
                    kernel(&level, taps, probe);
                }
                if index == 0 {
                    if count < PADDING {
                        values.copy_from_slice(&probe[..values.len()]);
                    }
                    sums.fill(T::Sum::default());
                } else {
                    T::add(self.isa, values, probe, sums);
                }
            }
            self.finish(piece.shape, piece.shape.probes(), sums, values);
            first += count;
        }
    }

    /// Averages a footprint of which a part may lie outside the image, over the rest of it.
    fn clipped(
        &self,
        lattice: Lattice,
        (level, first_row): (&ImageView<'_, T>, u32),
        footprints: &Cells,
        cell: usize,
        values: &mut [T],
        scratch: &mut Scratch<T>,
    ) {
        let (image, channels) = (self.source.image(), values.len());
        let size = [image.width(), image.height()].map(|side| side as i32);
        let last = lattice.last_entry(size);
        let sums = &mut scratch.sums[..channels];
        sums.fill(T::Sum::default());
        let mut count = 0;
        let mut probe = |position: [i32; 2]| {
            let ([x, y], [fx, fy]) = lattice.entry(position, last);
            let (right, below) = ((x + 1).min(last[0] as usize), (y + 1).min(last[1] as usize));
            let row = |y: usize| y - first_row as usize;
            let pixels = [(x, y), (right, y), (x, below), (right, below)].map(|(x, y)| level.pixel(x, row(y)));
            let weights = T::weights(fx, fy);
            for (channel, (value, sum)) in values.iter_mut().zip(&mut *sums).enumerate() {
                let probe = <T as Blend>::blend(weights, pixels.map(|pixel| pixel[channel]));
                match count {
                    0 => *value = probe,
                    _ => *sum = T::accumulate(*sum, *value, probe),
                }
            }
            count += 1;
        };
        let positions = || lattice_of(lattice.shape).map(|at| lattice.position(at, footprints, cell));
        let is_inside = |at: &[i32; 2]| Lattice::is_inside(*at, size);
        positions().filter(is_inside).for_each(&mut probe);
        if !positions().any(|at| is_inside(&at)) {
            // every probe is outside, though the middle is not
            probe([footprints.x[cell], footprints.y[cell]]);
        }
        self.finish(lattice.shape, count, sums, values);
    }

    fn finish(&self, shape: Shape, count: u32, sums: &[T::Sum], values: &mut [T]) {
        if count > 1 {
            T::finish(self.isa, count, is_lean(shape), sums, values);
        }
    }
}

/// The probes of a shape.
fn lattice_of(shape: Shape) -> impl Iterator<Item = (u8, u8)> {
    (0..shape.along).flat_map(move |along| (0..shape.down).map(move |down| (along, down)))
}
