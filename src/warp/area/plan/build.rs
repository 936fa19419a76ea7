//! Making a plan from a table.

use std::ops::Range;

use super::block_sides::{BATCH, Samples};
use super::column_bounds::ColumnBounds;
use super::coverage::LevelCoverages;
use super::fit_cubic::{BlockFit, Variation, decide};
use super::support::SupportBounds;
use super::{Band, BlockRow, BlockSpan, Plan};
use crate::error::Result;
use crate::isa::Isa;
use crate::lut::footprint::{Coordinates, check_sides};
use crate::parallel::{self, Work};
use crate::table::Table;
use crate::table::block::{LANES, Size};
use crate::view::buffer;

/// What memory is asked for, in errors.
const WHAT: &str = "area";

/// A thread makes the plan of about so many cells at once.
const BAND_CELLS: usize = 1 << 15;

impl Plan {
    /// The plan of a table.
    ///
    /// # Errors
    /// [`LutError::AreaSize`](crate::error::LutError::AreaSize), [`Error::OutOfMemory`] and [`Error::Interrupted`].
    pub(crate) fn new(isa: Isa, table: &Table) -> Result<Self> {
        check_sides(table.source())?;
        let (rows, columns) = (table.rows(), table.columns());
        let band_rows = BAND_CELLS.div_ceil(Size::MOST_ROWS * columns) * Size::MOST_ROWS;
        let mut jobs = buffer::collected(WHAT, (0..rows.div_ceil(band_rows)).map(|_| None))?;
        let threads = Work::table(rows * columns).threads_unasked();
        parallel::for_each(threads, jobs.iter_mut().enumerate(), |(index, job)| {
            let first = index * band_rows;
            *job = Some(Builder::new(isa, table)?.run(first..(first + band_rows).min(rows))?);
            Ok(())
        })?;
        let (mut bands, mut coverage) = (buffer::reserved(WHAT, jobs.len())?, buffer::reserved(WHAT, jobs.len())?);
        for (band, need) in jobs.into_iter().flatten() {
            bands.push(band);
            coverage.push(need);
        }
        Ok(Self { levels: LevelCoverages::merged(coverage)?.levels()?, bands, band_rows, ..Self::default() })
    }
}

/// A part of a plan in the making.
struct Builder<'a> {
    isa: Isa,
    table: &'a Table,
    band: Band,
    coverage: LevelCoverages,
    /// The coordinates of the rows that are decided on, and of those before and after them.
    near: [Coordinates; Size::MOST_ROWS + 2],
    columns_bounds: ColumnBounds,
    samples: Samples,
    fits: BlockFit,
    /// By how much the sides of the last row of blocks change.
    change: Variation,
    /// What the blocks of a row reach, from the `first_seen`-th on, by batches.
    first_seen: usize,
    supports: Vec<SupportBounds>,
}

impl<'a> Builder<'a> {
    fn new(isa: Isa, table: &'a Table) -> Result<Self> {
        let batches = table.columns().div_ceil(Size::FEWEST_COLUMNS).div_ceil(BATCH);
        let mut near = [const { None }; Size::MOST_ROWS + 2];
        for row in &mut near {
            *row = Some(Coordinates::none(table)?);
        }
        Ok(Self {
            isa,
            table,
            band: Band::default(),
            coverage: LevelCoverages::default(),
            near: near.map(|row| row.expect("each was made")),
            columns_bounds: ColumnBounds::new(table.columns())?,
            samples: Samples::default(),
            fits: BlockFit::default(),
            change: Variation::default(),
            first_seen: 0,
            supports: buffer::filled(WHAT, batches, SupportBounds::default())?,
        })
    }

    /// Makes the plan of rows of cells.
    fn run(mut self, rows: Range<usize>) -> Result<(Band, LevelCoverages)> {
        // no page is touched that is not needed
        let most = rows.len().div_ceil(Size::FEWEST_ROWS) * self.table.columns().div_ceil(LANES);
        buffer::room_for(WHAT, &mut self.band.blocks, most)?;
        let (last, next) = (Size::MOST_ROWS, Size::MOST_ROWS + 1);
        self.near[last].read(self.isa, self.table, rows.start.checked_sub(1));
        self.near[next].read(self.isa, self.table, Some(rows.start));
        for first in rows.clone().step_by(Size::MOST_ROWS) {
            // the last two rows around the ones before are the first two around these
            self.near.rotate_left(Size::MOST_ROWS);
            for (near, row) in self.near[2..].iter_mut().zip(first + 1..) {
                near.read(self.isa, self.table, Some(row));
            }
            self.add_rows((rows.end - first).min(Size::MOST_ROWS))?;
        }
        self.coverage.commit(self.table.source().1)?;
        self.band.blocks.shrink_to_fit();
        Ok((self.band, self.coverage))
    }

