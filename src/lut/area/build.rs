//! Making a plan from a table.

use std::ops::Range;
use std::sync::Mutex;

use super::needs::Needs;
use super::reach::{Lattice, Reach};
use super::rows::{Coordinates, Sides, centroids};
use super::stretch::Stretch;
use super::{Band, Cells, PADDING, Piece, Plan, Shape};
use crate::cpu::Isa;
use crate::error::{Error, Result};
use crate::lut::table::{Table, band_rows};
use crate::parallel;

/// So many neighbouring cells get one shape.
const GROUP: usize = 16;

/// Sources may not be longer or higher: coordinates in 1/1024 pixel fit 31 bits.
const MAX_SIDE: u32 = 1 << 20;

/// Plans of fewer cells are made on the caller's thread.
const INLINE_CELLS: usize = 1 << 14;

/// Whether coordinates on a source of this size can be told in 1/1024 pixel.
pub(crate) fn check_sides((width, height): (u32, u32)) -> Result<()> {
    if width.max(height) < MAX_SIDE {
        return Ok(());
    }
    Err(Error::AreaSize { width, height, limit: MAX_SIDE - 1 })
}

impl Plan {
    /// The plan of a table.
    ///
    /// # Errors
    /// [`Error::AreaSize`], [`Error::OutOfMemory`].
    pub(crate) fn new(isa: Isa, table: &Table) -> Result<Self> {
        check_sides(table.source())?;
        let (rows, columns) = (table.rows(), table.columns());
        let band_rows = band_rows(columns);
        let mut jobs: Vec<_> = (0..rows.div_ceil(band_rows)).map(|_| None).collect();
        let threads = if rows * columns < INLINE_CELLS { 1 } else { parallel::num_threads() };
        parallel::for_each(threads, jobs.iter_mut().enumerate(), |(index, job)| {
            let first = index * band_rows;
            let mut builder = Builder::new(isa, table);
            *job = Some(builder.run(first..(first + band_rows).min(rows)).map(|()| (builder.band, builder.needs)));
        });
        let (mut needs, mut bands) = (Needs::default(), Vec::with_capacity(jobs.len()));
        for job in jobs.into_iter().flatten() {
            let (band, own) = job?;
            needs.merge(own);
            bands.push(band);
        }
        Ok(Self { levels: needs.levels(), bands, band_rows, pool: Mutex::default() })
    }
}

/// A band in the making.
struct Builder<'a> {
    isa: Isa,
    table: &'a Table,
    band: Band,
    needs: Needs,
    centres: [Vec<i32>; 2],
    sides: Sides,
    shapes: Vec<Shape>,
    stretches: Vec<Stretch>,
    reach: Reach,
}

impl<'a> Builder<'a> {
    fn new(isa: Isa, table: &'a Table) -> Self {
        let columns = table.columns();
        let groups = columns.div_ceil(GROUP);
        let (sides, shapes, stretches) =
            (Sides::new(columns), vec![Shape::BILINEAR; groups], vec![Stretch::NONE; groups]);
        let (band, needs, reach) = (Band::default(), Needs::default(), Reach::new(columns));
        let centres = [vec![0; columns], vec![0; columns]];
        Self { isa, table, band, needs, centres, sides, shapes, stretches, reach }
    }

    fn run(&mut self, rows: Range<usize>) -> Result<()> {
        let (isa, columns) = (self.isa, self.table.columns());
        // room for as many as there can be costs nothing where it is not used
        self.band.cells.reserve(self.table.band(rows.start).cells_with_taps(rows.clone()) + PADDING)?;
        let mut near = Coordinates::three(isa, self.table, rows.start);
        for row in rows {
            near[2].read(isa, self.table, Some(row + 1));
            self.sides.read(isa, &near);
            self.choose(near[1].valid());
            // neighbouring groups of one shape are one run
            let mut run = 0..0;
            for group in 0..self.shapes.len() {
                let cells = group * GROUP..((group + 1) * GROUP).min(columns);
                let shape = self.shapes[group];
                if shape == Shape::BILINEAR {
                    continue;
                }
                let [xs, ys] = self.centres.each_mut().map(|axis| &mut axis[cells.clone()]);
                if self.stretches[group].steep {
                    centroids(isa, &near, cells.clone(), [xs, ys]);
                } else {
                    let [from_x, from_y] = near[1].at(cells.clone());
                    xs.copy_from_slice(from_x);
                    ys.copy_from_slice(from_y);
                }
                self.stretches[group].apply(isa, self.sides.cells_mut(cells.clone()));
                if run.end != cells.start || shape != self.shapes[run.start / GROUP] {
                    self.add_run(near[1].valid(), run);
                    run = cells.start..cells.start;
                }
                run.end = cells.end;
            }
            self.add_run(near[1].valid(), run);
            self.band.ends.push(self.band.pieces.len() as u32);
            near.rotate_left(1);
        }
        self.band.cells.pad(PADDING);
        self.band.cells.shrink();
        Ok(())
    }

