//! `mode`: each cell is the id that most of its footprint on the source has. For label images, of which averages mean
//! nothing and of which nearest loses what is thinner than a cell.

use super::options::border_of;
use super::{WarpOptions, check};
use crate::error::{Error, Result, WarpError};
use crate::isa::Isa;
use crate::kernels::FRACTION_BITS;
use crate::kernels::{RowKernels, Source};
use crate::lut::Lut;
use crate::lut::footprint::{Coordinates, Sides, check_sides};
use crate::parallel::{self, check_interrupt};
use crate::table::pattern::SamplePattern;
use crate::view::buffer;
use crate::view::{ImageView, ImageViewMut, RowsMut, Sample};

/// Ids that an image may have.
const MAX_IDS: usize = 256;

/// At most so many pixels are looked at along either side of a footprint.
const MAX_LOOKS: i32 = 16;

impl Lut {
    /// Warps several label images at once, the i-th into the i-th output, as
    /// [`Lut::warp_many_into`](crate::Lut::warp_many_into): each cell gets the most frequent id of its footprint on the source,
    /// of equally frequent ones the smallest, channel by channel. Of a footprint up to 16 x 16 pixels are looked at, those
    /// outside the image excepted; where it is no larger than a pixel that is the nearest one.
    /// `options.interpolation` is not looked at.
    ///
    /// # Errors
    /// Those of [`Lut::warp_many_nearest_into`](crate::Lut::warp_many_nearest_into), [`WarpError::TooManyIds`] where an
    /// image has more than 256 different ids, and [`LutError::AreaSize`](crate::error::LutError::AreaSize).
    pub fn warp_many_mode_into<T: Sample + Ord>(
        &self,
        images: &[ImageView<'_, T>],
        outs: &mut [ImageViewMut<'_, T>],
        options: &WarpOptions<T>,
    ) -> Result<()> {
        let border = check(self, images, outs, options)?;
        check_sides(self.source_size())?;
        let kernels = options.nearest_kernels(images)?;
        let isa = options.isa()?;
        let labels = labels_of(images)?;
        let (rows, columns, channels) = (self.rows(), self.columns(), images[0].channels());
        let threads = options.threads_for(rows * columns * images.len(), channels)?;
        let band_rows = parallel::rows_per_band(rows, columns, threads);
        for (index, (labels, out)) in labels.iter().zip(outs).enumerate() {
            let source = options.source(self, labels.image, border_of(&border, channels, index));
            let job = Job { lut: self, isa, labels, source: &source, kernels: &kernels };
            parallel::for_each(threads, out.bands(band_rows), |(first, band)| job.run(first, band))?;
        }
        Ok(())
    }
}

/// The images as labels, none of which has too many ids.
fn labels_of<'a, T: Sample + Ord>(images: &'a [ImageView<'a, T>]) -> Result<Vec<Labels<'a, T>>> {
    let mut all = buffer::reserved("mode", images.len())?;
    for image in images {
        all.push(Labels::new(image)?);
    }
    Ok(all)
}

/// An image whose pixels are also known as places in a list of ids.
struct Labels<'a, T> {
    image: &'a ImageView<'a, T>,
    /// Ascending.
    ids: Vec<T>,
    /// For each sample, row by row without gaps.
    places: Vec<u8>,
}

impl<'a, T: Sample + Ord> Labels<'a, T> {
    fn new(image: &'a ImageView<'a, T>) -> Result<Self> {
        let row = |y: usize| {
            let start = image.row_start(y);
            &image.data()[start..start + image.width() * image.channels()]
        };
        let rows = || (0..image.height()).map(row);
        let mut ids: Vec<T> = Vec::new();
        let mut last = None;
        for row in rows() {
            check_interrupt()?;
            for &id in row {
                if last == Some(id) {
                    continue; // labels come in areas
                }
                last = Some(id);
                if let Err(place) = ids.binary_search(&id) {
                    if ids.len() == MAX_IDS {
                        return Err(Error::Warp(WarpError::TooManyIds { limit: MAX_IDS }));
                    }
                    ids.insert(place, id);
                }
            }
        }
        let samples = image.width() * image.height() * image.channels();
        let mut places = buffer::reserved("mode", samples)?;
        let mut last = (ids[0], 0);
        for row in rows() {
            check_interrupt()?;
            for &id in row {
                if id != last.0 {
                    // another thread may write to the image: an id that was not there is taken for one that was
                    let place = ids.partition_point(|&other| other < id).min(ids.len() - 1);
                    last = (id, place as u8);
                }
                places.push(last.1);
            }
        }
        Ok(Self { image, ids, places })
    }
}

/// The warp of one image.
struct Job<'a, T> {
    lut: &'a Lut,
    isa: Isa,
    labels: &'a Labels<'a, T>,
    source: &'a Source<'a, T>,
    kernels: &'a RowKernels<T>,
}

impl<T: Sample + Ord> Job<'_, T> {
    fn run(&self, first: usize, rows: RowsMut<'_, T>) -> Result<()> {
        let (table, channels) = (self.lut.table(), self.source.channels());
        let mut near = Coordinates::three(self.isa, table, first)?;
        let mut sides = Sides::new(table.columns())?;
        let mut votes = Votes { counts: [0; MAX_IDS], seen: Vec::with_capacity(MAX_IDS) };
        for (row, cells) in (first..).zip(rows) {
            near[2].read(self.isa, table, Some(row + 1));
            sides.read(self.isa, &near);
            for span in table.row(row) {
                let own = span.first * channels..(span.first + span.cells) * channels;
                self.kernels.fill(span.kind, self.source, span.taps, &mut cells[own]);
            }
            for (cell, values) in cells.chunks_exact_mut(channels).enumerate() {
                if near[1].is_valid(cell) {
                    self.cell(near[1].at(cell), sides.of(cell), values, &mut votes);
                }
            }
            near.rotate_left(1);
        }
        Ok(())
    }

