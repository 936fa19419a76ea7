//! What `area` needs beyond the table: for cells that see more than a pixel, how large their footprint is and how it is
//! averaged. Made from the table alone on first use, so every camera, map and homography is served alike.
//!
//! A footprint is the parallelogram that a cell covers on the source, spanned by the central differences of the table's
//! coordinates. It is averaged by a lattice of `n1 x n2` probes along its two sides, each a bilinear tap into the source
//! or into a *level*: the source averaged over `2^kx x 2^ky` boxes that overlap by half. Which lattice and which
//! level is its [`Shape`], chosen for eight cells at once; see docs/decisions/0013.

mod build;
mod needs;
mod reach;
mod rows;
mod shape;
mod stretch;

use std::fmt;
use std::ops::Range;
use std::sync::{Arc, Mutex, OnceLock};

pub(crate) use build::check_sides;
pub(crate) use rows::{Coordinates, Sides};
pub(crate) use shape::Shape;

/// Coordinates and footprints are in 1/1024 pixel.
pub(crate) const Q: u32 = 10;

/// The plan of an area warp.
#[derive(Debug)]
pub(crate) struct Plan {
    /// The levels that shapes refer to, and which part of each is needed.
    pub(crate) levels: Vec<Level>,
    /// What the rows of the table have, in bands of [`Plan::band_rows`].
    pub(crate) bands: Vec<Band>,
    pub(crate) band_rows: usize,
    /// Room for levels that a warp has given back.
    pub(crate) pool: Mutex<Vec<Vec<u64>>>,
}

/// Neighbouring cells of a row that are averaged alike.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Piece {
    /// Column of the first.
    pub(crate) first: u32,
    pub(crate) cells: u32,
    /// Index of the first one's footprint in the band.
    pub(crate) start: u32,
    pub(crate) shape: Shape,
    /// The footprints are these numbers shifted left by so many bits.
    pub(crate) shift: u8,
    /// Whether probes may leave the image.
    pub(crate) clipped: bool,
}

/// The pieces of neighbouring rows, and the footprints of their cells.
#[derive(Debug, Default)]
pub(crate) struct Band {
    /// Where the pieces of each row end.
    pub(crate) ends: Vec<u32>,
    pub(crate) pieces: Vec<Piece>,
    pub(crate) cells: Cells,
}

/// Footprints, an array for each number, so that a loop over them becomes vectors.
#[derive(Debug, Default)]
pub(crate) struct Cells {
    /// Centre, 1/1024 pixel.
    pub(crate) x: Vec<i32>,
    pub(crate) y: Vec<i32>,
    /// The footprint's sides, along the row of the output and down its columns: (x, y) of each, 1/1024 pixel before the
    /// piece's shift.
    pub(crate) along: [Vec<i16>; 2],
    pub(crate) down: [Vec<i16>; 2],
}

/// Behind the last footprint of a band there are so many of nothing: loops over footprints may run in whole vectors.
pub(crate) const PADDING: usize = 16;

/// The source averaged over boxes of `2^kx` columns and `2^ky` rows: entry (column, row) is the box whose top-left pixel
/// is at both shifted left by [`Level::log_step`]. Entries that no probe touches are never made.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Level {
    pub(crate) kx: u32,
    pub(crate) ky: u32,
    /// The first row that is kept; of the others, as many as `columns` has entries.
    pub(crate) first_row: u32,
    /// The columns of each row that probes touch.
    pub(crate) columns: Vec<Range<u32>>,
}

impl Level {
    /// log2 of the source's pixels from a box of `2^k` pixels to the next: boxes overlap by half.
    pub(crate) fn log_step(k: u32) -> u32 {
        k.saturating_sub(1)
    }

    /// How many boxes of `2^k` pixels there are along a side of the source.
    pub(crate) fn boxes(side: u32, k: u32) -> u32 {
        ((side - (1 << k)) >> Self::log_step(k)) + 1
    }
}

impl Plan {
    /// Bytes that it holds.
    pub(crate) fn nbytes(&self) -> usize {
        let band = |band: &Band| {
            let Cells { x, y, along, down } = &band.cells;
            size_of_val(&*band.ends)
                + size_of_val(&*band.pieces)
                + [x, y].map(|column| size_of_val(&**column)).iter().sum::<usize>()
                + along.iter().chain(down).map(|column| size_of_val(&**column)).sum::<usize>()
        };
        let pooled = self.pool.try_lock().map_or(0, |pool| pool.iter().map(|room| 8 * room.capacity()).sum());
        self.bands.iter().map(band).sum::<usize>()
            + self.levels.iter().map(|level| size_of_val(&*level.columns)).sum::<usize>()
            + pooled
    }

    /// The pieces of a row of the table, from left to right, and the footprints that they refer to.
    pub(crate) fn row(&self, row: usize) -> (&[Piece], &Cells) {
        let (band, row) = (&self.bands[row / self.band_rows], row % self.band_rows);
        let begin = if row == 0 { 0 } else { band.ends[row - 1] };
        (&band.pieces[begin as usize..band.ends[row] as usize], &band.cells)
    }
}

/// A plan that may not have been made yet. It is no part of what a table is: tables are equal whether they have one.
#[derive(Clone, Default)]
pub(crate) struct LazyPlan(OnceLock<Arc<Plan>>);

impl LazyPlan {
    pub(crate) fn get(&self) -> Option<&Plan> {
        self.0.get().map(|plan| &**plan)
    }

    /// The plan that there is now: this one, or one that another thread made meanwhile.
    pub(crate) fn set(&self, plan: Plan) -> &Plan {
        // not `get_or_init`, which would make a child wait for ever that is forked while another thread builds
        self.0.set(Arc::new(plan)).ok();
        self.get().expect("set by us or by another")
    }
}

impl PartialEq for LazyPlan {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl fmt::Debug for LazyPlan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.get().is_some() { "LazyPlan(made)" } else { "LazyPlan" })
    }
}
