//! Making a plan from a table.

use std::ops::Range;
use std::sync::Mutex;

use super::{Band, Cells, Coordinates, Level, PADDING, Piece, Plan, Q, Shape};
use crate::error::{Error, Result};
use crate::lut::table::{Table, band_rows};
use crate::parallel;

/// So many neighbouring cells get one shape: as many as one vector of footprints has, so that they fill it.
const GROUP: usize = 8;

/// Sources may not be longer or higher: coordinates in 1/1024 pixel fit 31 bits.
const MAX_SIDE: u32 = 1 << 20;

/// Plans of fewer cells are made on the caller's thread.
const INLINE_CELLS: usize = 1 << 13;

impl Plan {
    /// The plan of a table.
    ///
    /// # Errors
    /// [`Error::ImageSize`] where a side of the source has a million pixels or more, [`Error::OutOfMemory`].
    pub(crate) fn new(table: &Table) -> Result<Self> {
        check_sides(table.source())?;
        let (rows, columns) = (table.rows(), table.columns());
        let band_rows = band_rows(columns);
        let mut jobs: Vec<_> = (0..rows.div_ceil(band_rows)).map(|_| Job::default()).collect();
        let threads = if rows * columns < INLINE_CELLS { 1 } else { parallel::num_threads() };
        parallel::for_each(threads, jobs.iter_mut().enumerate(), |(index, job)| {
            let first = index * band_rows;
            job.result = job.run(table, first..(first + band_rows).min(rows));
        });
        let (mut needs, mut bands) = (Needs::default(), Vec::with_capacity(jobs.len()));
        for job in jobs {
            job.result?;
            needs.merge(job.needs);
            bands.push(job.band);
        }
        Ok(Self { levels: needs.levels(), bands, band_rows, pool: Mutex::default() })
    }
}

/// Whether coordinates on a source of this size can be told in 1/1024 pixel.
pub(crate) fn check_sides((width, height): (u32, u32)) -> Result<()> {
    if width.max(height) < MAX_SIDE {
        return Ok(());
    }
    Err(Error::AreaSize { width, height, limit: MAX_SIDE - 1 })
}

/// A band in the making.
struct Job {
    band: Band,
    needs: Needs,
    result: Result<()>,
}

impl Default for Job {
    fn default() -> Self {
        Self { band: Band::default(), needs: Needs::default(), result: Ok(()) }
    }
}

impl Job {
    fn run(&mut self, table: &Table, rows: Range<usize>) -> Result<()> {
        let columns = table.columns();
        let mut near = Coordinates::three(table, rows.start);
        for row in rows {
            near[2].read(table, Some(row + 1));
            reserve(&mut self.band.cells, columns)?;
            let begin = self.band.pieces.len();
            for group in (0..columns).step_by(GROUP) {
                self.group(&near, begin, group..(group + GROUP).min(columns), table.source());
            }
            self.band.ends.push(self.band.pieces.len() as u32);
            near.rotate_left(1);
        }
        reserve(&mut self.band.cells, PADDING)?;
        self.band.cells.pad(PADDING);
        Ok(())
    }

    /// Appends the cells of a group that see more than a pixel; `begin` is the row's first piece.
    fn group(&mut self, near: &[Coordinates; 3], begin: usize, cells: Range<usize>, source: (u32, u32)) {
        let here = &near[1];
        let side = |cell: usize| Coordinates::sides(near, cell);
        let middle = cells.start + cells.len() / 2;
        let valid = cells.clone().filter(|&cell| here.is_valid(cell));
        let Some(typical) = valid.clone().min_by_key(|cell| cell.abs_diff(middle)) else { return };
        let [ax, ay, bx, by] = side(typical);
        let shape = Shape::choose([ax, ay], [bx, by], source);
        if shape == Shape::BILINEAR {
            return;
        }
        let mut sides = [[0; 4]; GROUP];
        let mut largest = 0;
        for cell in valid.clone() {
            sides[cell - cells.start] = side(cell);
            largest = sides[cell - cells.start].iter().fold(largest, |largest, side| largest | side.unsigned_abs());
        }
        let shift = (17 - largest.leading_zeros().min(17)).min(14) as u8;
        let mut reach = Reach::new(shape, shift, source);
        for cell in valid {
            let sides =
                sides[cell - cells.start].map(|side| (side >> shift).clamp(i16::MIN.into(), i16::MAX.into()) as i16);
            let clipped = reach.add([here.xs[cell], here.ys[cell]], sides);
            self.push(begin, cell as u32, shape, shift, clipped);
            let Cells { x, y, along, down } = &mut self.band.cells;
            x.push(here.xs[cell]);
            y.push(here.ys[cell]);
            for (side, array) in sides.into_iter().zip(along.iter_mut().chain(down)) {
                array.push(side);
            }
        }
        self.needs.add(shape, source, reach.columns, reach.rows);
    }

    /// Makes a cell part of the row's last piece, or the first of a new one.
    fn push(&mut self, begin: usize, first: u32, shape: Shape, shift: u8, clipped: bool) {
        let Band { pieces, cells, .. } = &mut self.band;
        if let Some(last) = pieces[begin..].last_mut()
            && (last.shape, last.shift, last.clipped) == (shape, shift, clipped)
            && last.first + last.cells == first
        {
            last.cells += 1;
            return;
        }
        pieces.push(Piece { first, cells: 1, start: cells.x.len() as u32, shape, shift, clipped });
    }
}

