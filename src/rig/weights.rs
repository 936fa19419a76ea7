//! How much each camera counts in each cell.

use std::ops::Range;

use super::pieces::{Builder, Pieces};
use super::region::{Columns, Region, Sweep, numbers};
use super::shares::{MOST_RAW, STEP, Shares};
use super::{BlendMode, MAX_CAMERAS, WHAT};
use crate::error::Result;
use crate::grid::BevGrid;
use crate::isa::{Isa, for_each_isa};
use crate::kernels::equal_runs;
use crate::lut::{Lut, Resolution};
use crate::parallel::{self, Work, check_interrupt};
use crate::view::buffer;

/// One camera: its table, the cells that it sees, and its place in the rig.
pub(super) struct View {
    pub(super) lut: Lut,
    pub(super) seen: Region,
    pub(super) priority: usize,
}

/// The pieces of a grid: the tables of the views that see each cell, and their weights where they are several.
///
/// A seam is where the winner changes. The share of each camera's cells in a box of the feather's width goes from 1 to 0
/// across it in a straight line; times the same of what it sees, so that nothing is cut off where its picture ends.
/// Cells that one camera sees alone, which are nine of ten, are not looked at one by one.
pub(super) fn pieces(views: &[View], grid: &BevGrid, blend: BlendMode, feather: f64) -> Result<Pieces> {
    let (rows, columns) = (grid.rows(), grid.columns());
    let (dx, dy) = grid.resolution();
    // a box of 2 r + 1 cells
    let radius = [dx, dy].map(|cell| (feather / (2.0 * cell)).floor().min(1e4) as usize);
    let won = match blend {
        BlendMode::Feather => None,
        BlendMode::Best | BlendMode::Priority => Some(winners(views, (rows, columns), blend)?),
    };
    let pieces = by_bands((rows, columns), |rows_of_band| {
        let mut builder = Builder::new(columns);
        let mut seams = Seams::new(views, won.as_deref(), (rows, columns), radius)?;
        seams.begin(rows_of_band.start)?;
        for row in rows_of_band {
            check_interrupt()?;
            seams.row(row, &mut builder)?;
        }
        Ok(builder.finish())
    })?;
    let mut all = Pieces::default();
    pieces.iter().try_for_each(|pieces| all.append(pieces))?;
    Ok(all)
}

/// What `of` makes of each band of rows, from the top down.
fn by_bands<T: Send>((rows, columns): (usize, usize), of: impl Fn(Range<usize>) -> Result<T> + Sync) -> Result<Vec<T>> {
    let threads = Work::table(2 * rows * columns).threads_unasked();
    // one thread has nobody to share with: it makes all at once, in buffers of its own, and nothing is put together
    let band_rows = if threads == 1 { rows } else { parallel::rows_per_band(rows, columns, threads) };
    let bands = rows.div_ceil(band_rows);
    let mut made: Vec<Option<T>> = buffer::reserved(WHAT, bands)?;
    made.resize_with(bands, || None);
    parallel::for_each(threads, made.iter_mut().enumerate(), |(band, made)| {
        *made = Some(of(band * band_rows..((band + 1) * band_rows).min(rows))?);
        Ok(())
    })?;
    let mut all = buffer::reserved(WHAT, bands)?;
    all.extend(made.into_iter().flatten());
    Ok(all)
}

/// For each view the cells that it wins.
fn winners(views: &[View], shape: (usize, usize), blend: BlendMode) -> Result<Vec<Region>> {
    let bands = by_bands(shape, |rows| {
        let mut won = buffer::filled(WHAT, views.len(), Region::default())?;
        let mut sweep = Sweep::default();
        let mut contest = Contest::new(views, shape.1)?;
        for row in rows {
            check_interrupt()?;
            sweep.row(shape.1, views.iter().map(|view| view.seen.row(row)), |cells, seeing| {
                match (seeing.count_ones(), blend) {
                    (0, _) => Ok(()),
                    (1, _) => won[seeing.trailing_zeros() as usize].push(cells),
                    (_, BlendMode::Best) => contest.row(row, cells, seeing, &mut won),
                    _ => {
                        let first = numbers(seeing).min_by_key(|&view| views[usize::from(view)].priority);
                        first.map_or(Ok(()), |first| won[usize::from(first)].push(cells))
                    }
                }
            })?;
            won.iter_mut().try_for_each(Region::end_row)?;
        }
        Ok(won)
    })?;
    let mut all = buffer::filled(WHAT, views.len(), Region::default())?;
    for band in &bands {
        all.iter_mut().zip(band).try_for_each(|(all, band)| all.append(band))?;
    }
    Ok(all)
}