    /// Appends the blocks of so many rows of cells; they are as large as the sides of their footprints allow.
    fn add_rows(&mut self, rows: usize) -> Result<()> {
        let (mut first, end) = (0, rows.next_multiple_of(Size::FEWEST_ROWS));
        while first < rows {
            let begin = self.band.blocks.len();
            // the smallest blocks always fit
            let is_whole = |size: &Size| first.is_multiple_of(size.rows()) && first + size.rows() <= end;
            for size in Size::ALL.into_iter().filter(is_whole) {
                if !self.change.may_fit(size) {
                    continue;
                }
                self.band.blocks.truncate(begin);
                let (first_block, fits) = self.add_blocks(size, first)?;
                if fits {
                    self.add_row(size, first_block, begin)?;
                    first += size.rows();
                    break;
                }
            }
        }
        Ok(())
    }

    /// Appends the blocks of a row of them, whose first row of cells is the `first`-th. Tells the number of the first that is
    /// there, and whether they need not be smaller.
    fn add_blocks(&mut self, size: Size, first: usize) -> Result<(usize, bool)> {
        let Self { isa, ref near, ref mut columns_bounds, ref mut samples, ref mut fits, .. } = *self;
        let (source, near) = (self.table.source(), &near[first..][..size.rows() + 2]);
        let rows = &near[1..=size.rows()];
        let cells = seen(rows);
        let seen = cells.start / size.columns()..cells.end.div_ceil(size.columns());
        columns_bounds.read(isa, rows, seen.start * size.columns()..seen.end * size.columns());
        let (begin, mut first_block, mut is_plain) = (self.band.blocks.len(), seen.end, true);
        self.change = Variation::default();
        for (first, supports) in seen.clone().step_by(BATCH).zip(&mut self.supports) {
            let count = BATCH.min(seen.end - first);
            is_plain &= samples.read(isa, near, size, first..first + count);
            decide(isa, source, size, samples, fits);
            self.change = self.change.or(fits.change(count));
            supports.read(isa, source, (size, first), fits, count, columns_bounds);
            is_plain &= !supports.are_discontinuous(count);
            for index in 0..count {
                let block = fits.block(index, supports.is_clipped(index));
                if self.band.blocks.len() == begin {
                    if block.is_bilinear() {
                        continue;
                    }
                    first_block = first + index;
                }
                buffer::push(WHAT, &mut self.band.blocks, block)?;
            }
        }
        self.first_seen = seen.start;
        Ok((first_block, self.change.fits(size) && (is_plain || size.rows() == Size::FEWEST_ROWS)))
    }

    /// Makes a row of the blocks from the `begin`-th on, the first of which is the `first_block`-th of it.
    fn add_row(&mut self, size: Size, first_block: usize, begin: usize) -> Result<()> {
        let (_, height) = self.table.source();
        let Band { rows, runs, blocks } = &mut self.band;
        let end = blocks.iter().rposition(|block| !block.is_bilinear()).map_or(0, |last| last + 1);
        blocks.truncate(end.max(begin));
        let begin_runs = runs.len();
        for (index, block) in (first_block..).zip(&blocks[begin..]).filter(|(_, block)| !block.is_bilinear()) {
            let of_row = index - self.first_seen;
            self.coverage.add(block.pattern, height, self.supports[of_row / BATCH].entries(of_row % BATCH))?;
            let run = BlockSpan::of(index, block);
            match runs[begin_runs..].last_mut() {
                Some(last) if last.goes_on(&run) => last.extend(&run),
                _ => buffer::push(WHAT, runs, run)?,
            }
        }
        let row = BlockRow {
            runs: (begin_runs as u32, runs.len() as u32),
            blocks: (begin as u32, blocks.len() as u32),
            first_block: first_block as u32,
            size,
        };
        let count = rows.len() + size.rows() / Size::FEWEST_ROWS;
        buffer::resize(WHAT, rows, count, row)
    }
}

