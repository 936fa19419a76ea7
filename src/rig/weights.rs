//! How much each camera counts in each cell.

use std::ops::Range;

use super::pieces::{Builder, ONE, Pieces};
use super::region::{Columns, Region, Sweep, numbers};
use super::{BlendMode, MAX_CAMERAS, WHAT};
use crate::cpu::{Isa, for_each_isa};
use crate::error::Result;
use crate::grid::BevGrid;
use crate::lut::{Lut, Resolution};
use crate::parallel::{self, Work, check_interrupt};
use crate::view::buffer;

/// Weights of less than this share are left out: a camera that is hardly seen costs as much as another.
const LEAST_SHARE: u64 = 64;

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
    let band_rows = parallel::rows_per_band(rows, columns, threads);
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
    views: &'a [View],
    /// Made when a view first takes part.
    resolutions: Vec<Option<Resolution<'a>>>,
    /// Each cell's resolution by the best view so far.
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
            views,
            resolutions,
            best: buffer::zeroed(WHAT, columns)?,
            other: buffer::zeroed(WHAT, columns)?,
            winner: buffer::zeroed(WHAT, columns)?,
        })
    }

    /// Adds each of the cells to what its winner has won; of equals the first wins.
    fn row(&mut self, row: usize, cells: Range<usize>, seeing: u64, won: &mut [Region]) -> Result<()> {
        let count = cells.len();
        for (nth, view) in numbers(seeing).enumerate() {
            let resolution = match &mut self.resolutions[usize::from(view)] {
                Some(resolution) => resolution,
                none => none.insert(Resolution::of(&self.views[usize::from(view)].lut)?),
            };
            if nth == 0 {
                resolution.read(row, cells.clone(), &mut self.best[..count])?;
                self.winner[..count].fill(view);
                continue;
            }
            resolution.read(row, cells.clone(), &mut self.other[..count])?;
            let cells = self.best.iter_mut().zip(&self.other).zip(&mut self.winner).take(count);
            for ((best, &other), winner) in cells {
                let wins = other > *best;
                *best = if wins { other } else { *best };
                *winner = if wins { view } else { *winner };
            }
        }
        let mut first = cells.start;
        for same in self.winner[..count].chunk_by(|one, next| one == next) {
            won[usize::from(same[0])].push(first..first + same.len())?;
            first += same.len();
        }
        Ok(())
    }
}

/// Weights row by row: for each view and column, how many cells of the box around it are seen and won.
struct Seams<'a> {
    views: &'a [View],
    won: Option<&'a [Region]>,
    shape: (usize, usize),
    radius: [usize; 2],
    sees: Vec<Vec<u32>>,
    wins: Vec<Vec<u32>>,
    /// Of each column, how many columns its box has.
    of_boxes: Vec<u32>,
    sweep: Sweep,
    isa: Isa,
}

impl<'a> Seams<'a> {
    fn new(views: &'a [View], won: Option<&'a [Region]>, shape: (usize, usize), radius: [usize; 2]) -> Result<Self> {
        let columns = |count: usize| {
            let none = buffer::zeroed(WHAT, shape.1)?;
            buffer::filled(WHAT, count, none)
        };
        let of_box = |column: usize| ((column + radius[1] + 1).min(shape.1) - column.saturating_sub(radius[1])) as u32;
        Ok(Self {
            views,
            won,
            shape,
            radius,
            sees: columns(views.len())?,
            wins: columns(won.map_or(0, <[Region]>::len))?,
            of_boxes: buffer::collected(WHAT, (0..shape.1).map(of_box))?,
            sweep: Sweep::default(),
            isa: Isa::active()?,
        })
    }

    /// Fills the boxes but for the last row that the one around `row` takes in.
    fn begin(&mut self, row: usize) -> Result<()> {
        let down = self.radius[0];
        for near in row.saturating_sub(down + 1)..(row + down).min(self.shape.0) {
            check_interrupt()?;
            self.count(near, 1);
        }
        Ok(())
    }

    /// Adds the cells of a row to the boxes, or takes them out again: 1 or -1 times.
    fn count(&mut self, row: usize, times: i32) {
        let across = self.radius[1];
        for (sums, view) in self.sees.iter_mut().zip(self.views) {
            for &cells in view.seen.row(row) {
                count_near(self.isa, sums, cells, across, times);
            }
        }
        for (sums, won) in self.wins.iter_mut().zip(self.won.unwrap_or_default()) {
            for &cells in won.row(row) {
                count_near(self.isa, sums, cells, across, times);
            }
        }
    }

