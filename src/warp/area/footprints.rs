//! The footprints of cells, worked out from their taps and plan.

use super::plan::{PatternSpan, RowPlan};
use crate::error::Result;
use crate::isa::Isa;
use crate::isa::for_each_isa;
use crate::lut::footprint::Coordinates;
use crate::table::block::Block;
use crate::table::block::{LANES, Size};
use crate::table::{Edges, Span, Table};
use crate::view::buffer;

/// Footprints of neighbouring cells, an array for each number with an entry for each cell of the row, so that loops over
/// them become vectors. Arrays go on so far that vectors may begin at any cell; of cells that were not worked out the numbers
/// are anything at all.
pub(super) struct Footprints {
    isa: Isa,
    at: Coordinates,
    /// Middle, 1/1024 pixel.
    pub(super) centre: [Vec<i32>; 2],
    /// x and y of the side along the output's row, then of the one down its columns, 1/1024 pixel before the span's shift.
    pub(super) sides: [Vec<i16>; 4],
}

impl Footprints {
    pub(super) fn new(isa: Isa, table: &Table) -> Result<Self> {
        let room = table.columns().next_multiple_of(LANES) + LANES;
        let centre = [buffer::zeroed("area", room)?, buffer::zeroed("area", room)?];
        let side = || buffer::zeroed("area", room);
        let sides = [side()?, side()?, side()?, side()?];
        Ok(Self { isa, at: Coordinates::none(table)?, centre, sides })
    }

    /// Works out the footprints of a span, whose cells are these, on a source of this width.
    pub(super) fn work_out(&mut self, plan: &RowPlan<'_>, pattern_span: &PatternSpan, cells: Span<'_>, width: u32) {
        // all of them have footprints, which are where the map of the grid has them
        self.at.read_cells(self.isa, cells, width, Edges::default());
        let (blocks, first) = plan.blocks(pattern_span);
        let at = self.at.axes().map(|axis| &axis[1 + first..]);
        let centre = self.centre.each_mut().map(|axis| &mut axis[first..]);
        let sides = self.sides.each_mut().map(|side| &mut side[first..]);
        work_out(self.isa, blocks, (plan.size, plan.half_rows), at, centre, sides);
    }
}

fn work_out(
    isa: Isa,
    blocks: &[Block],
    (size, half_rows): (Size, i16),
    at: [&[i32]; 2],
    centre: [&mut [i32]; 2],
    sides: [&mut [i16]; 4],
) {
    #[inline(always)]
    fn body(
        blocks: &[Block],
        size: Size,
        half_rows: i16,
        at: [&[i32]; 2],
        centre: [&mut [i32]; 2],
        sides: [&mut [i16]; 4],
    ) {
        let ([ax, ay, bx, by], [x, y]) = (sides, centre);
        for (index, block) in blocks.iter().enumerate() {
            let first = index * size.columns();
            // Of narrow blocks the lanes that are too many are written over by the next one's. A side with one probe is not
            // looked at: more than half of the cells of 10 cm have but one.
            let basis = size.basis();
            if block.pattern.along > 1 {
                *lanes(ax, first) = block.side(0, half_rows, basis);
                *lanes(ay, first) = block.side(1, half_rows, basis);
            }
            if block.pattern.down > 1 {
                *lanes(bx, first) = block.side(2, half_rows, basis);
                *lanes(by, first) = block.side(3, half_rows, basis);
            }
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
        size: Size,
        half_rows: i16,
        at: [&[i32]; 2],
        centre: [&mut [i32]; 2],
        sides: [&mut [i16]; 4],
    ));
}