/// Finds which of several views resolves cells best.
struct Contest<'a> {
    isa: Isa,
    views: &'a [View],
    /// Made when a view first takes part.
    resolutions: Vec<Option<Resolution<'a>>>,
    /// Each cell's resolution by the best view so far; here and below what lies behind the last cell counts for nothing.
    best: Vec<f32>,
    /// Each cell's resolution by the view that is compared with it.
    other: Vec<f32>,
    /// Which view is the best so far.
    winner: Vec<u8>,
}

impl<'a> Contest<'a> {
    fn new(views: &'a [View], columns: usize) -> Result<Self> {
        let mut resolutions = buffer::reserved(WHAT, views.len())?;
        resolutions.resize_with(views.len(), || None);
        Ok(Self {
            isa: Isa::active()?,
            views,
            resolutions,
            best: buffer::zeroed(WHAT, columns + STEP)?,
            other: buffer::zeroed(WHAT, columns + STEP)?,
            winner: buffer::zeroed(WHAT, columns + STEP)?,
        })
    }

    /// Adds each of the cells to what its winner has won; of equals the first wins.
    fn row(&mut self, row: usize, cells: Range<usize>, seeing: u64, won: &mut [Region]) -> Result<()> {
        let (count, worked) = (cells.len(), cells.len().next_multiple_of(STEP));
        for (nth, view) in numbers(seeing).enumerate() {
            let resolution = match &mut self.resolutions[usize::from(view)] {
                Some(resolution) => resolution,
                none => none.insert(Resolution::of(&self.views[usize::from(view)].lut)?),
            };
            if nth == 0 {
                resolution.read(row, cells.clone(), &mut self.best[..worked])?;
                self.winner[..count].fill(view);
                continue;
            }
            resolution.read(row, cells.clone(), &mut self.other[..worked])?;
            compare(self.isa, &self.other[..worked], view, &mut self.best[..worked], &mut self.winner[..worked]);
        }
        let mut first = cells.start;
        for same in equal_runs(&self.winner[..count]) {
            won[usize::from(same[0])].push(first..first + same.len())?;
            first += same.len();
        }
        Ok(())
    }
}

/// Lets a view win the cells that it resolves better than the best so far.
fn compare(isa: Isa, resolution: &[f32], view: u8, best: &mut [f32], winner: &mut [u8]) {
    #[inline(always)]
    fn body(resolution: &[f32], view: u8, best: &mut [f32], winner: &mut [u8]) {
        for ((best, &resolution), winner) in best.iter_mut().zip(resolution).zip(winner) {
            let wins = resolution > *best;
            *best = if wins { resolution } else { *best };
            *winner = if wins { view } else { *winner };
        }
    }
    for_each_isa!(isa, (body, body, body)(resolution: &[f32], view: u8, best: &mut [f32], winner: &mut [u8]));
}

/// Weights row by row: for each view and column, how many cells of the box around it are seen and won. Behind the last
/// column are [`STEP`] more, of which none is.
struct Seams<'a> {
    views: &'a [View],
    won: Option<&'a [Region]>,
    shape: (usize, usize),
    radius: [usize; 2],
    sees: Vec<Vec<u32>>,
    wins: Vec<Vec<u32>>,
    /// Of each column, how many columns its box has.
    of_boxes: Vec<u32>,
    /// Of each column, the place plus 1 of the view that has won all of its box; 0 where none has.
    decided: Vec<u8>,
    sweep: Sweep,
    shares: Shares,
    isa: Isa,
}

impl<'a> Seams<'a> {
    fn new(views: &'a [View], won: Option<&'a [Region]>, shape: (usize, usize), radius: [usize; 2]) -> Result<Self> {
        let columns = |count: usize| {
            let none = buffer::zeroed(WHAT, shape.1 + STEP)?;
            buffer::filled(WHAT, count, none)
        };
        let of_box = |column: usize| {
            let column = column.min(shape.1 - 1);
            ((column + radius[1] + 1).min(shape.1) - column.saturating_sub(radius[1])) as u32
        };
        Ok(Self {
            views,
            won,
            shape,
            radius,
            sees: columns(views.len())?,
            wins: columns(won.map_or(0, <[Region]>::len))?,
            of_boxes: buffer::collected(WHAT, (0..shape.1 + STEP).map(of_box))?,
            decided: buffer::zeroed(WHAT, shape.1)?,
            sweep: Sweep::default(),
            shares: Shares::default(),
            isa: Isa::active()?,
        })
    }

