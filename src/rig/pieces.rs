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
    /// The cells of the last piece; none at a row's beginning.
    last: Range<usize>,
}

impl Builder {
    pub(super) fn new(columns: usize) -> Self {
        Self { pieces: Pieces { columns, ..Pieces::default() }, ..Self::default() }
    }

    /// Adds cells that one table shows, or none.
    pub(super) fn alone(&mut self, cells: Range<usize>, table: Option<u8>) -> Result<()> {
        self.add(cells, table.as_slice(), |_| &[])
    }

    /// Adds cells from a column on by the weights of some tables in rising order.
    pub(super) fn cells(&mut self, column: usize, tables: &[u8], shares: &Shares) -> Result<()> {
        let mut first = 0;
        for (cells, largest, shown) in shares.alike() {
            let (mut places, mut order, mut count) = ([largest; MAX_CAMERAS], [0; MAX_CAMERAS], 1);
            for place in numbers(shown).filter(|&place| place != largest) {
                (places[count], count) = (place, count + 1);
            }
            order.iter_mut().zip(&places[..count]).for_each(|(order, &place)| *order = tables[usize::from(place)]);
            self.add(column + first..column + first + cells, &order[..count], |nth| {
                &shares.of(places[nth].into())[first..first + cells]
            })?;
            first += cells;
        }
        Ok(())
    }

    /// Makes cells part of the last piece if that is of the same tables, or a piece of their own. `weights` are those of
    /// the cells for the first table and so on; they are asked for where there are several.
    fn add<'a>(&mut self, cells: Range<usize>, tables: &[u8], weights: impl Fn(usize) -> &'a [u16]) -> Result<()> {
        let (count, all) = (tables.len(), &mut self.pieces);
        let before = all.pieces.last().filter(|_| !self.last.is_empty());
        let goes_on = before.is_some_and(|last| all.tables[last.tables.0 as usize..] == *tables);
        if !goes_on {
            let (first, tables_begin) = (cells.start, all.tables.len() as u32);
            let piece = Packed { first: first as u32, tables: (tables_begin, count as u8), weights: all.weights.len() };
            buffer::push(WHAT, &mut all.pieces, piece)?;
            buffer::room_for(WHAT, &mut all.tables, count)?;
            all.tables.extend_from_slice(tables);
            self.last = first..first;
        }
        let had = self.last.len();
        self.last.end = cells.end;
        if count < 2 {
            return Ok(());
        }
        buffer::room_for(WHAT, &mut all.weights, count * cells.len())?;
        let begin = all.weights.len() - count * had;
        for nth in 0..count {
            if had == 0 {
                all.weights.extend_from_slice(weights(nth));
            } else {
                // seldom: where the edge of a camera that has no weight yet cuts a seam in two
                let end = begin + nth * (had + cells.len()) + had;
                all.weights.splice(end..end, weights(nth).iter().copied());
            }
        }
        Ok(())
    }

    pub(super) fn end_row(&mut self) -> Result<()> {
        self.last = 0..0;
        buffer::push(WHAT, &mut self.pieces.ends, self.pieces.pieces.len() as u32)
    }

    /// The pieces of the rows that were ended.
    pub(super) fn finish(self) -> Pieces {
        self.pieces
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::isa::Isa;

    /// The weights of three tables in so many cells from a column on, which depend on the column alone; the first has none
    /// before column 4, and the second none from column 9 on.
    fn shares(column: usize, cells: usize) -> Shares {
        let mut shares = Shares::default();
        shares.begin(3, cells).unwrap();
        for cell in 0..cells {
            let at = (column + cell) as u32;
            shares.raw(0)[cell] = if at < 4 { 0 } else { 900 + at };
            shares.raw(1)[cell] = if at < 9 { 400 } else { 0 };
            shares.raw(2)[cell] = 700;
        }
        shares.settle(Isa::Scalar);
        shares
    }

    /// One row, begun by cells of table 5 alone, of which the others come in lots of these sizes.
    fn row(lots: &[usize]) -> Pieces {
        let mut builder = Builder::new(20);
        builder.alone(0..1, Some(5)).unwrap();
        builder.alone(1..2, Some(5)).unwrap();
        let mut column = 2;
        for &cells in lots {
            builder.cells(column, &[2, 5, 7], &shares(column, cells)).unwrap();
            column += cells;
        }
        builder.alone(column..20, None).unwrap();
        builder.end_row().unwrap();
        builder.finish()
    }

    #[test]
    fn cells_that_come_in_lots_make_the_same_pieces() {
        let whole = row(&[15]);
        let tables: Vec<_> = whole.row(0).map(|piece| (piece.first, piece.tables.to_vec())).collect();
        let expected = [(0, vec![5]), (2, vec![7, 5]), (4, vec![2, 5, 7]), (9, vec![2, 7]), (17, vec![])];
        assert_eq!(tables, expected);
        for piece in whole.row(0).filter(|piece| piece.tables.len() > 1) {
            for cell in 0..piece.cells {
                let weights = (0..piece.tables.len()).map(|place| u32::from(piece.weights_of(place).unwrap()[cell]));
                assert_eq!(weights.sum::<u32>(), ONE, "of cell {} from {}", cell, piece.first);
            }
        }
        for lots in [&[1; 15][..], &[4, 11], &[2, 5, 8], &[7, 7, 1], &[14, 1]] {
            assert_eq!(row(lots), whole, "{lots:?}");
        }
    }
}
