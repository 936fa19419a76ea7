//! Several threads: points are sorted by bands of cells, batch by batch, and then each band is one thread's.
//!
//! Within a band the points keep their order, so every cell sees its points in the order in which they came, whatever the
//! threads: the same sums, to the last bit, as block after block on one thread.

use std::sync::{Mutex, MutexGuard, PoisonError};

use super::kernels::{Finder, NOWHERE};
use super::layers::Cells;
use super::points::{BLOCK, Block, Source};
use super::{Census, WHAT};
use crate::view::{PointSample, prefetch};

use super::records::Record;
use crate::error::Result;
use crate::isa::Isa;
use crate::parallel;
use crate::view::buffer;

/// Points that one job sorts: with what is made of them they fit the second cache.
const CHUNK: usize = 8 * BLOCK;

/// Bytes of sorted points at a time.
const BATCH_BYTES: usize = 1 << 26;

/// Most chunks at a time. Few large batches: a band's records come into the cache once in each.
const BATCH_CHUNKS: usize = 512;

/// Most bands: many for each thread, so that they even out where the points crowd in a few rows.
const MAX_BANDS: usize = 32;

/// Points with a cell: their cells, their values channel by channel, their heights if they are wanted.
struct Columns<T> {
    keys: Vec<u32>,
    values: Vec<Vec<T>>,
    heights: Vec<f64>,
}

impl<T: PointSample> Columns<T> {
    fn new(channels: usize) -> Result<Self> {
        let values = buffer::collected(WHAT, (0..channels).map(|_| Vec::new()))?;
        Ok(Self { keys: Vec::new(), values, heights: Vec::new() })
    }
}

/// What a thread needs to sort a chunk.
struct Desk<T> {
    /// The blocks of the chunk.
    blocks: Vec<Block<T>>,
    /// Where each point of a block goes.
    places: Vec<u32>,
}

impl<T: PointSample> Desk<T> {
    fn new(channels: usize, wants_heights: bool) -> Result<Self> {
        let blocks = (0..CHUNK / BLOCK).map(|_| Block::new(channels, wants_heights)).collect::<Result<_>>()?;
        Ok(Self { blocks, places: Vec::new() })
    }
}

/// The points of a chunk that have a cell, by bands, with their cells within the band.
struct Chunk<T> {
    sorted: Columns<T>,
    /// Where each band begins, and where the last one ends.
    starts: [u32; MAX_BANDS + 1],
    census: Census,
}

impl<T: PointSample> Chunk<T> {
    fn new(channels: usize) -> Result<Self> {
        Ok(Self { sorted: Columns::new(channels)?, starts: [0; MAX_BANDS + 1], census: Census::default() })
    }

    /// Reads points `first..end` and sorts them by bands of `1 << shift` cells.
    fn fill(
        &mut self,
        desk: &mut Desk<T>,
        source: &Source<'_, T>,
        finder: &Finder,
        isa: Isa,
        (first, end): (usize, usize),
        shift: u32,
    ) -> Result<()> {
        let Desk { blocks, places } = desk;
        let band_of = |key: u32| (key >> shift) as usize % MAX_BANDS; // there are no more: no bounds to check
        let blocks = &mut blocks[..(end - first).div_ceil(BLOCK)];
        if blocks[0].is_plain(source) {
            return self.fill_plain(blocks, source, finder, isa, (first, end), shift);
        }
        let mut counts = [0u32; MAX_BANDS];
        for (block, first) in blocks.iter_mut().zip((first..end).step_by(BLOCK)) {
            self.census += block.read(source, finder, isa, first, BLOCK.min(end - first));
            for &key in &block.keys {
                counts[band_of(key)] += 1;
            }
        }
        let mut next = [0u32; MAX_BANDS]; // where the next point of each band goes
        for band in 0..MAX_BANDS {
            next[band] = self.starts[band];
            self.starts[band + 1] = next[band] + counts[band];
        }
        let (mask, count) = ((1u32 << shift) - 1, self.starts[MAX_BANDS] as usize);
        let Columns { keys, values, heights } = &mut self.sorted;
        buffer::resize(WHAT, keys, count, 0)?;
        values.iter_mut().try_for_each(|column| buffer::resize(WHAT, column, count, T::NAN))?;
        let keys = &mut keys[..count]; // where they are does not change in the loops
        let wanted = if blocks.iter().all(|block| block.heights.is_empty()) { 0 } else { count };
        buffer::resize(WHAT, heights, wanted, 0.0)?;
        buffer::room_for(WHAT, places, BLOCK)?;
        for block in blocks {
            places.clear();
            for &key in &block.keys {
                let next = &mut next[band_of(key)];
                places.push(*next);
                keys[*next as usize] = key & mask;
                *next += 1;
            }
            for (from, to) in block.values.iter().zip(values.iter_mut()) {
                spread(places, from, to);
            }
            spread(places, &block.heights, heights);
        }
        Ok(())
    }

