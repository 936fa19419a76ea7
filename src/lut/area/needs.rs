//! Which entries of every level are needed: of each row of the level, which columns.

use std::ops::Range;

use super::{Level, Shape};

#[derive(Default)]
pub(super) struct Needs {
    /// (kx, ky), and for each row of the whole level the columns, an empty range where there are none.
    levels: Vec<(u8, u8, Vec<Range<u32>>)>,
    /// What was added last: groups side by side mostly look at the same rows.
    last: Option<Rectangle>,
}

/// Entries of the level of a shape.
struct Rectangle {
    shape: Shape,
    columns: Range<u32>,
    rows: Range<u32>,
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

    /// Adds a rectangle of the level of a shape, of a source of this height.
    pub(super) fn add(&mut self, shape: Shape, height: u32, [columns, rows]: [Range<u32>; 2]) {
        if let Some(last) = &mut self.last
            && (last.shape, &last.rows) == (shape, &rows)
        {
            last.columns = united(&last.columns, &columns);
            return;
        }
        self.flush(height);
        self.last = Some(Rectangle { shape, columns, rows });
    }

    /// Takes the last rectangle in; before it, what was added is not complete.
    pub(super) fn flush(&mut self, height: u32) {
        let Some(Rectangle { shape, columns, rows }) = self.last.take() else { return };
        if shape.halvings() == 0 {
            return; // the source itself
        }
        let level = self.level(shape.kx, shape.ky, Level::boxes(height, shape.ky.into()) as usize);
        for row in &mut level[rows.start as usize..rows.end as usize] {
            *row = united(row, &columns);
        }
    }

    /// Adds those of another, both flushed.
    pub(super) fn merge(&mut self, other: Self) {
        for (kx, ky, rows) in other.levels {
            for (own, row) in self.level(kx, ky, rows.len()).iter_mut().zip(rows) {
                *own = united(own, &row);
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

fn united(one: &Range<u32>, other: &Range<u32>) -> Range<u32> {
    one.start.min(other.start)..one.end.max(other.end)
}
