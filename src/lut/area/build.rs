//! Making a plan from a table.

use std::ops::Range;

use super::block::{Block, LANES, ROWS, Width};
use super::fit::{Fitted, decide};
use super::needs::Needs;
use super::reach::Reaches;
use super::samples::{BATCH, Near, Samples};
use super::{Band, Coordinates, Plan, RowEnd, Run};
use crate::cpu::Isa;
use crate::error::{Error, Result};
use crate::lut::table::Table;
use crate::parallel;

/// Sources may not be longer or higher: coordinates in 1/1024 pixel fit 31 bits.
const MAX_SIDE: u32 = 1 << 20;

/// Plans of fewer cells are made on the caller's thread.
const INLINE_CELLS: usize = 1 << 14;

/// A thread makes the plan of about so many cells at once.
const BAND_CELLS: usize = 1 << 15;

/// Whether coordinates on a source of this size can be told in 1/1024 pixel.
pub(crate) fn check_sides((width, height): (u32, u32)) -> Result<()> {
    if width.max(height) < MAX_SIDE {
        return Ok(());
    }
    Err(Error::AreaSize { width, height, limit: MAX_SIDE - 1 })
}

impl Plan {
    /// The plan of a table.
    ///
    /// # Errors
    /// [`Error::AreaSize`].
    pub(crate) fn new(isa: Isa, table: &Table) -> Result<Self> {
        check_sides(table.source())?;
        let (rows, columns) = (table.rows(), table.columns());
        let block_rows = rows.div_ceil(ROWS);
        let band_rows = BAND_CELLS.div_ceil(ROWS * columns);
        let mut jobs: Vec<_> = (0..block_rows.div_ceil(band_rows)).map(|_| None).collect();
        let threads = if rows * columns < INLINE_CELLS { 1 } else { parallel::num_threads() };
        parallel::for_each(threads, jobs.iter_mut().enumerate(), |(index, job)| {
            let first = index * band_rows;
            *job = Some(Builder::new(isa, table).run(first..(first + band_rows).min(block_rows)));
        });
        let (bands, needs): (Vec<_>, Vec<_>) = jobs.into_iter().flatten().unzip();
        Ok(Self { levels: Needs::merged(needs).levels(), bands, band_rows, ..Self::default() })
    }
}

/// A part of a plan in the making.
struct Builder<'a> {
    isa: Isa,
    table: &'a Table,
    band: Band,
    needs: Needs,
    near: Near,
    samples: Samples,
    fitted: Fitted,
    /// The width of the blocks of a row, these blocks, and what they reach, by batches.
    width: Width,
    blocks: Vec<Block>,
    reaches: Vec<Reaches>,
}

impl<'a> Builder<'a> {
    fn new(isa: Isa, table: &'a Table) -> Self {
        let narrowest = Width::ALL[Width::ALL.len() - 1];
        let blocks = table.columns().div_ceil(narrowest.columns());
        Self {
            isa,
            table,
            band: Band::default(),
            needs: Needs::default(),
            near: std::array::from_fn(|_| Coordinates::none(table)),
            samples: Samples::default(),
            fitted: Fitted::default(),
            width: Width::default(),
            blocks: vec![Block::BILINEAR; blocks],
            reaches: vec![Reaches::default(); blocks.div_ceil(BATCH)],
        }
    }

    /// Makes the plan of rows of blocks.
    fn run(mut self, rows: Range<usize>) -> (Band, Needs) {
        // no page is touched that is not needed
        self.band.blocks.reserve(rows.len() * self.table.columns().div_ceil(LANES));
        let first = rows.start * ROWS;
        let (last, next) = (ROWS, ROWS + 1);
        self.near[last].read(self.isa, self.table, first.checked_sub(1));
        self.near[next].read(self.isa, self.table, Some(first));
        for row in rows {
            // the last two rows around the blocks before are the first two around these
            self.near.rotate_left(ROWS);
            for (near, row) in self.near[2..].iter_mut().zip(row * ROWS + 1..) {
                near.read(self.isa, self.table, Some(row));
            }
            self.decide();
            self.add_row();
        }
        self.needs.flush(self.table.source().1);
        self.band.blocks.shrink_to_fit();
        (self.band, self.needs)
    }

    /// Decides on the blocks of a row; they are as wide as the sides of their footprints allow.
    fn decide(&mut self) {
        let (isa, source) = (self.isa, self.table.source());
        for width in Width::ALL {
            self.width = width;
            let count = self.table.columns().div_ceil(width.columns());
            let batches = self.blocks[..count].chunks_mut(BATCH).zip(&mut self.reaches);
            let mut fits = true;
            for (batch, (blocks, reaches)) in batches.enumerate() {
                let first = batch * BATCH;
                self.samples.read(isa, &self.near, width, first..first + blocks.len());
                fits &= decide(isa, source, &self.samples, &mut self.fitted, blocks);
                let axes = self.near.each_ref().map(Coordinates::axes);
                reaches.read(isa, source, (width, first), &self.fitted, blocks.len(), axes);
            }
            if fits {
                return;
            }
        }
    }

    /// Appends a row of blocks.
    fn add_row(&mut self) {
        let (_, height) = self.table.source();
        let blocks = &self.blocks[..self.table.columns().div_ceil(self.width.columns())];
        let first = blocks.iter().position(|block| !block.is_bilinear()).unwrap_or(0);
        let end = blocks.iter().rposition(|block| !block.is_bilinear()).map_or(0, |last| last + 1);
        let blocks = &mut self.blocks[first..end];
        let begin = self.band.runs.len();
        for (index, block) in (first..).zip(&mut *blocks).filter(|(_, block)| !block.is_bilinear()) {
            let (reaches, of_batch) = (&self.reaches[index / BATCH], index % BATCH);
            block.clipped = reaches.is_clipped(of_batch);
            self.needs.add(block.shape, height, reaches.entries(of_batch));
            let run = Run::of(index, block);
            match self.band.runs[begin..].last_mut() {
                Some(last) if last.goes_on(&run) => last.extend(&run),
                _ => self.band.runs.push(run),
            }
        }
        self.band.blocks.extend_from_slice(blocks);
        self.band.ends.push(RowEnd {
            runs: self.band.runs.len() as u32,
            blocks: self.band.blocks.len() as u32,
            first_block: first as u32,
            width: self.width,
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BevGrid, Camera, Ground, Lut, Pinhole, SampleAt};

    #[test]
    fn plans_do_not_depend_on_the_instruction_set() {
        let lens = Pinhole::new(1100.0, 1100.0, 511.0, 255.0, 0.0).expect("a good lens");
        let camera = Camera::from_euler(lens, (1024, 512), [1.7, 0.0, 1.2], 0.1, 0.05, 0.6).expect("a good camera");
        let grid = BevGrid::new((4.0, 30.0), (-2.0, 18.0), (0.2, 0.2), SampleAt::Center).expect("a good grid");
        let lut = Lut::new(&camera, &grid, &Ground::default()).expect("a good table");
        let plans: Vec<_> = Isa::available().iter().map(|&isa| Plan::new(isa, lut.table()).expect("a plan")).collect();
        let text = format!("{:?}", plans[0]);
        let (levels, runs) = (plans[0].levels.len(), plans[0].bands[0].runs.len());
        assert!(levels > 2 && runs > 50, "{levels} {runs}: too plain a plan to tell");
        assert!(plans.iter().all(|plan| format!("{plan:?}") == text));
    }
}