    /// Fills the boxes but for the last row that the one around `row` takes in.
    fn begin(&mut self, row: usize) -> Result<()> {
        let down = self.radius[0];
        for near in row.saturating_sub(down + 1)..(row + down).min(self.shape.0) {
            check_interrupt()?;
            self.count(Some(near), None);
        }
        Ok(())
    }

    /// Adds the cells of a row to the boxes, and takes those of another out again.
    fn count(&mut self, add: Option<usize>, remove: Option<usize>) {
        let (isa, columns, across) = (self.isa, self.shape.1, self.radius[1]);
        let change = |sums: &mut Vec<u32>, region: &Region| {
            let [add, remove] = [add, remove].map(|row| row.map_or(&[][..], |row| region.row(row)));
            for nth in 0..add.len().max(remove.len()) {
                let [add, remove] = [add, remove].map(|ranges| ranges.get(nth).copied().unwrap_or((0, 0)));
                count_near(isa, &mut sums[..columns], add, remove, across);
            }
        };
        self.sees.iter_mut().zip(self.views).for_each(|(sums, view)| change(sums, &view.seen));
        self.wins.iter_mut().zip(self.won.unwrap_or_default()).for_each(|(sums, won)| change(sums, won));
    }

    /// Adds a row's pieces. Rows follow each other from where the boxes were begun.
    fn row(&mut self, row: usize, builder: &mut Builder) -> Result<()> {
        let ((rows, columns), [down, _]) = (self.shape, self.radius);
        self.count((row + down < rows).then_some(row + down), row.checked_sub(down + 1));
        let height = ((row + down + 1).min(rows) - row.saturating_sub(down)) as u32;
        let Self { views, sees, wins, sweep, of_boxes, decided, shares, isa, .. } = self;
        sweep.row(columns, views.iter().map(|view| view.seen.row(row)), |cells, seeing| {
            if seeing.count_ones() < 2 {
                return builder.alone(cells, numbers(seeing).next());
            }
            let (mut tables, mut count) = ([0; MAX_CAMERAS], 0);
            for view in numbers(seeing) {
                (tables[count], count) = (view, count + 1);
            }
            let tables = &tables[..count];
            // away from the seams one view has won, and so sees, all of the box
            let decided = &mut decided[cells.clone()];
            decided.fill(0);
            for (place, won) in
                tables.iter().enumerate().filter_map(|(place, &view)| Some((place, wins.get(usize::from(view))?)))
            {
                decide(*isa, &won[cells.clone()], (&of_boxes[cells.clone()], height), place as u8 + 1, decided);
            }
            let mut first = cells.start;
            for same in equal_runs(decided) {
                let own = first..first + same.len();
                first = own.end;
                if same[0] > 0 {
                    builder.alone(own, Some(tables[usize::from(same[0]) - 1]))?;
                    continue;
                }
                shares.begin(count, own.len())?;
                for (place, &view) in tables.iter().enumerate() {
                    let won = wins.get(usize::from(view)).map_or(&[][..], |won| &won[own.start..]);
                    let (seen, of_boxes) = (&sees[usize::from(view)][own.start..], &of_boxes[own.start..]);
                    raw_weights(*isa, seen, won, (of_boxes, height), shares.raw(place));
                }
                shares.settle(*isa);
                builder.cells(own.start, tables, shares)?;
            }
            Ok(())
        })?;
        builder.end_row()
    }
}

/// Marks the cells whose boxes are won as a whole; a box has so many columns, and rows. No two views win the same.
fn decide(isa: Isa, won: &[u32], (columns, rows): (&[u32], u32), mark: u8, decided: &mut [u8]) {
    #[inline(always)]
    fn body(won: &[u32], columns: &[u32], rows: u32, mark: u8, decided: &mut [u8]) {
        for ((&won, &columns), decided) in won.iter().zip(columns).zip(decided) {
            *decided |= if won == columns * rows { mark } else { 0 };
        }
    }
    for_each_isa!(isa, (body, body, body)(won: &[u32], columns: &[u32], rows: u32, mark: u8, decided: &mut [u8]));
}