    /// Replaces the nearest pixel of a cell by the majority of its footprint, if that is larger than a pixel.
    fn cell(&self, centre: [i32; 2], [ax, ay, bx, by]: [i32; 4], values: &mut [T], votes: &mut Votes) {
        let looks = |x: i32, y: i32| {
            ((x.abs().max(y.abs()).saturating_add((1 << FRACTION_BITS) - 1)) >> FRACTION_BITS).clamp(1, MAX_LOOKS) as u8
        };
        let (along, down) = (looks(ax, ay), looks(bx, by));
        if along.max(down) == 1 {
            return;
        }
        let size = [self.labels.image.width(), self.labels.image.height()];
        let part = |side: i32, index: u8, count: u8| {
            (i64::from(side) * i64::from(SamplePattern::offsets(count)[usize::from(index)])) >> 14
        };
        let pixel = |centre: i32, a: i64, b: i64, size: usize| {
            usize::try_from((i64::from(centre) + a + b + (1 << (FRACTION_BITS - 1))) >> FRACTION_BITS)
                .ok()
                .filter(|&at| at < size)
        };
        for (channel, value) in values.iter_mut().enumerate() {
            for (i, j) in (0..along).flat_map(|i| (0..down).map(move |j| (i, j))) {
                let x = pixel(centre[0], part(ax, i, along), part(bx, j, down), size[0]);
                let y = pixel(centre[1], part(ay, i, along), part(by, j, down), size[1]);
                if let (Some(x), Some(y)) = (x, y) {
                    votes.add(self.labels.places[(y * size[0] + x) * self.source.channels() + channel]);
                }
            }
            if let Some(place) = votes.winner() {
                *value = self.labels.ids[usize::from(place)];
            }
        }
    }
}

/// How many pixels of a footprint have each id.
struct Votes {
    counts: [u16; MAX_IDS],
    seen: Vec<u8>,
}

impl Votes {
    fn add(&mut self, place: u8) {
        let count = &mut self.counts[usize::from(place)];
        if *count == 0 {
            self.seen.push(place);
        }
        *count += 1;
    }

    /// The first place of those with the most votes; all are forgotten.
    fn winner(&mut self) -> Option<u8> {
        let counts = &mut self.counts;
        let best =
            self.seen.iter().copied().max_by_key(|&place| (counts[usize::from(place)], std::cmp::Reverse(place)));
        self.seen.drain(..).for_each(|place| counts[usize::from(place)] = 0);
        best
    }
}
