//! The footprints of the cells of a row, worked out from its table and plan.

use crate::cpu::Isa;
use crate::lut::area::block::{LANES, Width};
use crate::lut::area::{Block, Coordinates, Piece, RowPlan};
use crate::lut::kernels::for_each_isa;
use crate::lut::table::Table;

/// The footprints of a row, an array for each number, so that loops over them become vectors. Arrays go on so far that
/// vectors may begin at any cell; what was not worked out, and cells without an image, are anything at all.
pub(super) struct Footprints<'a> {
    isa: Isa,
    table: &'a Table,
    at: Coordinates,
    /// Middle, 1/1024 pixel.
    pub(super) centre: [Vec<i32>; 2],
    /// x and y of the side along the output's row, then of the one down its columns, 1/1024 pixel before the piece's shift.
    pub(super) sides: [Vec<i16>; 4],
}

impl<'a> Footprints<'a> {
    pub(super) fn new(isa: Isa, table: &'a Table) -> Self {
        // behind the last footprint there is a block of nothing: loops may begin anywhere and run in whole vectors
        let room = table.columns().next_multiple_of(LANES) + LANES;
        let centre = [vec![0; room], vec![0; room]];
        let sides = [(), (), (), ()].map(|()| vec![0; room]);
        Self { isa, table, at: Coordinates::none(table), centre, sides }
    }

    /// Reads where the cells of a row sample.
    pub(super) fn read(&mut self, row: usize) {
        self.at.read(self.isa, self.table, Some(row));
    }

    /// Where the cells of the row sample from one on: columns and rows, 1/1024 pixel.
    pub(super) fn at(&self, cell: usize) -> [&[i32]; 2] {
        self.at.axes().map(|axis| &axis[1 + cell..])
    }

    /// Works out the arrays for the blocks of a piece of the row that was read.
    pub(super) fn work_out(&mut self, plan: &RowPlan<'_>, piece: &Piece) {
        let (blocks, first) = plan.blocks(piece);
        let at = self.at.axes().map(|axis| &axis[1 + first..]);
        let centre = self.centre.each_mut().map(|axis| &mut axis[first..]);
        let sides = self.sides.each_mut().map(|side| &mut side[first..]);
        work_out(self.isa, blocks, (plan.width, plan.row), at, centre, sides);
    }
}

fn work_out(
    isa: Isa,
    blocks: &[Block],
    (width, row): (Width, usize),
    at: [&[i32]; 2],
    centre: [&mut [i32]; 2],
    sides: [&mut [i16]; 4],
) {
    #[inline(always)]
    fn body(
        blocks: &[Block],
        width: Width,
        row: usize,
        at: [&[i32]; 2],
        centre: [&mut [i32]; 2],
        sides: [&mut [i16]; 4],
    ) {
        let ([ax, ay, bx, by], [x, y]) = (sides, centre);
        for (index, block) in blocks.iter().enumerate() {
            let first = index * width.columns();
            // of narrow blocks the lanes that are too many are written over by the next one's
            [*lanes(ax, first), *lanes(ay, first), *lanes(bx, first), *lanes(by, first)] =
                block.sides(row, width.basis());
            move_by(block.offset[0].into(), &at[0][first..], lanes(x, first));
            move_by(block.offset[1].into(), &at[1][first..], lanes(y, first));
        }
    }
    #[inline(always)]
    fn lanes<T>(row: &mut [T], first: usize) -> &mut [T; LANES] {
        row[first..].first_chunk_mut().expect("rows go on to the end of a vector")
    }
    #[inline(always)]
    fn move_by(offset: i32, from: &[i32], to: &mut [i32; LANES]) {
        for (to, from) in to.iter_mut().zip(from) {
            *to = from.wrapping_add(offset);
        }
    }
    for_each_isa!(isa, (body, body, body)(
        blocks: &[Block],
        width: Width,
        row: usize,
        at: [&[i32]; 2],
        centre: [&mut [i32]; 2],
        sides: [&mut [i16]; 4],
    ));
}
