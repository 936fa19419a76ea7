//! Which entries of every level are needed: of each row of the level, which columns.

use std::ops::Range;

use super::RipLevel;
use crate::error::Result;
use crate::table::pattern::SamplePattern;
use crate::view::buffer;

#[derive(Default)]
pub(super) struct LevelCoverages {
    levels: Vec<LevelCoverage>,
    /// What was added last: blocks side by side mostly look at the same rows.
    last: Option<Rectangle>,
}

/// What is needed of a level.
struct LevelCoverage {
    kx: u8,
    ky: u8,
    /// Of each row of the whole level.
    columns: Vec<RowIntervals>,
    /// All rows of which something is needed are among these.
    rows: Range<usize>,
}

/// Entries of the level of a pattern.
struct Rectangle {
    pattern: SamplePattern,
    columns: Range<u32>,
    rows: Range<u32>,
}

impl LevelCoverages {
    /// Rows of a level, which has so many.
    fn rows(&mut self, kx: u8, ky: u8, count: usize, rows: Range<usize>) -> Result<&mut [RowIntervals]> {
        let found = self.levels.iter().position(|need| (need.kx, need.ky) == (kx, ky));
        let index = match found {
            Some(index) => index,
            None => {
                let columns = buffer::filled("area", count, RowIntervals::default())?;
                self.levels.push(LevelCoverage { kx, ky, columns, rows: rows.clone() });
                self.levels.len() - 1
            }
        };
        let need = &mut self.levels[index];
        need.rows = need.rows.start.min(rows.start)..need.rows.end.max(rows.end);
        Ok(&mut need.columns[rows])
    }

    /// Adds a rectangle of the level of a pattern, of a source of this height.
    pub(super) fn add(&mut self, pattern: SamplePattern, height: u32, [columns, rows]: [Range<u32>; 2]) -> Result<()> {
        if let Some(last) = &mut self.last
            && (last.pattern, &last.rows) == (pattern, &rows)
            && touch(&last.columns, &columns)
        {
            last.columns = united(&last.columns, &columns);
            return Ok(());
        }
        self.commit(height)?;
        self.last = Some(Rectangle { pattern, columns, rows });
        Ok(())
    }

    /// Takes the last rectangle in; before it, what was added is not complete.
    pub(super) fn commit(&mut self, height: u32) -> Result<()> {
        let Some(Rectangle { pattern, columns, rows }) = self.last.take() else { return Ok(()) };
        if pattern.halvings() == 0 {
            return Ok(()); // the source itself
        }
        let count = RipLevel::boxes(height, pattern.ky.into()) as usize;
        let rows = self.rows(pattern.kx, pattern.ky, count, rows.start as usize..rows.end as usize)?;
        rows.iter_mut().for_each(|row| row.add(&columns));
        Ok(())
    }

    /// The coverage of all bands together, with what each had not committed yet.
    pub(super) fn merged(parts: Vec<Self>) -> Result<Self> {
        let mut parts = parts.into_iter();
        let mut all = parts.next().unwrap_or_default();
        for LevelCoverage { kx, ky, columns, rows } in parts.flat_map(|part| part.levels) {
            let into = all.rows(kx, ky, columns.len(), rows.clone())?;
            for (own, RowIntervals(ranges)) in into.iter_mut().zip(&columns[rows]) {
                ranges.iter().for_each(|range| own.add(range));
            }
        }
        Ok(all)
    }

    /// The levels, in an order that does not depend on that of the bands.
    pub(super) fn levels(mut self) -> Result<Vec<RipLevel>> {
        self.levels.sort_by_key(|need| (need.ky, need.kx));
        let level = |LevelCoverage { kx, ky, columns, rows }: LevelCoverage| {
            let first_row = rows.start as u32;
            let columns = buffer::copied("area", &columns[rows])?;
            let ranges = columns.iter().flat_map(|RowIntervals(ranges)| ranges).filter(|range| !range.is_empty());
            let all = ranges.cloned().reduce(|all, range| united(&all, &range)).unwrap_or(0..1);
            let (kx, ky) = (kx.into(), ky.into());
            Ok(RipLevel { kx, ky, first_row, first_column: all.start, width: all.end - all.start, columns })
        };
        self.levels.into_iter().map(level).collect()
    }
}

/// The columns of a row of a level that probes touch: up to two ranges that do not touch, from left to right, the second
/// or both of them empty.
///
/// A level often serves cells at both sides of a view, and others those between. With one range from the first to the
/// last, half as many entries again were made for cells of 10 cm, 15 % for 20 cm.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(crate) struct RowIntervals(pub(crate) [Range<u32>; 2]);

impl RowIntervals {
    /// Adds a range; what does not fit two ranges is taken into one with the nearest.
    fn add(&mut self, range: &Range<u32>) {
        if is_none(range) {
            return;
        }
        let Self([left, right]) = self;
        if is_none(left) {
            *left = range.clone();
        } else if touch(left, range) {
            *left = united(left, range);
        } else if is_none(right) || touch(right, range) {
            *right = if is_none(right) { range.clone() } else { united(right, range) };
        } else if gap(left, range) <= gap(right, range) {
            *left = united(left, range);
        } else {
            *right = united(right, range);
        }
        if is_none(right) {
            return;
        }
        if touch(left, right) {
            (*left, *right) = (united(left, right), 0..0);
        } else if right.start < left.start {
            std::mem::swap(left, right);
        }
    }
}

fn is_none(range: &Range<u32>) -> bool {
    range.start >= range.end
}

/// Whether ranges overlap, or one begins where the other ends.
fn touch(one: &Range<u32>, other: &Range<u32>) -> bool {
    one.start.max(other.start) <= one.end.min(other.end)
}

/// How many columns there are between ranges that do not touch.
fn gap(one: &Range<u32>, other: &Range<u32>) -> u32 {
    one.start.max(other.start) - one.end.min(other.end)
}

fn united(one: &Range<u32>, other: &Range<u32>) -> Range<u32> {
    one.start.min(other.start)..one.end.max(other.end)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_hold_all_that_was_added_and_are_two_ranges_at_most() {
        let mut state = 1u32;
        let mut next = |below: u32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) % below
        };
        for _ in 0..2000 {
            let (mut columns, mut added) = (RowIntervals::default(), vec![]);
            for _ in 0..next(6) {
                let start = next(60);
                let range = start..start + next(9);
                columns.add(&range);
                added.extend(range);
            }
            let RowIntervals([left, right]) = &columns;
            let holds = |column: &u32| left.contains(column) || right.contains(column);
            assert!(added.iter().all(holds), "{added:?} {columns:?}");
            assert_eq!(is_none(left), added.is_empty());
            assert!(is_none(right) || (!is_none(left) && left.end < right.start), "{columns:?}");
        }
        let mut columns = RowIntervals::default();
        [10..20, 30..40, 42..44].iter().for_each(|range| columns.add(range));
        assert_eq!(columns, RowIntervals([10..20, 30..44]));
    }
}
