//! Which entries of every level are needed: of each row of the level, which columns.

use std::ops::Range;

use super::{Level, Shape};

#[derive(Default)]
pub(super) struct Needs {
    /// (kx, ky), and for each row of the whole level the columns, an empty range where there are none.
    levels: Vec<(u8, u8, Vec<Range<u32>>)>,
}

impl Needs {
    fn level(&mut self, kx: u8, ky: u8, rows: usize) -> &mut [Range<u32>] {
        let found = self.levels.iter().position(|level| (level.0, level.1) == (kx, ky));
        let index = found.unwrap_or_else(|| {
            self.levels.push((kx, ky, vec![Range { start: u32::MAX, end: 0 }; rows]));
            self.levels.len() - 1
        });
        &mut self.levels[index].2
    }

    /// Adds a rectangle of a level.
    pub(super) fn add(&mut self, shape: Shape, (width, height): (u32, u32), columns: Range<u32>, rows: Range<u32>) {
        if shape.halvings() == 0 {
            return; // the source itself
        }
        let end = columns.end.min(Level::boxes(width, shape.kx.into()));
        let whole = Level::boxes(height, shape.ky.into());
        let level = self.level(shape.kx, shape.ky, whole as usize);
        for row in &mut level[rows.start as usize..rows.end.min(whole) as usize] {
            *row = row.start.min(columns.start)..row.end.max(end);
        }
    }

    pub(super) fn merge(&mut self, other: Self) {
        for (kx, ky, rows) in other.levels {
            for (own, row) in self.level(kx, ky, rows.len()).iter_mut().zip(rows) {
                *own = own.start.min(row.start)..own.end.max(row.end);
            }
        }
    }

    /// The levels, in an order that does not depend on that of the bands.
    pub(super) fn levels(mut self) -> Vec<Level> {
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
