//! `area`: each cell is the mean of the source over the cell's footprint.
//!
//! Cells whose footprint is no larger than a pixel are bilinear. The others are the mean of a lattice of bilinear probes
//! into averages over boxes, which are made first, where they are needed; see [`Plan`] for how it is chosen. Probes are
//! taps of the ordinary kernels, so every dtype, channel count and instruction set is served, and all agree to the last
//! bit.

mod footprints;
mod levels;
pub(super) mod looks;
pub(crate) mod plan;
mod probes;
mod scratch_lease;
mod stand_in;

use std::slice;

use super::options::border_of;
use super::{Bilinear, WarpOptions};
use crate::error::Result;
use crate::isa::Isa;
use crate::kernels::{Average, ProbesKernel, RowKernels, Source, sealed::Blend};
use crate::lut::Lut;
use crate::parallel;
use crate::table::block::LANES;
use crate::table::pattern::SamplePattern;
use crate::table::{Span, SpanKind, Tap};
use crate::view::F16;
use crate::view::buffer;
use crate::view::{ImageView, ImageViewMut, RowsMut};
use footprints::Footprints;
use levels::Levels;
use plan::{PatternSpan, Plan, RowPlan, leaves};
use probes::{Lattice, has_round_bias, probes_of};
use scratch_lease::ScratchLease;
use stand_in::warp_by_stand_in;

/// So many cells are probed at once, and at the end of a span up to a vector more: taps, one probe and the sums of three
/// channels are 1.5 KB.
const BATCH: usize = 64;

/// A cell is at least so much work as one that is bilinear: 20 cm cells of the seed job, 21 500 of them, take 11 times the
/// time, and on two threads half of it.
const WORK: usize = 8;

/// Cells that the buffers of a batch have room for: rounded up to whole vectors.
const ROOM: usize = BATCH + LANES;

