//! What `area` needs beyond the table: how cells that see more than a pixel are averaged. Made from the table alone on
//! first use, so every camera, map and homography is served alike.
//!
//! A footprint is the parallelogram that a cell covers on the source, spanned by the central differences of the table's
//! coordinates. It is averaged by a lattice of `n1 x n2` probes along its two sides, each a bilinear tap into the source
//! or into a *level*: the source averaged over `2^kx x 2^ky` boxes that overlap by half. Which lattice and which
//! level is its [`SamplePattern`], chosen for a [`Block`] of cells at once; see docs/decisions/0013.

mod block_sides;
mod build;
mod choose_samples;
mod column_bounds;
mod coverage;
mod fit_cubic;
mod scratch_pool;
mod support;
mod variance_match;

use std::ops::Range;

use crate::error::Result;
use crate::lut::Derivative;
use crate::table::block::{Block, Size};
use crate::table::pattern::SamplePattern;
use crate::view::buffer;
use coverage::RowIntervals;
use scratch_pool::ScratchPool;
pub(crate) use support::leaves;

/// The plan of an area warp.
#[derive(Debug, Default)]
pub(crate) struct Plan {
    /// The levels that patterns refer to, and which part of each is needed.
    pub(crate) levels: Vec<RipLevel>,
    /// The blocks, in bands of so many rows of cells.
    bands: Vec<Band>,
    band_rows: usize,
    pub(crate) scratch: ScratchPool,
}

/// Rows of blocks whose plan was made at once.
#[derive(Debug, Default)]
struct Band {
    /// The row of blocks of each [`Size::FEWEST_ROWS`] rows of cells; that of higher blocks is there several times.
    rows: Vec<BlockRow>,
    runs: Vec<BlockSpan>,
    blocks: Vec<Block>,
}

/// Where the runs and blocks of a row of blocks are, and the number in its row of the first block that is not bilinear.
#[derive(Debug, Clone, Copy)]
struct BlockRow {
    runs: (u32, u32),
    blocks: (u32, u32),
    first_block: u32,
    size: Size,
}

/// Neighbouring blocks of one pattern, whose sides are known in one unit.
#[derive(Debug, Clone, Copy)]
struct BlockSpan {
    /// The number in its row of the first, and how many; none of them is bilinear.
    first: u32,
    blocks: u32,
    pattern: SamplePattern,
    shift: u8,
    /// Whether any of the blocks is.
    clipped: bool,
}

impl BlockSpan {
    fn of(index: usize, block: &Block) -> Self {
        Self { first: index as u32, blocks: 1, pattern: block.pattern, shift: block.shift, clipped: block.clipped }
    }

    fn goes_on(&self, next: &Self) -> bool {
        self.first + self.blocks == next.first && (self.pattern, self.shift) == (next.pattern, next.shift)
    }

    fn extend(&mut self, next: &Self) {
        self.blocks += next.blocks;
        self.clipped |= next.clipped;
    }
}

/// Neighbouring cells of a row that are averaged by one call of a kernel.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PatternSpan {
    /// Column of the first, and how many.
    pub(crate) first: usize,
    pub(crate) cells: usize,
    pub(crate) pattern: SamplePattern,
    /// As [`Block::shift`].
    pub(crate) shift: u8,
    /// Whether probes may leave the image.
    pub(crate) clipped: bool,
}

/// How the cells of a row are averaged that see more than a pixel.
#[derive(Clone, Copy)]
pub(crate) struct RowPlan<'a> {
    runs: &'a [BlockSpan],
    /// Blocks from the `first_block`-th on: those that runs are of, and what lies between.
    blocks: &'a [Block],
    first_block: usize,
    pub(crate) size: Size,
    /// Half rows from the middle of its blocks to the row.
    pub(crate) half_rows: i16,
}

