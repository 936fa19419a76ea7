//! Which entries of which levels cells are averaged from, and with what weight: area of floats as a matrix.

use super::footprints::Footprints;
use super::parts_of;
use super::plan::{PatternSpan, Plan};
use super::probes::Lattice;
use crate::error::Result;
use crate::isa::Isa;
use crate::parallel::check_interrupt;
use crate::table::{ONE, Table};
use crate::warp::adjoint::{bilinear, existing, top_left};

/// An entry that a cell is averaged from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Entry {
    /// 0 is the source, others are those of the plan.
    level: usize,
    /// Row and column among those that are kept.
    row: usize,
    column: usize,
}

/// Calls `found` with level, column and row of each entry that a cell is averaged from, with the cell and with the entry's part
/// in it, cell by cell in row-major order.
///
/// # Errors
/// [`Error::OutOfMemory`](crate::Error::OutOfMemory) and [`Error::Interrupted`](crate::Error::Interrupted).
pub(in crate::warp) fn each_look(
    (table, plan, isa): (&Table, &Plan, Isa),
    found: &mut dyn FnMut(usize, [usize; 2], (u32, f64)),
) -> Result<()> {
    let (mut footprints, mut pattern_spans) = (Footprints::new(isa, table)?, vec![]);
    let mut entries = vec![];
    for row in 0..table.rows() {
        check_interrupt()?;
        let row_plan = plan.row(row);
        for span in table.row(row) {
            pattern_spans.clear();
            if span.kind.is_valid() {
                row_plan.spans(span.first..span.first + span.cells, &mut pattern_spans)?;
            }
            if span.taps.is_empty() {
                continue;
            }
            for (part, pattern_span) in parts_of(span, &pattern_spans) {
                if let Some(pattern_span) = pattern_span {
                    footprints.work_out(&row_plan, pattern_span, part, table.source().0);
                }
                for (cell, &tap) in (part.first..).zip(part.taps) {
                    let number = (row * table.columns() + cell) as u32;
                    let count = match pattern_span {
                        Some(pattern_span) => averaged(table, plan, (pattern_span, &footprints), cell, &mut entries),
                        None => {
                            let pixels = bilinear(tap, top_left(part.kind, tap, table.source().0));
                            let entry =
                                |([column, row], weight): ([usize; 2], u32)| (Entry { level: 0, row, column }, weight);
                            entries.extend(existing(pixels, table.source()).map(entry));
                            1
                        }
                    };
                    entries.sort_unstable_by_key(|&(entry, _)| entry);
                    for same in entries.chunk_by(|one, next| one.0 == next.0) {
                        let (Entry { level, row, column }, _) = same[0];
                        // exact: at most 256 products of 2^30
                        let weight: u64 = same.iter().map(|&(_, weight)| u64::from(weight)).sum();
                        let part = weight as f64 / (f64::from(count) * (1u64 << 30) as f64);
                        found(level, [column, row], (number, part));
                    }
                    entries.clear();
                }
            }
        }
    }
    Ok(())
}

/// Adds the entries that a footprint is averaged from, with weights in Q30 of one probe; returns the number of probes.
fn averaged(
    table: &Table,
    plan: &Plan,
    (pattern_span, footprints): (&PatternSpan, &Footprints),
    cell: usize,
    entries: &mut Vec<(Entry, u32)>,
) -> u32 {
    let (width, height) = table.source();
    let pattern = pattern_span.pattern;
    let found = plan.levels.iter().position(|level| (level.kx, level.ky) == (pattern.kx.into(), pattern.ky.into()));
    let (level, first, columns) = found.map_or((0, [0; 2], width), |index| {
        let level = &plan.levels[index];
        (index + 1, [level.first_column, level.first_row], level.width)
    });
    let lattice = Lattice::new(pattern_span, first, columns as usize);
    lattice.each_probe(footprints, cell, [width as i32, height as i32], |[x, y], [right, below], [fx, fy]| {
        let pixels = [
            ([x, y], (ONE - fx) * (ONE - fy)),
            ([right, y], fx * (ONE - fy)),
            ([x, below], (ONE - fx) * fy),
            ([right, below], fx * fy),
        ];
        for ([x, y], weight) in pixels {
            if weight != 0 {
                let entry = Entry { level, row: y - first[1] as usize, column: x - first[0] as usize };
                entries.push((entry, weight));
            }
        }
    })
}
