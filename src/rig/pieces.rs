//! Neighbouring cells that the same cameras show.

use super::WHAT;
use crate::error::Result;
use crate::parallel::check_interrupt;
use crate::view::buffer;

/// The weights of a cell sum to this. The largest one of several is below 2^15, so all fit into 16 bits.
pub(super) const ONE: u32 = 1 << 15;

/// The pieces of each row of a grid, from left to right without a gap.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Pieces {
    columns: usize,
    /// Where each row's pieces end.
    ends: Vec<u32>,
    pieces: Vec<Packed>,
    tables: Vec<u8>,
    /// Of each piece of several tables: the weights of its cells for the first, then for the next.
    weights: Vec<u16>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Packed {
    first: u32,
    /// Where its tables begin, and how many there are.
    tables: (u32, u8),
    weights: usize,
}

/// Neighbouring cells of a row that the same tables show, one of them with the largest weight throughout.
pub(super) struct Piece<'a> {
    pub(super) first: usize,
    pub(super) cells: usize,
    /// The one of the largest weight, then the others; none where nobody sees the cells.
    pub(super) tables: &'a [u8],
    weights: &'a [u16],
}

impl<'a> Piece<'a> {
    /// Writes the weights of the cells for a table, if it is among those that show them.
    pub(super) fn write_weights(&self, table: usize, cells: &mut [u32]) {
        let Some(place) = self.tables.iter().position(|&shown| usize::from(shown) == table) else { return };
        match self.weights_of(place) {
            Some(own) => cells.iter_mut().zip(own).for_each(|(cell, &weight)| *cell = weight.into()),
            None => cells.fill(ONE),
        }
    }

    /// The weights of the cells for the table at this place; `None` where it is the only one.
    pub(super) fn weights_of(&self, place: usize) -> Option<&'a [u16]> {
        (self.tables.len() > 1).then(|| &self.weights[place * self.cells..(place + 1) * self.cells])
    }
}

impl Pieces {
    /// The pieces of weights, one row-major list for each table.
    pub(super) fn new(weights: &[Vec<u16>], rows: usize, columns: usize) -> Result<Self> {
        let mut all = Self {
            columns,
            ends: buffer::reserved(WHAT, rows)?,
            pieces: Vec::new(),
            tables: Vec::new(),
            weights: Vec::new(),
        };
        for row in 0..rows {
            check_interrupt()?;
            let mut before = None;
            let mut first = 0;
            for column in 0..columns {
                let own = showing(weights, row * columns + column);
                if before != Some(own) {
                    if let Some(before) = before {
                        all.push(weights, row * columns, first..column, before)?;
                    }
                    (first, before) = (column, Some(own));
                }
            }
            if let Some(before) = before {
                all.push(weights, row * columns, first..columns, before)?;
            }
            all.ends.push(all.pieces.len() as u32);
        }
        Ok(all)
    }

    fn push(
        &mut self,
        weights: &[Vec<u16>],
        row: usize,
        cells: std::ops::Range<usize>,
        (shown, first): (u64, u8),
    ) -> Result<()> {
        let begin = self.tables.len();
        let others = (0..weights.len() as u8).filter(|&table| table != first && shown >> table & 1 == 1);
        for table in (shown != 0).then_some(first).into_iter().chain(others) {
            buffer::push(WHAT, &mut self.tables, table)?;
        }
        let count = self.tables.len() - begin;
        let piece =
            Packed { first: cells.start as u32, tables: (begin as u32, count as u8), weights: self.weights.len() };
        buffer::push(WHAT, &mut self.pieces, piece)?;
        if count > 1 {
            buffer::room_for(WHAT, &mut self.weights, count * cells.len())?;
            for &table in &self.tables[begin..] {
                self.weights.extend_from_slice(&weights[usize::from(table)][row + cells.start..row + cells.end]);
            }
        }
        Ok(())
    }

    /// The pieces of a row.
    pub(super) fn row(&self, row: usize) -> impl Iterator<Item = Piece<'_>> {
        let begin = if row == 0 { 0 } else { self.ends[row - 1] } as usize;
        let pieces = &self.pieces[begin..self.ends[row] as usize];
        let ends = pieces.iter().skip(1).map(|next| next.first as usize).chain(std::iter::once(self.columns));
        pieces.iter().zip(ends).map(|(piece, end)| {
            let (first, (begin, count)) = (piece.first as usize, piece.tables);
            let (begin, count, cells) = (begin as usize, usize::from(count), end - first);
            let weights = if count > 1 { count * cells } else { 0 };
            Piece {
                first,
                cells,
                tables: &self.tables[begin..begin + count],
                weights: &self.weights[piece.weights..piece.weights + weights],
            }
        })
    }

    pub(super) fn nbytes(&self) -> usize {
        size_of_val(&*self.ends) + size_of_val(&*self.pieces) + size_of_val(&*self.tables) + size_of_val(&*self.weights)
    }
}

/// Which tables show a cell, as bits, and which has the largest weight; of equals the first.
fn showing(weights: &[Vec<u16>], cell: usize) -> (u64, u8) {
    let (mut shown, mut most) = (0, (0, 0));
    for (table, weights) in weights.iter().enumerate().filter(|(_, weights)| weights[cell] > 0) {
        shown |= 1 << table;
        if most.1 < weights[cell] {
            most = (table as u8, weights[cell]);
        }
    }
    (shown, most.0)
}