    /// Chooses a shape for each group, by the valid cell that is nearest to its middle.
    fn choose(&mut self, valid: &[u8]) {
        let typical = |group: usize| {
            let cells = group * GROUP..((group + 1) * GROUP).min(valid.len());
            let middle = cells.start + GROUP / 2;
            if cells.end > middle && valid[middle] != 0 {
                return Some(middle);
            }
            cells.filter(|&cell| valid[cell] != 0).min_by_key(|cell| cell.abs_diff(middle))
        };
        let sides = &self.sides;
        Shape::choose_all(self.isa, self.table.source(), &mut self.shapes, &mut self.stretches, |group| {
            typical(group).map(|cell| sides.of(cell))
        });
    }

    /// Appends the valid ones of neighbouring cells of one shape.
    fn add_run(&mut self, mask: &[u8], mut cells: Range<usize>) {
        while !cells.is_empty() {
            let valid = &mask[cells.clone()];
            let end = cells.start + equal_prefix(valid);
            if valid[0] != 0 {
                self.add_valid(cells.start..end);
            }
            cells.start = end;
        }
    }

    fn add_valid(&mut self, cells: Range<usize>) {
        let shape = self.shapes[cells.start / GROUP];
        let sides = self.sides.cells(cells.clone());
        let lattice = Lattice::new(shape, Reach::shift(self.isa, sides), self.table.source());
        let start = self.band.cells.len();
        let centres = self.centres.each_ref().map(|axis| &axis[cells.clone()]);
        self.band.cells.extend(self.isa, centres, sides, lattice.shift);
        let any_clipped = self.reach.read(self.isa, &lattice, &self.band.cells, start..start + cells.len());
        self.reach.blocks(cells.len(), |columns, rows| self.needs.add(shape, self.table.source(), columns, rows));
        let mut piece = |of: Range<usize>, clipped| {
            self.band.pieces.push(Piece {
                first: (cells.start + of.start) as u32,
                cells: of.len() as u32,
                start: (start + of.start) as u32,
                shape,
                shift: lattice.shift,
                clipped,
            });
        };
        if !any_clipped {
            return piece(0..cells.len(), false);
        }
        let mut next = 0;
        while next < cells.len() {
            let first = next;
            next += equal_prefix(&self.reach.clipped()[first..cells.len()]);
            piece(first..next, self.reach.clipped()[first] != 0);
        }
    }
}

/// How many entries at the start are as the first, of which there is one.
fn equal_prefix(flags: &[u8]) -> usize {
    let sixteen = [flags[0]; 16];
    let words = 16 * flags.as_chunks::<16>().0.iter().take_while(|&&word| word == sixteen).count();
    words + flags[words..].iter().take_while(|&&flag| flag == flags[0]).count()
}

impl Cells {
    fn len(&self) -> usize {
        self.x.len()
    }

    fn arrays(&mut self) -> ([&mut Vec<i32>; 2], [&mut Vec<i16>; 4]) {
        let Self { x, y, along: [ax, ay], down: [bx, by] } = self;
        ([x, y], [ax, ay, bx, by])
    }

    /// Room for so many footprints, or an error instead of an abort.
    fn reserve(&mut self, count: usize) -> Result<()> {
        let failed = |_| Error::OutOfMemory { what: "Lut", bytes: count * 16 };
        let (centre, sides) = self.arrays();
        centre.into_iter().try_for_each(|array| array.try_reserve_exact(count).map_err(failed))?;
        sides.into_iter().try_for_each(|array| array.try_reserve_exact(count).map_err(failed))
    }

    /// Gives back room that is not used.
    fn shrink(&mut self) {
        let (centre, sides) = self.arrays();
        centre.into_iter().for_each(Vec::shrink_to_fit);
        sides.into_iter().for_each(Vec::shrink_to_fit);
    }

    fn extend(&mut self, isa: Isa, from: [&[i32]; 2], from_sides: [&[i32]; 4], shift: u8) {
        let (centre, sides) = self.arrays();
        centre.into_iter().zip(from).for_each(|(array, from)| array.extend_from_slice(from));
        for (array, from) in sides.into_iter().zip(from_sides) {
            let first = array.len();
            array.resize(first + from.len(), 0);
            super::reach::narrow(isa, from, shift, &mut array[first..]);
        }
    }

    fn pad(&mut self, count: usize) {
        let (centre, sides) = self.arrays();
        centre.into_iter().for_each(|array| array.extend(std::iter::repeat_n(0, count)));
        sides.into_iter().for_each(|array| array.extend(std::iter::repeat_n(0, count)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BevGrid, Camera, Ground, Lut, Pinhole, SampleAt};

    #[test]
    fn plans_do_not_depend_on_the_instruction_set() {
        let lens = Pinhole::new(1100.0, 1100.0, 511.0, 255.0, 0.0).expect("a good lens");
        let camera = Camera::from_euler(lens, (1024, 512), [1.7, 0.0, 1.2], 0.1, 0.05, 0.6).expect("a good camera");
        let grid = BevGrid::new((4.0, 30.0), (-2.0, 18.0), (0.2, 0.1), SampleAt::Center).expect("a good grid");
        let lut = Lut::new(&camera, &grid, &Ground::default()).expect("a good table");
        let plans: Vec<_> = Isa::available().iter().map(|&isa| Plan::new(isa, lut.table()).expect("a plan")).collect();
        let text = format!("{:?}", plans[0]);
        assert!(plans[0].levels.len() > 2 && plans[0].bands.iter().any(|band| band.pieces.len() > 50));
        assert!(plans.iter().all(|plan| format!("{plan:?}") == text));
    }
}