/// A sample that has an average: its own, or that of another that stands in for it.
pub trait Area: Sized {
    /// Warps images that fit the table, the options and the outputs; `border` has a value for each channel or plane.
    ///
    /// # Errors
    /// [`LutError::AreaSize`](crate::error::LutError::AreaSize) and [`Error::OutOfMemory`](crate::Error::OutOfMemory).
    fn area(
        lut: &Lut,
        images: &[ImageView<'_, Self>],
        outs: &mut [ImageViewMut<'_, Self>],
        border: &[Self],
        options: &WarpOptions<Self>,
    ) -> Result<()>;
}

macro_rules! area {
    ($warp:ident: $($type:ty),*) => {$(
        impl Area for $type {
            fn area(
                lut: &Lut,
                images: &[ImageView<'_, Self>],
                outs: &mut [ImageViewMut<'_, Self>],
                border: &[Self],
                options: &WarpOptions<Self>,
            ) -> Result<()> {
                $warp(lut, images, outs, border, options)
            }
        }
    )*};
}
area!(warp: u8, u16, f32, f64);
area!(warp_by_stand_in: i8, i16, F16);

fn warp<T: Bilinear + Average>(
    lut: &Lut,
    images: &[ImageView<'_, T>],
    outs: &mut [ImageViewMut<'_, T>],
    border: &[T],
    options: &WarpOptions<T>,
) -> Result<()> {
    let plan = lut.derived(|table| Plan::new(Isa::active()?, table))?;
    let (rows, columns, channels) = (lut.rows(), lut.columns(), images[0].channels());
    let isa = options.isa()?;
    let threads = options.threads_for(rows * columns * WORK, channels)?;
    let mut room = ScratchLease::new(plan, channels * size_of::<T>())?;
    for (index, (image, out)) in images.iter().zip(outs).enumerate() {
        let source = options.source(lut, image, border_of(border, channels, index));
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
        parallel::for_each(threads, out.bands(band_rows), |(first, band)| job.run(first, band))?;
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

/// Buffers of a thread for a batch of cells.
struct Scratch<T: Average> {
    taps: [Tap; ROOM],
    probe: Vec<T>,
    sums: Vec<T::Sum>,
}

impl<T: Bilinear + Average> Job<'_, T> {
    /// Fills rows of the output from row `first` on.
    fn run(&self, first: usize, rows: RowsMut<'_, T>) -> Result<()> {
        let channels = self.source.channels();
        let mut scratch = Scratch {
            taps: [Tap::default(); ROOM],
            probe: buffer::filled("area", ROOM * channels, T::default())?,
            sums: buffer::filled("area", ROOM * channels, T::Sum::default())?,
        };
        let (mut footprints, mut pattern_spans) = (Footprints::new(self.isa, self.lut.table())?, Vec::new());
        for (row, cells) in (first..).zip(rows) {
            let plan = self.plan.row(row);
            for span in self.lut.table().row(row) {
                let own = span.first..span.first + span.cells;
                let cells = &mut cells[own.start * channels..own.end * channels];
                pattern_spans.clear();
                if self.lut.table().edges().has_footprint(span.kind) {
                    plan.spans(own, &mut pattern_spans)?;
                }
                self.span(span, &plan, &pattern_spans, &mut footprints, cells, &mut scratch)?;
            }
        }
        Ok(())
    }

    /// Fills the cells of a span, of which these are averaged.
    fn span(
        &self,
        span: Span<'_>,
        plan: &RowPlan<'_>,
        pattern_spans: &[PatternSpan],
        footprints: &mut Footprints,
        cells: &mut [T],
        scratch: &mut Scratch<T>,
    ) -> Result<()> {
        let channels = self.source.channels();
        let kernel = match span.kind {
            SpanKind::Outside => {
                self.source.fill_border(cells);
                return Ok(());
            }
            SpanKind::Halo if self.source.keeps() => return Ok(()),
            SpanKind::Inside => self.bilinear.inside,
            SpanKind::Rim | SpanKind::Halo => self.bilinear.edge,
        };
        let mut rest = cells;
        for (part, pattern_span) in parts_of(span, pattern_spans) {
            let own;
            (own, rest) = rest.split_at_mut(part.cells * channels);
            match pattern_span {
                Some(pattern_span) => self.averaged(pattern_span, plan, part, footprints, own, scratch)?,
                None => kernel(self.source, part.taps, own),
            }
        }
        Ok(())
    }

    /// Averages the footprints of a span, whose cells are those of `span`.
    fn averaged(
        &self,
        pattern_span: &PatternSpan,
        plan: &RowPlan<'_>,
        span: Span<'_>,
        footprints: &mut Footprints,
        cells: &mut [T],
        scratch: &mut Scratch<T>,
    ) -> Result<()> {
        let (level, first) = self.levels.get(pattern_span.pattern.kx, pattern_span.pattern.ky);
        let lattice = Lattice::new(pattern_span, first, level.width());
        let (width, _) = self.lut.source_size();
        let source = Source::new(level, self.source.border());
        let fused = self.fused.filter(|_| span.kind == SpanKind::Inside);
        if let (Some(fused), false) = (fused, pattern_span.clipped) {
            fused(&source, &lattice.probes(plan, pattern_span, span.taps, width), cells);
            return Ok(());
        }
        footprints.work_out(plan, pattern_span, span, width);
        // of the cells of blocks of which a probe leaves the image, mostly few do
        let channels = self.source.channels();
        let (mut taps, mut rest) = (span.taps, cells);
        for (part, is_clipped) in self.parts(pattern_span, footprints)? {
            let (own, cells);
            (own, taps) = taps.split_at(part.cells);
            (cells, rest) = rest.split_at_mut(part.cells * channels);
            match fused {
                _ if is_clipped => {
                    for (cell, values) in (part.first..).zip(cells.chunks_exact_mut(channels)) {
                        self.clipped(lattice, (level, first), footprints, cell, values, scratch);
                    }
                }
                Some(fused) => fused(&source, &lattice.probes(plan, &part, own, width), cells),
                None => self.whole(&part, lattice, &source, footprints, cells, scratch),
            }
        }
        Ok(())
    }

    /// Averages footprints that were worked out and of which no probe leaves the level.
    fn whole(
        &self,
        pattern_span: &PatternSpan,
        lattice: Lattice,
        level: &Source<'_, T>,
        footprints: &Footprints,
        cells: &mut [T],
        scratch: &mut Scratch<T>,
    ) {
        let channels = self.source.channels();
        let kernel = if pattern_span.pattern.halvings() == 0 { self.bilinear.inside } else { self.on_levels.inside };
        let (mut first, mut rest) = (pattern_span.first, cells);
        while !rest.is_empty() {
            // no rest of a few cells, for which kernels have no vectors
            let left = rest.len() / channels;
            let count = if left < ROOM { left } else { BATCH };
            let values;
            (values, rest) = rest.split_at_mut(count * channels);
            let samples = count.max(LANES) * channels;
            let (probe, sums) = (&mut scratch.probe[..samples], &mut scratch.sums[..values.len()]);
            for (index, at) in probes_of(pattern_span.pattern).enumerate() {
                lattice.taps(self.isa, at, footprints, first, &mut scratch.taps[..count.next_multiple_of(LANES)]);
                if count < LANES {
                    // kernels have no vectors for a few cells: the last is probed more than once
                    let last = scratch.taps[count - 1];
                    scratch.taps[count..LANES].fill(last);
                }
                let taps = &scratch.taps[..count.max(LANES)];
                if index == 0 && count >= LANES {
                    kernel(level, taps, values);
                } else {
                    kernel(level, taps, probe);
                }
                if index == 0 {
                    if count < LANES {
                        values.copy_from_slice(&probe[..values.len()]);
                    }
                    sums.fill(T::Sum::default());
                } else {
                    T::add(self.isa, values, probe, sums);
                }
            }
            self.finish(pattern_span.pattern, pattern_span.pattern.probes(), sums, values);
            first += count;
        }
    }

    /// The parts of a span whose cells all have a probe that leaves the level, or none.
    fn parts(
        &self,
        pattern_span: &PatternSpan,
        footprints: &Footprints,
    ) -> Result<impl Iterator<Item = (PatternSpan, bool)> + use<T>> {
        let mut flags = buffer::zeroed("area", pattern_span.cells)?;
        if pattern_span.clipped {
            let own = pattern_span.first..pattern_span.first + pattern_span.cells;
            let centre = footprints.centre.each_ref().map(|axis| &axis[own.clone()]);
            let sides = footprints.sides.each_ref().map(|side| &side[own.clone()]);
            leaves(
                self.isa,
                (pattern_span.pattern, pattern_span.shift),
                self.lut.source_size(),
                centre,
                sides,
                &mut flags,
            );
        }
        let (pattern_span, mut next) = (*pattern_span, 0);
        Ok(std::iter::from_fn(move || {
            let first = next;
            let &flag = flags.get(first)?;
            next += flags[first..].iter().take_while(|&&other| other == flag).count();
            Some((
                PatternSpan { first: pattern_span.first + first, cells: next - first, clipped: false, ..pattern_span },
                flag != 0,
            ))
        }))
    }

    /// Averages a footprint of which a part may lie outside the image, over the rest of it.
    fn clipped(
        &self,
        lattice: Lattice,
        (level, first): (&ImageView<'_, T>, [u32; 2]),
        footprints: &Footprints,
        cell: usize,
        values: &mut [T],
        scratch: &mut Scratch<T>,
    ) {
        let (image, channels) = (self.source.image(), values.len());
        let size = [image.width(), image.height()].map(|side| side as i32);
        let sums = &mut scratch.sums[..channels];
        sums.fill(T::Sum::default());
        let mut is_first = true;
        let count = lattice.each_probe(footprints, cell, size, |[x, y], [right, below], [fx, fy]| {
            let pixel = |(x, y): (usize, usize)| level.pixel(x - first[0] as usize, y - first[1] as usize);
            let pixels = [(x, y), (right, y), (x, below), (right, below)].map(pixel);
            let weights = T::weights(fx, fy);
            for (channel, (value, sum)) in values.iter_mut().zip(&mut *sums).enumerate() {
                let probe = <T as Blend>::blend(weights, pixels.map(|pixel| pixel[channel]));
                match is_first {
                    true => *value = probe,
                    false => *sum = T::accumulate(*sum, *value, probe),
                }
            }
            is_first = false;
        });
        self.finish(lattice.pattern, count, sums, values);
    }

    fn finish(&self, pattern: SamplePattern, count: u32, sums: &[T::Sum], values: &mut [T]) {
        if count > 1 {
            T::finish(self.isa, count, has_round_bias(pattern), sums, values);
        }
    }
}

/// The parts of a span whose cells are averaged, each with the pattern span that says how, and those between them, from left
/// to right.
fn parts_of<'a>(
    span: Span<'a>,
    pattern_spans: &'a [PatternSpan],
) -> impl Iterator<Item = (Span<'a>, Option<&'a PatternSpan>)> {
    let end = span.first + span.cells;
    let (mut next, mut rest) = (span.first, pattern_spans);
    std::iter::from_fn(move || {
        let (until, own) = match rest.split_first() {
            Some((own, others)) if own.first == next => {
                rest = others;
                (own.first + own.cells, Some(own))
            }
            Some((later, _)) => (later.first, None),
            None => (end, None),
        };
        (next < until).then(|| {
            let part = span.part(&(next..until));
            next = until;
            (part, own)
        })
    })
}
