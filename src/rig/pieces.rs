//! Neighbouring cells that the same cameras show.

use std::ops::Range;

use super::region::numbers;
use super::shares::Shares;
use super::{MAX_CAMERAS, WHAT};
use crate::error::Result;
use crate::view::buffer;

/// The weights of a cell sum to this. The largest one of several is below 2^15, so all fit into 16 bits.
pub(super) const ONE: u32 = 1 << 15;

/// The pieces of each row of a grid, from left to right without a gap.
#[derive(Debug, Clone, PartialEq, Default)]
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
    /// Appends the pieces of rows below.
    pub(super) fn append(&mut self, below: &Self) -> Result<()> {
        let (pieces, tables, weights) = (self.pieces.len() as u32, self.tables.len() as u32, self.weights.len());
        self.columns = below.columns;
        buffer::room_for(WHAT, &mut self.ends, below.ends.len())?;
        buffer::room_for(WHAT, &mut self.pieces, below.pieces.len())?;
        buffer::room_for(WHAT, &mut self.tables, below.tables.len())?;
        buffer::room_for(WHAT, &mut self.weights, below.weights.len())?;
        self.ends.extend(below.ends.iter().map(|end| pieces + end));
        self.pieces.extend(below.pieces.iter().map(|piece| {
            let (first, count) = piece.tables;
            Packed { tables: (tables + first, count), weights: weights + piece.weights, ..*piece }
        }));
        self.tables.extend_from_slice(&below.tables);
        self.weights.extend_from_slice(&below.weights);
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

/// Writes [`Pieces`] from left to right and row by row; neighbouring cells that the same tables show become one piece.
#[derive(Default)]
pub(super) struct Builder {
    pieces: Pieces,
    /// The cells of the piece that is not in `pieces` yet.
    open: Range<usize>,
    /// The tables of that piece, the one of the largest weight first, and for each the weights of the piece's cells.
    tables: Vec<u8>,
    weights: Vec<Vec<u16>>,
}

impl Builder {
    pub(super) fn new(columns: usize) -> Self {
        Self { pieces: Pieces { columns, ..Pieces::default() }, ..Self::default() }
    }

    /// Adds cells that one table shows, or none.
    pub(super) fn alone(&mut self, cells: Range<usize>, table: Option<u8>) -> Result<()> {
        self.extend(cells, table.as_slice())
    }

    /// Adds cells from a column on by the weights of some tables in rising order.
    pub(super) fn cells(&mut self, column: usize, tables: &[u8], shares: &Shares) -> Result<()> {
        let mut first = 0;
        for (cells, largest, shown) in shares.alike() {
            let mut places = [0; MAX_CAMERAS];
            let mut count = 1;
            places[0] = largest;
            for place in numbers(shown).filter(|&place| place != largest) {
                (places[count], count) = (place, count + 1);
            }
            let places = &places[..count];
            let mut order = [0; MAX_CAMERAS];
            order.iter_mut().zip(places).for_each(|(order, &place)| *order = tables[usize::from(place)]);
            self.extend(column + first..column + first + cells, &order[..count])?;
            if count > 1 {
                for (own, &place) in self.weights.iter_mut().zip(places) {
                    buffer::room_for(WHAT, own, cells)?;
                    own.extend_from_slice(&shares.of(place.into())[first..first + cells]);
                }
            }
            first += cells;
        }
        Ok(())
    }

    /// Makes cells part of the open piece if that is of the same tables, or of a new one.
    fn extend(&mut self, cells: Range<usize>, tables: &[u8]) -> Result<()> {
        if self.open.is_empty() || self.tables != tables {
            self.close()?;
            self.open.start = cells.start;
            self.tables.clear();
            self.tables.extend_from_slice(tables);
            while self.weights.len() < tables.len() {
                buffer::push(WHAT, &mut self.weights, Vec::new())?;
            }
        }
        self.open.end = cells.end;
        Ok(())
    }

    fn close(&mut self) -> Result<()> {
        if !self.open.is_empty() {
            let (all, count) = (&mut self.pieces, self.tables.len());
            let tables = (all.tables.len() as u32, count as u8);
            buffer::push(
                WHAT,
                &mut all.pieces,
                Packed { first: self.open.start as u32, tables, weights: all.weights.len() },
            )?;
            buffer::room_for(WHAT, &mut all.tables, count)?;
            all.tables.extend_from_slice(&self.tables);
            for weights in &mut self.weights[..count] {
                buffer::room_for(WHAT, &mut all.weights, weights.len())?;
                all.weights.append(weights);
            }
        }
        self.open = 0..0;
        Ok(())
    }

    pub(super) fn end_row(&mut self) -> Result<()> {
        self.close()?;
        buffer::push(WHAT, &mut self.pieces.ends, self.pieces.pieces.len() as u32)
    }

    /// The pieces of the rows that were ended.
    pub(super) fn finish(self) -> Pieces {
        self.pieces
    }
}