    /// [`Chunk::fill`] where points carry nothing but z, as in most calls. Points without a cell go to a band of their own,
    /// behind all others, instead of being sorted out first: that took a fifth of the time.
    fn fill_plain(
        &mut self,
        blocks: &mut [Block<T>],
        source: &Source<'_, T>,
        finder: &Finder,
        isa: Isa,
        (first, end): (usize, usize),
        shift: u32,
    ) -> Result<()> {
        const _: () = assert!(NOWHERE == u32::MAX);
        let band_of = |key: u32| ((key >> shift) as usize).min(MAX_BANDS);
        let mut counts = [0u32; MAX_BANDS + 1];
        for (block, first) in blocks.iter_mut().zip((first..end).step_by(BLOCK)) {
            self.census += block.find(source, finder, isa, first, BLOCK.min(end - first));
            block.found().for_each(|(key, _)| counts[band_of(key)] += 1);
        }
        for (band, count) in counts[..MAX_BANDS].iter().enumerate() {
            self.starts[band + 1] = self.starts[band] + count;
        }
        let (mut next, mask, count) = (self.starts, (1u32 << shift) - 1, end - first);
        let Columns { keys, values, .. } = &mut self.sorted;
        buffer::resize(WHAT, keys, count, 0)?;
        buffer::resize(WHAT, &mut values[0], count, T::NAN)?;
        let (keys, values) = (&mut keys[..count], &mut values[0][..count]); // they stay where they are in the loop
        for (key, z) in blocks.iter().flat_map(Block::found) {
            let next = &mut next[band_of(key)];
            keys[*next as usize] = key & mask;
            values[*next as usize] = T::from_f64(z);
            *next += 1;
        }
        Ok(())
    }

    /// Asks for the points of a band, which lie apart from those of the chunk before.
    fn prefetch(&self, band: usize) {
        const KEYS: usize = 64 / size_of::<u32>(); // of a cache line
        let (first, end) = (self.starts[band] as usize, self.starts[band + 1] as usize);
        for index in (first..end).step_by(KEYS) {
            prefetch(&self.sorted.keys, index);
        }
        if let [values] = &self.sorted.values[..] {
            for index in (first..end).step_by(64 / size_of::<T>()) {
                prefetch(values, index);
            }
        }
    }

    /// Adds the points of a band to its cells.
    fn add_to<R: Record<T>>(&self, band: usize, cells: &mut Cells<'_, T, R>) {
        let (first, end) = (self.starts[band] as usize, self.starts[band + 1] as usize);
        let Columns { keys, values, heights } = &self.sorted;
        let heights = heights.get(first..end).unwrap_or_default();
        cells.add::<false>(&keys[first..end], values.iter().map(|channel| &channel[first..end]), heights);
    }
}

/// Puts each item into its place.
fn spread<E: Copy>(places: &[u32], from: &[E], to: &mut [E]) {
    for (&place, &item) in places.iter().zip(from) {
        to[place as usize] = item;
    }
}

/// What threads have done with and others may take up.
struct Shelf<E>(Mutex<Vec<E>>);

impl<E> Shelf<E> {
    fn new() -> Self {
        Self(Mutex::default())
    }

    fn items(&self) -> MutexGuard<'_, Vec<E>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn take(&self) -> Option<E> {
        self.items().pop()
    }

    fn put(&self, item: E) {
        self.items().push(item);
    }
}

/// Batch after batch, on so many threads.
pub(super) fn run<T: PointSample, R: Record<T>>(
    source: &Source<'_, T>,
    finder: &Finder,
    isa: Isa,
    mut cells: Cells<'_, T, R>,
    wants_heights: bool,
    threads: usize,
) -> Result<Census> {
    let (count, channels) = (source.points.rows(), source.channels());
    let shift = cells.len().div_ceil(MAX_BANDS).next_power_of_two().ilog2();
    let bands = cells.len().div_ceil(1 << shift);
    let mut bands: Vec<_> = (0..bands).map(|_| cells.split_off(1 << shift)).collect();

    let point = size_of::<u32>() + if wants_heights { size_of::<f64>() } else { 0 } + channels * size_of::<T>();
    let chunks = (BATCH_BYTES / (CHUNK * point)).clamp(1, BATCH_CHUNKS).min(count.div_ceil(CHUNK));
    let mut chunks = (0..chunks).map(|_| Chunk::new(channels)).collect::<Result<Vec<Chunk<T>>>>()?;
    let batch = chunks.len() * CHUNK;
    let (desks, works) = (Shelf::new(), Shelf::new());
    for first in (0..count).step_by(batch) {
        let end = count.min(first + batch);
        let used = (end - first).div_ceil(CHUNK);
        parallel::for_each(threads, chunks[..used].iter_mut().enumerate(), |(i, chunk)| {
            let mut desk = desks.take().map_or_else(|| Desk::new(channels, wants_heights), Ok)?;
            let first = first + i * CHUNK;
            chunk.fill(&mut desk, source, finder, isa, (first, end.min(first + CHUNK)), shift)?;
            desks.put(desk);
            Ok(())
        })?;
        parallel::for_each(threads, bands.iter_mut().enumerate(), |(i, band)| {
            if first == 0 {
                band.begin(works.take().unwrap_or_default())?;
            }
            for (number, chunk) in chunks[..used].iter().enumerate() {
                if let Some(next) = chunks[..used].get(number + 1) {
                    next.prefetch(i);
                }
                chunk.add_to(i, band);
            }
            if end == count {
                works.put(band.finish(isa));
            }
            Ok(())
        })?;
    }
    Ok(chunks.iter().fold(Census::default(), |sum, chunk| sum + chunk.census))
}
