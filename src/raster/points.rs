//! From points to blocks: which cell each point falls into, and the values of those that have one.

use super::kernels::{Finder, NOWHERE, Unpack};
use super::layers::SPARE;
use super::{Census, MAX_POINTS, RasterOptions, Reduce, WHAT};
use crate::error::{Error, RasterError, Result};
use crate::isa::{Isa, run};
use crate::view::Strided;
use crate::view::buffer;
use crate::view::{Cast, PointSample};

/// Points that are looked at together: what is known of them stays in the first cache.
pub(super) const BLOCK: usize = 1024;

/// Where points are: rows of x, y and perhaps z.
pub trait Coordinates: Sync {
    /// How many points.
    fn rows(&self) -> usize;
    /// Numbers of a point.
    fn columns(&self) -> usize;
    /// Reads x, y and z (0 where there is none) of the points from `first` on, as many as the slices hold. An instruction set
    /// that the CPU lacks is the plain one.
    ///
    /// # Panics
    /// Where there are not so many points, or only one number of each.
    fn load(&self, isa: Isa, first: usize, xyz: [&mut [f64]; 3]);
}

/// What points carry: a row of values for each.
pub trait Values<T>: Sync {
    /// How many rows.
    fn rows(&self) -> usize;
    /// Values in a row.
    fn channels(&self) -> usize;
    /// Replaces `out` by the values of one channel, of the points `first + position` for all positions.
    fn gather(&self, channel: usize, first: usize, positions: &[u32], out: &mut Vec<T>);
}

impl<P: PointSample> Coordinates for Strided<'_, P> {
    fn rows(&self) -> usize {
        Strided::rows(self)
    }

    fn columns(&self) -> usize {
        Strided::columns(self)
    }

    fn load(&self, isa: Isa, first: usize, [x, y, z]: [&mut [f64]; 3]) {
        let (isa, count) = (isa.or_scalar(), x.len());
        if self.columns() < 3 {
            z.fill(0.0);
            for i in 0..count {
                (x[i], y[i]) = (self.get(first + i, 0).to_f64(), self.get(first + i, 1).to_f64());
            }
        } else if let Some(rows) = self.packed::<4>(first, count) {
            run(isa, Unpack { rows, xyz: [x, y, z] });
        } else if let Some(rows) = self.packed::<3>(first, count) {
            run(isa, Unpack { rows, xyz: [x, y, z] });
        } else if let Some(rows) = self.packed::<5>(first, count) {
            run(isa, Unpack { rows, xyz: [x, y, z] });
        } else {
            for i in 0..count {
                let [a, b, c] = [0, 1, 2].map(|column| self.get(first + i, column).to_f64());
                (x[i], y[i], z[i]) = (a, b, c);
            }
        }
    }
}

impl<T: PointSample, S: Cast<T>> Values<T> for Strided<'_, S> {
    fn rows(&self) -> usize {
        Strided::rows(self)
    }

    fn channels(&self) -> usize {
        self.columns()
    }

    fn gather(&self, channel: usize, first: usize, positions: &[u32], out: &mut Vec<T>) {
        let column = self.column(channel);
        out.clear();
        out.extend(positions.iter().map(|&position| column.get(first + position as usize, 0).cast()));
    }
}

/// The points of a call, and what they carry: z where that is `None`.
pub(super) struct Source<'a, T> {
    pub(super) points: &'a dyn Coordinates,
    pub(super) values: Option<&'a dyn Values<T>>,
}

impl<T: PointSample> Source<'_, T> {
    pub(super) fn channels(&self) -> usize {
        self.values.map_or(1, Values::channels)
    }

    pub(super) fn check(&self, options: &RasterOptions<'_>) -> Result<()> {
        let (count, columns) = (self.points.rows(), self.points.columns());
        let heights = !options.slices.is_empty()
            || options.reduce.contains(&Reduce::Top)
            || (self.values.is_none() && options.reduce.iter().any(|reduce| reduce.needs_values()));
        let expected = if heights { 3 } else { 2 };
        if columns < expected {
            return Err(Error::Raster(RasterError::PointColumns { expected, got: columns }));
        }
        if count > MAX_POINTS {
            return Err(Error::Raster(RasterError::TooManyPoints { got: count, limit: MAX_POINTS }));
        }
        match self.values {
            Some(values) if values.rows() != count || values.channels() == 0 => {
                Err(Error::Raster(RasterError::PointValues {
                    expected: count,
                    got: (values.rows(), values.channels()),
                }))
            }
            _ => Ok(()),
        }
    }
}

/// A block of points: where those are that have a cell, and what they carry.
pub(super) struct Block<T> {
    coordinates: [Vec<f64>; 3],
    /// How many points were read.
    count: usize,
    /// The cells of all of them.
    all_keys: Vec<u32>,
    /// Which points of the block have a cell.
    positions: Vec<u32>,
    /// Their cells.
    pub(super) keys: Vec<u32>,
    /// Their values, channel by channel.
    pub(super) values: Vec<Vec<T>>,
    /// Their heights, if they are wanted.
    pub(super) heights: Vec<f64>,
    wants_heights: bool,
}