impl<'a> RowPlan<'a> {
    /// The blocks that the cells of a span are in, and the column of the first one's first cell.
    pub(crate) fn blocks(&self, span: &PatternSpan) -> (&'a [Block], usize) {
        let columns = self.size.columns();
        let (first, end) = (span.first / columns, (span.first + span.cells).div_ceil(columns));
        (&self.blocks[first - self.first_block..end - self.first_block], first * columns)
    }

    /// Appends the spans of neighbouring valid cells, from left to right.
    pub(crate) fn spans(&self, cells: Range<usize>, spans: &mut Vec<PatternSpan>) -> Result<()> {
        let columns = self.size.columns();
        let (first, end) = (cells.start / columns, cells.end.div_ceil(columns));
        let is_before = |run: &BlockSpan| ((run.first + run.blocks) as usize) <= first;
        let runs = &self.runs[self.runs.partition_point(is_before)..];
        for run in runs.iter().take_while(|run| (run.first as usize) < end) {
            let mut add = |blocks: Range<usize>, clipped: bool| -> Result<()> {
                let own = (blocks.start * columns).max(cells.start)..(blocks.end * columns).min(cells.end);
                if own.start < own.end {
                    let &BlockSpan { pattern, shift, .. } = run;
                    let span = PatternSpan { first: own.start, cells: own.len(), pattern, shift, clipped };
                    buffer::push("area", spans, span)?;
                }
                Ok(())
            };
            let blocks = run.first as usize..(run.first + run.blocks) as usize;
            if !run.clipped {
                add(blocks, false)?;
                continue;
            }
            let is_clipped = |block: usize| self.blocks[block - self.first_block].clipped;
            let mut next = blocks.start;
            while next < blocks.end {
                let (first, clipped) = (next, is_clipped(next));
                next = (first..blocks.end).find(|&block| is_clipped(block) != clipped).unwrap_or(blocks.end);
                add(first..next, clipped)?;
            }
        }
        Ok(())
    }
}

/// The source averaged over boxes of `2^kx` columns and `2^ky` rows: entry (column, row) is the box whose top-left pixel
/// is at both shifted left by [`RipLevel::log_step`]. Entries that no probe touches are never made.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct RipLevel {
    pub(crate) kx: u32,
    pub(crate) ky: u32,
    /// The first row that is kept; of the others, as many as `columns` has entries.
    pub(crate) first_row: u32,
    /// The first column that is kept, and how many.
    pub(crate) first_column: u32,
    pub(crate) width: u32,
    /// The columns of each row that probes touch.
    pub(crate) columns: Vec<RowIntervals>,
}

impl RipLevel {
    /// log2 of the source's pixels from a box of `2^k` pixels to the next: boxes overlap by half.
    #[inline(always)]
    pub(crate) fn log_step(k: u32) -> u32 {
        k.saturating_sub(1)
    }

    /// How many boxes of `2^k` pixels there are along a side of the source.
    #[inline(always)]
    pub(crate) fn boxes(side: u32, k: u32) -> u32 {
        ((side - (1 << k)) >> Self::log_step(k)) + 1
    }
}

impl Derivative for Plan {
    fn nbytes(&self) -> usize {
        let of_band = |band: &Band| size_of_val(&*band.rows) + size_of_val(&*band.runs) + size_of_val(&*band.blocks);
        self.bands.iter().map(of_band).sum::<usize>()
            + self.levels.iter().map(|level| size_of_val(&*level.columns)).sum::<usize>()
            + self.scratch.nbytes()
    }
}

impl Plan {
    /// How a row of the table is averaged.
    pub(crate) fn row(&self, row: usize) -> RowPlan<'_> {
        let (band, row) = (&self.bands[row / self.band_rows], row % self.band_rows);
        let BlockRow { runs, blocks, first_block, size } = band.rows[row / Size::FEWEST_ROWS];
        RowPlan {
            runs: &band.runs[runs.0 as usize..runs.1 as usize],
            blocks: &band.blocks[blocks.0 as usize..blocks.1 as usize],
            first_block: first_block as usize,
            size,
            half_rows: size.half_rows(row % size.rows()),
        }
    }
}