/// The weights of a view in as many cells as there are `raw`, by how many of the cells of a cell's box are seen and how many
/// are won; a box has so many columns, and rows. Without `won` all of what is seen counts.
fn raw_weights(isa: Isa, seen: &[u32], won: &[u32], (columns, rows): (&[u32], u32), raw: &mut [u32]) {
    // counts are below 2^31: a box has at most as many cells as the grid
    #[inline(always)]
    fn weight(seen: u32, of_box: f32, share: f32) -> u32 {
        // half of the box is seen at a straight edge, all of it half a feather away
        let ramp = (2.0 * (seen as i32 as f32 / of_box) - 1.0).max(0.0);
        1 + (ramp * share * (MOST_RAW - 1) as f32) as i32 as u32
    }
    #[inline(always)]
    fn body(seen: &[u32], won: &[u32], columns: &[u32], rows: u32, raw: &mut [u32]) {
        let count = raw.len();
        let (seen, columns) = (&seen[..count], &columns[..count]);
        let cells = raw.iter_mut().zip(seen).zip(columns).map(|((raw, &seen), &columns)| (raw, seen, columns * rows));
        if won.is_empty() {
            cells.for_each(|(raw, seen, of_box)| *raw = weight(seen, of_box as i32 as f32, 1.0));
        } else {
            for ((raw, seen, of_box), &won) in cells.zip(&won[..count]) {
                let of_box = of_box as i32 as f32;
                *raw = weight(seen, of_box, won as i32 as f32 / of_box);
            }
        }
    }
    for_each_isa!(
        isa,
        (body, body, body)(seen: &[u32], won: &[u32], columns: &[u32], rows: u32, raw: &mut [u32])
    );
}

/// Adds, for each column, how many of the columns at most `across` away are in one range, and takes away how many are in
/// another; a range may be empty.
///
/// Rows that follow each other have nearly the same ranges, and where a box lies within both nothing changes: only columns
/// near the ends are gone through.
fn count_near(isa: Isa, sums: &mut [u32], add: Columns, remove: Columns, across: usize) {
    let columns = sums.len();
    let near = |one: u32, other: u32| {
        (one.min(other) as usize).saturating_sub(across)..(one.max(other) as usize + across).min(columns)
    };
    let (begin, end) = (near(add.0, remove.0), near(add.1, remove.1));
    let is_empty = |range: Columns| range.0 == range.1;
    if is_empty(add) || is_empty(remove) || begin.end + STEP > end.start {
        let ends = [add, remove].into_iter().filter(|&range| !is_empty(range));
        let (first, last) = ends.fold((u32::MAX, 0), |(first, last), range| (first.min(range.0), last.max(range.1)));
        if first < last {
            change_near(isa, sums, near(first, first).start..near(last, last).end, (add, remove), across);
        }
        return;
    }
    change_near(isa, sums, begin, (add, remove), across);
    change_near(isa, sums, end, (add, remove), across);
}

/// As [`count_near`], for some of the columns and fewer than [`STEP`] behind them, where nothing changes.
fn change_near(isa: Isa, sums: &mut [u32], columns: Range<usize>, ranges: (Columns, Columns), across: usize) {
    #[inline(always)]
    fn body(sums: &mut [u32], columns: Range<usize>, ranges: (Columns, Columns), across: i32) {
        let near = |(first, end): Columns, column: i32| {
            ((end as i32).min(column + across + 1) - (first as i32).max(column - across)).max(0)
        };
        let (add, remove) = ranges;
        for (column, sum) in (columns.start as i32..).zip(&mut sums[columns]) {
            *sum = sum.wrapping_add_signed(near(add, column) - near(remove, column));
        }
    }
    let across = across as i32;
    let columns = columns.start..(columns.start + columns.len().next_multiple_of(STEP)).min(sums.len());
    for_each_isa!(
        isa,
        (body, body, body)(sums: &mut [u32], columns: Range<usize>, ranges: (Columns, Columns), across: i32)
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_count_what_is_near() {
        let columns = 23u32;
        let counted = |range: &Columns, column: usize, across: usize| {
            (range.0 as usize..range.1 as usize).filter(|&cell| cell.abs_diff(column) <= across).count() as u32
        };
        let ranges: Vec<Columns> =
            (0..columns).flat_map(|first| (first..=columns).map(move |end| (first, end))).collect();
        for across in [0, 1, 2, 5, 11, 40] {
            for (nth, &add) in ranges.iter().enumerate() {
                // another one close by, and one from anywhere
                for remove in [ranges[(nth + 1) % ranges.len()], ranges[nth * 31 % ranges.len()]] {
                    let mut sums = vec![100; columns as usize];
                    count_near(Isa::Scalar, &mut sums, add, remove, across);
                    for (column, &sum) in sums.iter().enumerate() {
                        let expected = 100 + counted(&add, column, across) - counted(&remove, column, across);
                        assert_eq!(sum, expected, "{add:?} - {remove:?} by {across} at {column}");
                    }
                }
            }
        }
    }
}
