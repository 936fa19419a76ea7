//! How much each camera counts in each cell.

use super::{BlendMode, WHAT, threads_for};
use crate::error::Result;
use crate::grid::BevGrid;
use crate::parallel::{self, check_interrupt};
use crate::rig::pieces::ONE;
use crate::view::buffer;

/// What one camera sees of the grid, row-major.
pub(super) struct View {
    /// Whether it sees the cell.
    pub(super) seen: Vec<bool>,
    /// Source pixels a cell in the direction in which there are fewest; NaN where it sees none.
    pub(super) resolution: Vec<f32>,
    /// The smaller, the more it counts where that is asked for.
    pub(super) priority: usize,
}

/// Weights of less than this share are left out: a camera that is hardly seen costs as much as another.
const LEAST_SHARE: u64 = 64;

/// The weight of each view in each cell, in 1/[`ONE`]: they sum to `ONE` where any sees it, and are 0 elsewhere.
///
/// A seam is where the winner changes. The share of each camera's cells in a box of the feather's width goes from 1 to 0
/// across it in a straight line; times the same of what it sees, so that nothing is cut off where its picture ends.
pub(super) fn of(views: &[View], grid: &BevGrid, blend: BlendMode, feather: f64) -> Result<Vec<Vec<u16>>> {
    let shape = (grid.rows(), grid.columns());
    let (dx, dy) = grid.resolution();
    // a box of 2 r + 1 cells
    let radius = [dx, dy].map(|cell| (feather / (2.0 * cell)).floor().min(1e4) as usize);
    let winner = match blend {
        BlendMode::Feather => None,
        BlendMode::Best | BlendMode::Priority => Some(winners(views, blend)?),
    };
    let mut raw = buffer::reserved(WHAT, views.len())?;
    for _ in views {
        raw.push(buffer::zeroed::<u32>(WHAT, shape.0 * shape.1)?);
    }
    let jobs = raw.iter_mut().zip(views).enumerate();
    parallel::for_each(threads_for(shape.0 * shape.1), jobs, |(index, (raw, view))| {
        let sees = soft(|cell| view.seen[cell], shape, radius)?;
        let wins = winner.as_ref().map(|winner| soft(|cell| usize::from(winner[cell]) == index, shape, radius));
        let wins = wins.transpose()?;
        for (cell, raw) in raw.iter_mut().enumerate().filter(|&(cell, _)| view.seen[cell]) {
            // half of the box is seen at a straight edge, all of it half a feather away
            let ramp = (2.0 * sees[cell] - 1.0).max(0.0);
            let share = wins.as_ref().map_or(1.0, |wins| wins[cell]);
            *raw = 1 + (ramp * share * (1 << 24) as f32) as u32;
        }
        Ok(())
    })?;
    shares(&raw, shape.0 * shape.1)
}

/// The view that shows each cell, or 255.
fn winners(views: &[View], blend: BlendMode) -> Result<Vec<u8>> {
    let cells = views[0].seen.len();
    let mut winner = buffer::filled(WHAT, cells, u8::MAX)?;
    for (cell, winner) in winner.iter_mut().enumerate() {
        let seeing = views.iter().enumerate().filter(|(_, view)| view.seen[cell]);
        let best = match blend {
            BlendMode::Priority => seeing.min_by_key(|(_, view)| view.priority),
            _ => seeing.reduce(|best, other| match other.1.resolution[cell] > best.1.resolution[cell] {
                true => other,
                false => best, // of equals the first
            }),
        };
        if let Some((index, _)) = best {
            *winner = index as u8;
        }
    }
    Ok(winner)
}

/// Which share of a box around each cell, as far as it is on the grid, `inside` is true of.
fn soft(
    inside: impl Fn(usize) -> bool,
    (rows, columns): (usize, usize),
    [down, across]: [usize; 2],
) -> Result<Vec<f32>> {
    let mut share = buffer::filled(WHAT, rows * columns, 0.0)?;
    // how many cells of each row's stretch are inside, then the sums of these over the box's rows, as it moves down
    let mut along: Vec<u32> = buffer::zeroed(WHAT, rows * columns)?;
    for (row, counts) in along.chunks_mut(columns).enumerate() {
        check_interrupt()?;
        let at = |column: usize| u32::from(inside(row * columns + column));
        let mut count: u32 = (0..across.min(columns)).map(at).sum();
        for (column, sum) in counts.iter_mut().enumerate() {
            if column + across < columns {
                count += at(column + across);
            }
            if column > across {
                count -= at(column - across - 1);
            }
            *sum = count;
        }
    }
    let row = |row: usize| &along[row * columns..(row + 1) * columns];
    let mut sums: Vec<u32> = buffer::zeroed(WHAT, columns)?;
    let add = |sums: &mut [u32], counts: &[u32]| sums.iter_mut().zip(counts).for_each(|(sum, count)| *sum += count);
    for first in 0..down.min(rows) {
        add(&mut sums, row(first));
    }
    for (at, shares) in share.chunks_mut(columns).enumerate() {
        check_interrupt()?;
        if at + down < rows {
            add(&mut sums, row(at + down));
        }
        if at > down {
            sums.iter_mut().zip(row(at - down - 1)).for_each(|(sum, count)| *sum -= count);
        }
        let height = (at + down + 1).min(rows) - at.saturating_sub(down);
        for (column, (share, &sum)) in shares.iter_mut().zip(&sums).enumerate() {
            let width = (column + across + 1).min(columns) - column.saturating_sub(across);
            *share = sum as f32 / (height * width) as f32;
        }
    }
    Ok(share)
}

/// Weights of sum [`ONE`] in the proportion of others, without the smallest.
pub(super) fn shares(raw: &[Vec<u32>], cells: usize) -> Result<Vec<Vec<u16>>> {
    let mut weights = buffer::reserved(WHAT, raw.len())?;
    for _ in raw {
        weights.push(buffer::zeroed::<u16>(WHAT, cells)?);
    }
    for cell in 0..cells {
        let sum: u64 = raw.iter().map(|raw| u64::from(raw[cell])).sum();
        let counts = |raw: &Vec<u32>| u64::from(raw[cell]) * LEAST_SHARE >= sum && raw[cell] > 0;
        let sum: u64 = raw.iter().filter(|raw| counts(raw)).map(|raw| u64::from(raw[cell])).sum();
        let (mut left, mut most) = (u64::from(ONE), 0);
        for (index, raw) in raw.iter().enumerate().filter(|(_, raw)| counts(raw)) {
            let weight = u64::from(raw[cell]) * u64::from(ONE) / sum;
            weights[index][cell] = weight as u16;
            left -= weight;
            if weights[index][cell] > weights[most][cell] {
                most = index;
            }
        }
        if sum > 0 {
            weights[most][cell] += left as u16;
        }
    }
    Ok(weights)
}