/// From the first cell that one of these rows sees to behind the last one.
fn seen(rows: &[Coordinates]) -> Range<usize> {
    let seen = rows.iter().map(Coordinates::seen).filter(|seen| !seen.is_empty());
    seen.reduce(|all, seen| all.start.min(seen.start)..all.end.max(seen.end)).unwrap_or(0..0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::FRACTION_BITS;
    use crate::lut::footprint::Sides;
    use crate::{BevGrid, Camera, Ground, KannalaBrandt, Lens, Lut, Pinhole, SampleAt};

    /// A camera 1.2 m above the road that looks so far down and to the left, and what it sees of a part of the road.
    fn camera(focal: f64, pitch: f64, yaw: f64) -> Camera {
        let lens = Pinhole::new(focal, focal, 511.0, 255.0, 0.0).expect("a good lens");
        Camera::from_euler(lens, (1024, 512), [1.7, 0.0, 1.2], 0.1, pitch, yaw).expect("a good camera")
    }

    fn table(camera: &Camera, cell: f64) -> Lut {
        let grid = BevGrid::new((0.0, 30.0), (-4.0, 18.0), (cell, cell), SampleAt::Center).expect("a good grid");
        Lut::new(camera, &grid, &Ground::default()).expect("a good table")
    }

    fn plan(lut: &Lut) -> Plan {
        Plan::new(Isa::active().expect("an instruction set"), lut.table()).expect("a plan")
    }

    #[test]
    fn plans_do_not_depend_on_the_instruction_set() {
        let lut = table(&camera(1100.0, 0.05, 0.6), 0.2);
        let plans: Vec<_> = Isa::available().iter().map(|&isa| Plan::new(isa, lut.table()).expect("a plan")).collect();
        let text = format!("{:?}", plans[0]);
        let (levels, runs) = (plans[0].levels.len(), plans[0].bands[0].runs.len());
        assert!(levels > 2 && runs > 50, "{levels} {runs}: too plain a plan to tell");
        assert!(plans.iter().all(|plan| format!("{plan:?}") == text));
    }

    /// Along x the sides of footprints are those of their cells but drawn in, by the same in all rows of a block. A row that
    /// is taken for another one gives itself away by the change from row to row.
    #[test]
    fn every_row_is_the_one_of_its_block_that_it_is() {
        let (mut sizes, mut cells) = (vec![], 0);
        let fisheye: Lens = KannalaBrandt::new(&[0.02, -0.01, 0.003, -0.0005], None).expect("a good lens").into();
        for (camera, cell) in [
            (camera(1100.0, 0.05, 0.0), 0.1),
            (camera(1100.0, 0.05, 0.6), 0.2),
            (camera(300.0, 0.7, 0.0), 0.05),
            (camera(200.0, 1.5, 0.0).with_lens(fisheye), 0.1),
            (camera(200.0, 1.5, 0.0).with_lens(fisheye), 0.25),
            (camera(200.0, 0.9, 0.3).with_lens(fisheye), 0.05),
        ] {
            let lut = table(&camera, cell);
            let (plan, isa, table, mask) =
                (plan(&lut), Isa::active().expect("an isa"), lut.table(), lut.mask().unwrap());
            let mut near = Coordinates::three(isa, table, 0).expect("memory");
            let mut sides = Sides::new(table.columns()).expect("memory");
            let mut drawn_in = vec![];
            for row in 0..table.rows() {
                near[2].read(isa, table, Some(row + 1));
                sides.read(isa, &near);
                near.rotate_left(1);
                let (of_row, of_block) = (plan.row(row), row % plan.band_rows % plan.row(row).size.rows());
                let size = of_row.size;
                assert_eq!(of_row.half_rows, size.half_rows(of_block));
                assert!(of_row.blocks.as_ptr() == plan.row(row - of_block).blocks.as_ptr(), "row {row}, {size:?}");
                if of_block == 0 {
                    sizes.push(size);
                    drawn_in = vec![None; table.columns()];
                }
                // what is known of blocks that are seen in part is a guess
                let rows = (row - of_block).saturating_sub(1)..(row - of_block + size.rows() + 1).min(table.rows());
                for (index, block) in
                    (of_row.first_block..).zip(of_row.blocks).filter(|(_, block)| !block.is_bilinear())
                {
                    let x_along = block.side(0, of_row.half_rows, size.basis());
                    let own = index * size.columns()..((index + 1) * size.columns()).min(table.columns());
                    if !rows.clone().all(|row| mask[row * table.columns()..][own.clone()].iter().all(|&seen| seen)) {
                        continue;
                    }
                    for (cell, x_along) in
                        own.zip(x_along).filter(|&(cell, _)| sides.of(cell)[0].abs() > 3 << FRACTION_BITS)
                    {
                        let scale = f64::from(i32::from(x_along) << block.shift) / f64::from(sides.of(cell)[0]);
                        let expected = *drawn_in[cell].get_or_insert(scale);
                        let off = scale / expected - 1.0;
                        assert!(off.abs() < 0.04, "{size:?}, row {row}, cell {cell}: {scale}, {expected}");
                        cells += 1;
                    }
                }
            }
        }
        assert!(Size::ALL.iter().all(|size| sizes.contains(size)) && cells > 10_000, "{cells}");
    }
}