    /// Adds a row's pieces. Rows follow each other from where the boxes were begun.
    fn row(&mut self, row: usize, builder: &mut Builder) -> Result<()> {
        let ((rows, columns), [down, _]) = (self.shape, self.radius);
        if row + down < rows {
            self.count(row + down, 1);
        }
        if row > down {
            self.count(row - down - 1, -1);
        }
        let height = ((row + down + 1).min(rows) - row.saturating_sub(down)) as u32;
        let Self { views, sees, wins, sweep, of_boxes, .. } = self;
        sweep.row(columns, views.iter().map(|view| view.seen.row(row)), |cells, seeing| {
            if seeing.count_ones() < 2 {
                return builder.alone(cells, numbers(seeing).next());
            }
            let (mut tables, mut count) = ([0; MAX_CAMERAS], 0);
            for view in numbers(seeing) {
                (tables[count], count) = (view, count + 1);
            }
            let tables = &tables[..count];
            let (mut raw, mut weights) = ([0; MAX_CAMERAS], [0; MAX_CAMERAS]);
            let mut column = cells.start;
            while column < cells.end {
                // away from the seams one view has won, and so sees, all of the box
                let won_by = |view: u8| {
                    let won = wins.get(usize::from(view)).map_or(&[][..], |wins| &wins[column..cells.end]);
                    let of_boxes = &of_boxes[column..cells.end];
                    won.iter().zip(of_boxes).take_while(|&(&won, &of_box)| won == of_box * height).count()
                };
                if let Some((view, count)) =
                    tables.iter().map(|&view| (view, won_by(view))).find(|&(_, count)| count > 0)
                {
                    builder.alone(column..column + count, Some(view))?;
                    column += count;
                    continue;
                }
                let all = of_boxes[column] * height;
                for (raw, &view) in raw.iter_mut().zip(tables) {
                    let view = usize::from(view);
                    let share = wins.get(view).map_or(1.0, |wins| wins[column] as f32 / all as f32);
                    *raw = raw_weight(sees[view][column], all, share);
                }
                shares(&raw[..count], &mut weights[..count]);
                builder.cell(column, tables, &weights[..count])?;
                column += 1;
            }
            Ok(())
        })?;
        builder.end_row()
    }
}

/// The weight of a view in a cell, by how many of the cells of its box are seen and which share of them is won.
fn raw_weight(seen: u32, of_box: u32, share: f32) -> u32 {
    // half of the box is seen at a straight edge, all of it half a feather away
    let ramp = (2.0 * (seen as f32 / of_box as f32) - 1.0).max(0.0);
    1 + (ramp * share * (1 << 24) as f32) as u32
}

/// Changes, for each column, the number of cells of a box by so many times the neighbouring ones of a row that are at most
/// `across` columns away.
fn count_near(isa: Isa, sums: &mut [u32], (first, end): Columns, across: usize, times: i32) {
    let (first, end, columns) = (first as usize, end as usize, sums.len());
    let near = |column: usize| (end.min(column + across + 1) - first.max(column.saturating_sub(across))) as i32;
    // rising, level, falling: where the box has both its ends inside the cells, or both outside
    let (begin, stop) = (first.saturating_sub(across), (end + across).min(columns));
    let (one, other) = (first + across, (end + across).saturating_sub(2 * across));
    let level = one.min(other).clamp(begin, stop)..one.max(other).clamp(begin, stop);
    for column in (begin..level.start).chain(level.end..stop) {
        sums[column] = sums[column].wrapping_add_signed(times * near(column));
    }
    if !level.is_empty() {
        let change = times * near(level.start);
        add(isa, &mut sums[level], change);
    }
}

fn add(isa: Isa, sums: &mut [u32], change: i32) {
    #[inline(always)]
    fn body(sums: &mut [u32], change: i32) {
        sums.iter_mut().for_each(|sum| *sum = sum.wrapping_add_signed(change));
    }
    for_each_isa!(isa, (body, body, body)(sums: &mut [u32], change: i32));
}

/// Weights of one cell, of sum [`ONE`], in the proportion of others without the smallest; all 0 where they are.
pub(super) fn shares(raw: &[u32], weights: &mut [u16]) {
    let sum: u64 = raw.iter().copied().map(u64::from).sum();
    let counts = |raw: u32| raw > 0 && u64::from(raw) * LEAST_SHARE >= sum;
    let sum: u64 = raw.iter().copied().filter(|&raw| counts(raw)).map(u64::from).sum();
    let (mut left, mut most) = (if sum > 0 { ONE } else { 0 }, 0);
    for (place, &raw) in raw.iter().enumerate() {
        weights[place] = if counts(raw) { (u64::from(raw) * u64::from(ONE) / sum) as u16 } else { 0 };
        left -= u32::from(weights[place]);
        if weights[place] > weights[most] {
            most = place;
        }
    }
    weights[most] += left as u16;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_sum_to_one_and_the_smallest_are_left_out() {
        let mut weights = [7; 3];
        shares(&[1 << 24, 1, 1 << 24], &mut weights);
        assert_eq!(weights, [1 << 14, 0, 1 << 14]);
        shares(&[3, 1, 3], &mut weights);
        assert_eq!(weights.map(u32::from).iter().sum::<u32>(), ONE);
        assert!(
            weights[0] > weights[2] && weights[2] > 2 * weights[1],
            "what is left goes to the largest: {weights:?}"
        );
        shares(&[0, 5, 0], &mut weights);
        assert_eq!(weights, [0, 1 << 15, 0]);
        shares(&[0; 3], &mut weights);
        assert_eq!(weights, [0; 3]);
    }

    #[test]
    fn boxes_count_what_is_near() {
        let columns = 23u32;
        for across in [0, 1, 2, 5, 11, 40] {
            for (first, end) in (0..columns).flat_map(|first| (first + 1..=columns).map(move |end| (first, end))) {
                let mut sums = vec![100; columns as usize];
                count_near(Isa::Scalar, &mut sums, (first, end), across, 1);
                for (column, &sum) in sums.iter().enumerate() {
                    let near = (first as usize..end as usize).filter(|&cell| cell.abs_diff(column) <= across).count();
                    assert_eq!(sum, 100 + near as u32, "{first}..{end} by {across} at {column}");
                }
                count_near(Isa::Scalar, &mut sums, (first, end), across, -1);
                assert_eq!(sums, vec![100; columns as usize]);
            }
        }
    }
}