/// Which entries of a level the probes of some footprints touch.
struct Reach {
    shape: Shape,
    shift: u8,
    /// How far the outermost probe is along each side, in 1/16384 of it.
    outermost: [i32; 2],
    /// The box's top-left pixel from its middle, in 1/1024 pixel.
    corner: [i32; 2],
    /// The last entry of the level in each direction, in 1/1024 entry.
    last: [i32; 2],
    columns: Range<i32>,
    rows: Range<i32>,
}

impl Reach {
    fn new(shape: Shape, shift: u8, (width, height): (u32, u32)) -> Self {
        let (box_width, box_height) = shape.box_size();
        Self {
            shape,
            shift,
            outermost: [shape.along, shape.down].map(|count| Shape::offset(count - 1, count)),
            corner: [box_width, box_height].map(|size| (size as i32 - 1) << (Q - 1)),
            last: [width - box_width, Level::whole_rows(height, shape.ky.into()) - 1].map(|last| (last as i32) << Q),
            columns: i32::MAX..0,
            rows: i32::MAX..0,
        }
    }

    /// Adds a footprint, and tells whether one of its probes leaves the level.
    fn add(&mut self, centre: [i32; 2], sides: [i16; 4]) -> bool {
        let [ax, ay, bx, by] = sides.map(|side| i32::from(side).abs());
        let far = |a: i32, b: i32| ((a * self.outermost[0] + b * self.outermost[1]) >> (14 - self.shift)) + 1;
        let step = Level::log_row_step(self.shape.ky.into());
        let (far_x, far_y) = (far(ax, bx), far(ay, by));
        let (left, right) = (centre[0] - self.corner[0] - far_x, centre[0] - self.corner[0] + far_x);
        let (top, bottom) =
            ((centre[1] - self.corner[1] - far_y) >> step, (centre[1] - self.corner[1] + far_y) >> step);
        let [last_x, last_y] = self.last;
        let entries = |low: i32, high: i32, last: i32| (low.clamp(0, last) >> Q, (high.clamp(0, last) >> Q) + 2);
        let widen = |range: &mut Range<i32>, (low, high): (i32, i32)| {
            *range = range.start.min(low)..range.end.max(high);
        };
        widen(&mut self.columns, entries(left, right, last_x));
        widen(&mut self.rows, entries(top, bottom, last_y));
        left < 0 || top < 0 || right >= last_x || bottom >= last_y
    }
}

/// Which entries of every level are needed: of each row of the level that is, the columns.
#[derive(Default)]
struct Needs {
    levels: Vec<(u8, u8, Vec<Range<u32>>)>,
}

impl Needs {
    fn level(&mut self, kx: u8, ky: u8, rows: usize) -> &mut [Range<u32>] {
        let found = self.levels.iter().position(|level| (level.0, level.1) == (kx, ky));
        let index = found.unwrap_or_else(|| {
            self.levels.push((kx, ky, vec![u32::MAX..0; rows]));
            self.levels.len() - 1
        });
        &mut self.levels[index].2
    }

    fn add(&mut self, shape: Shape, (width, height): (u32, u32), columns: Range<i32>, rows: Range<i32>) {
        if shape.halvings() == 0 {
            return; // the source itself
        }
        let columns = columns.start as u32..(columns.end as u32).min(width - shape.box_size().0 + 1);
        let whole = Level::whole_rows(height, shape.ky.into()) as usize;
        let level = self.level(shape.kx, shape.ky, whole);
        for row in &mut level[rows.start as usize..(rows.end as usize).min(whole)] {
            *row = row.start.min(columns.start)..row.end.max(columns.end);
        }
    }

    fn merge(&mut self, other: Self) {
        for (kx, ky, rows) in other.levels {
            for (own, row) in self.level(kx, ky, rows.len()).iter_mut().zip(rows) {
                *own = own.start.min(row.start)..own.end.max(row.end);
            }
        }
    }

    /// The levels, in an order that does not depend on that of the bands.
    fn levels(mut self) -> Vec<Level> {
        self.levels.sort_by_key(|level| (level.1, level.0));
        let level = |(kx, ky, rows): (u8, u8, Vec<Range<u32>>)| {
            let needed = |row: &Range<u32>| row.start < row.end;
            let first = rows.iter().position(needed).unwrap_or(0);
            let end = rows.iter().rposition(needed).map_or(first, |last| last + 1);
            let columns = rows[first..end].iter().map(|row| if needed(row) { row.clone() } else { 0..0 }).collect();
            Level { kx: kx.into(), ky: ky.into(), first_row: first as u32, columns }
        };
        self.levels.into_iter().map(level).collect()
    }
}

/// Room for the footprints of another row, or an error instead of an abort.
fn reserve(cells: &mut Cells, columns: usize) -> Result<()> {
    let failed = |_| Error::OutOfMemory { what: "Lut", bytes: columns * 16 };
    let Cells { x, y, along, down } = cells;
    for array in [x, y] {
        array.try_reserve(columns).map_err(failed)?;
    }
    along.iter_mut().chain(down).try_for_each(|array| array.try_reserve(columns).map_err(failed))
}