impl<T: PointSample> Block<T> {
    /// A block of points with so many values each, of which the heights are kept if they are wanted.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]: there may be any number of channels.
    pub(super) fn new(channels: usize, wants_heights: bool) -> Result<Self> {
        let zeros = || buffer::zeroed(WHAT, BLOCK);
        let mut values = buffer::reserved(WHAT, channels)?;
        for _ in 0..channels {
            values.push(buffer::reserved(WHAT, BLOCK)?);
        }
        Ok(Self {
            coordinates: [zeros()?, zeros()?, zeros()?],
            count: 0,
            all_keys: buffer::filled(WHAT, BLOCK, NOWHERE)?,
            positions: buffer::reserved(WHAT, BLOCK)?,
            keys: buffer::reserved(WHAT, BLOCK)?,
            values,
            heights: buffer::reserved(WHAT, BLOCK)?,
            wants_heights,
        })
    }

    /// Whether points carry their z and nothing else, so that [`Block::found`] says all of them.
    pub(super) fn is_plain(&self, source: &Source<'_, T>) -> bool {
        source.values.is_none() && !self.wants_heights
    }

    /// Finds the cells of `count` points from the `first` on, and returns what became of them.
    pub(super) fn find(
        &mut self,
        source: &Source<'_, T>,
        finder: &Finder,
        isa: Isa,
        first: usize,
        count: usize,
    ) -> Census {
        let [x, y, z] = &mut self.coordinates;
        let (x, y, z) = (&mut x[..count], &mut y[..count], &mut z[..count]);
        source.points.load(isa, first, [x, y, z]);
        self.count = count;
        let (inside, ignored) = finder.keys(isa, [x, y, z], &mut self.all_keys[..count]);
        Census { inside, ignored }
    }

    /// The keys and heights of what the last [`Block::find`] found; keys of points without a cell are among `spare` and the
    /// [`SPARE`] - 1 after it.
    pub(super) fn plain(&mut self, spare: usize) -> (&[u32], &[f64]) {
        let (keys, spare) = (&mut self.all_keys[..self.count], spare as u32);
        for (i, key) in keys.iter_mut().enumerate() {
            let own = spare + (i % SPARE) as u32;
            *key = if *key == NOWHERE { own } else { *key };
        }
        (keys, &self.coordinates[2][..self.count])
    }

    /// What the last [`Block::find`] found: the cell of each point, [`NOWHERE`] where it has none, and its z.
    pub(super) fn found(&self) -> impl Iterator<Item = (u32, f64)> {
        self.all_keys[..self.count].iter().copied().zip(self.coordinates[2].iter().copied())
    }

    /// Reads `count` points from the `first` on, and returns what became of them.
    pub(super) fn read(
        &mut self,
        source: &Source<'_, T>,
        finder: &Finder,
        isa: Isa,
        first: usize,
        count: usize,
    ) -> Census {
        let Census { mut inside, mut ignored } = self.find(source, finder, isa, first, count);
        let (all, z) = (&self.all_keys[..count], &self.coordinates[2][..count]);
        self.keys.clear();
        match source.values {
            None => {
                let values = &mut self.values[0];
                values.clear();
                if inside == count {
                    self.keys.extend_from_slice(all);
                    values.extend(z.iter().map(|&z| T::from_f64(z)));
                } else {
                    self.keys.resize(count, 0);
                    values.resize(count, T::NAN);
                    let mut kept = 0;
                    for (&key, &z) in all.iter().zip(z.iter()) {
                        self.keys[kept] = key;
                        values[kept] = T::from_f64(z);
                        kept += usize::from(key != NOWHERE);
                    }
                    self.keys.truncate(inside);
                    values.truncate(inside);
                }
                if self.wants_heights {
                    self.heights.clear();
                    self.heights.extend(self.values[0].iter().map(|&z| z.to_f64()));
                }
            }
            Some(values) => {
                self.keys.resize(count, 0);
                self.positions.resize(count, 0);
                let mut kept = 0;
                for (position, &key) in all.iter().enumerate() {
                    self.keys[kept] = key;
                    self.positions[kept] = position as u32;
                    kept += usize::from(key != NOWHERE);
                }
                self.keys.truncate(inside);
                self.positions.truncate(inside);
                for (channel, out) in self.values.iter_mut().enumerate() {
                    values.gather(channel, first, &self.positions, out);
                }
                let bad = self.drop_bad_values();
                inside -= bad;
                ignored += bad;
                if self.wants_heights {
                    let z = &self.coordinates[2];
                    self.heights.clear();
                    self.heights.extend(self.positions.iter().map(|&position| z[position as usize]));
                }
            }
        }
        Census { inside, ignored }
    }

    /// Drops the points with a value that is not finite, and returns how many they are.
    fn drop_bad_values(&mut self) -> usize {
        let finite = |value: &T| value.to_f64().is_finite();
        if self.values.iter().all(|channel| channel.iter().all(finite)) {
            return 0;
        }
        let before = self.keys.len();
        let good: Vec<bool> = (0..before).map(|i| self.values.iter().all(|channel| finite(&channel[i]))).collect();
        retain(&mut self.keys, &good);
        retain(&mut self.positions, &good);
        for channel in &mut self.values {
            retain(channel, &good);
        }
        before - self.keys.len()
    }
}

fn retain<E: Copy>(items: &mut Vec<E>, good: &[bool]) {
    let mut good = good.iter();
    items.retain(|_| good.next() == Some(&true));
}
