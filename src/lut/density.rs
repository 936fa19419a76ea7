//! How much of the source a cell sees.

use std::ops::Range;

use super::Lut;
use super::footprint::{Coordinates, Sides, check_sides, slope};
use crate::error::Result;
use crate::isa::{Isa, for_each_isa};
use crate::kernels::FRACTION_BITS;
use crate::parallel::{self, Work};
use crate::table::{Span, Table};
use crate::view::{buffer, prefetch};

impl Lut {
    /// Source pixels from a cell to the next, row-major, two numbers a cell: down the output's rows, and along its columns.
    /// They are the lengths of the sides of the parallelogram that the cell covers on the source, by central differences
    /// of the table's coordinates (one-sided beside cells without an image). NaN where the cell is not valid.
    ///
    /// A number above 1 says that the cell sees more than plain sampling looks at, which is what
    /// [`Interpolation::Area`](crate::Interpolation::Area) is for; below 1 one source pixel is stretched over several
    /// cells.
    ///
    /// # Errors
    /// [`LutError::AreaSize`](crate::error::LutError::AreaSize), [`IsaError`](crate::error::IsaError).
    pub fn sampling_density(&self) -> Result<Vec<f32>> {
        let mut density = buffer::filled("sampling_density", 2 * self.rows() * self.columns(), f32::NAN)?;
        self.for_each_footprint(&mut density, |[ax, ay, bx, by]| [bx.hypot(by) as f32, ax.hypot(ay) as f32])?;
        Ok(density)
    }

    /// Which cells' content is really seen, row-major: valid, and in no direction on the output less than `minimum` source
    /// pixels a cell. 0.5 asks for one source pixel for every two cells. The direction matters: far to the side of a camera
    /// both sides of a footprint are long, and nearly the same way, so that what lies across them is not told apart.
    ///
    /// # Errors
    /// [`LutError::AreaSize`](crate::error::LutError::AreaSize), [`IsaError`](crate::error::IsaError).
    pub fn resolved_mask(&self, minimum: f64) -> Result<Vec<bool>> {
        let mut mask = buffer::zeroed("resolved_mask", self.rows() * self.columns())?;
        self.for_each_footprint(&mut mask, |sides| {
            let (area, largest) = area_and_length(sides);
            [area >= minimum * largest]
        })?;
        Ok(mask)
    }

    /// Writes what `of` says of the footprint of every valid cell: (x, y) of the side along the row, then of the one down
    /// the columns, in source pixels.
    fn for_each_footprint<T: Copy + Send, const N: usize>(
        &self,
        values: &mut [T],
        of: impl Fn([f64; 4]) -> [T; N] + Sync,
    ) -> Result<()> {
        check_sides(self.source_size())?;
        let (rows, columns) = (self.rows(), self.columns());
        let (isa, threads) = (Isa::active()?, Work::table(rows * columns).threads_unasked());
        let band_rows = parallel::rows_per_band(rows, columns, threads);
        let bands = values.chunks_mut(N * columns * band_rows).enumerate();
        parallel::for_each(threads, bands, |(band, values)| {
            let first = band * band_rows;
            let mut near = Coordinates::three(isa, &self.table, first)?;
            let mut sides = Sides::new(columns)?;
            for (row, cells) in (first..).zip(values.chunks_mut(N * columns)) {
                near[2].read(isa, &self.table, Some(row + 1));
                sides.read(isa, &near);
                for (cell, values) in cells.chunks_exact_mut(N).enumerate().filter(|&(cell, _)| near[1].is_valid(cell))
                {
                    let pixels = |side: i32| f64::from(side) / f64::from(1 << FRACTION_BITS);
                    values.copy_from_slice(&of(sides.of(cell).map(pixels)));
                }
                near.rotate_left(1);
            }
            Ok(())
        })
    }
}

/// The area of a parallelogram, and the larger singular value of the matrix with its sides as columns: the smaller one is
/// the area by it.
fn area_and_length([ax, ay, bx, by]: [f64; 4]) -> (f64, f64) {
    let (sum, area) = (ax * ax + ay * ay + bx * bx + by * by, (ax * by - ay * bx).abs());
    (area, ((sum + (sum * sum - 4.0 * area * area).max(0.0).sqrt()) / 2.0).sqrt())
}

/// How well some neighbouring cells of a row are resolved: the source pixels a cell in the direction on the output in which
/// there are fewest.
pub(crate) struct Resolution<'a> {
    isa: Isa,
    table: &'a Table,
    near: [Coordinates; 3],
    known: [Known; 3],
}

/// Which columns of which row, counted from the one above the first, a [`Coordinates`] holds.
#[derive(Debug, Clone, Default)]
struct Known {
    row: usize,
    columns: Vec<Range<usize>>,
}

/// So many columns more are read at either side: what two cameras see of a row moves by a column or two from row to row, so
/// each row is read once instead of three times.
const BESIDE: usize = 4;

/// So many rows ahead taps are asked for. What two cameras see of a row are a few lines of the cache, far from those of the
/// next row, so the CPU's own prefetching never begins: waiting for them took an eighth of a ring's build (the bench `rig`).
const AHEAD: usize = 4;

impl<'a> Resolution<'a> {
    /// # Errors
    /// [`LutError::AreaSize`](crate::error::LutError::AreaSize), [`IsaError`](crate::error::IsaError) and
    /// [`Error::OutOfMemory`](crate::Error::OutOfMemory).
    pub(crate) fn of(lut: &'a Lut) -> Result<Self> {
        check_sides(lut.source_size())?;
        let table = &lut.table;
        let near = [Coordinates::none(table)?, Coordinates::none(table)?, Coordinates::none(table)?];
        let known = [const { Known { row: usize::MAX, columns: Vec::new() } }; 3];
        Ok(Self { isa: Isa::active()?, table, near, known })
    }

    /// Writes that of the cells from the first of these columns on; of cells without an image, and of those behind the last
    /// of the columns, of which there may be up to [`LANES`](crate::table::block::LANES), anything at all.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`](crate::Error::OutOfMemory).
    pub(crate) fn read(&mut self, row: usize, columns: Range<usize>, resolution: &mut [f32]) -> Result<()> {
        for above in row..row + 3 {
            let (near, known) = (&mut self.near[above % 3], &mut self.known[above % 3]);
            if known.row != above {
                known.row = above;
                known.columns.clear();
            }
            if !known.columns.iter().any(|known| known.start <= columns.start && columns.end <= known.end) {
                let columns = columns.start.saturating_sub(BESIDE)..(columns.end + BESIDE).min(self.table.columns());
                self.table.fetch(above + AHEAD - 1, &columns);
                near.read_columns(self.isa, self.table, above.checked_sub(1), &columns);
                buffer::push("resolution", &mut known.columns, columns)?;
            }
        }
        let near = [0, 1, 2].map(|after| self.near[(row + after) % 3].axes().map(|axis| &axis[columns.start..]));
        smaller_singular_values(self.isa, near, resolution);
        Ok(())
    }
}

impl Table {
    /// Asks for the taps of some cells of a row that will be needed soon, if there is such a row.
    fn fetch(&self, row: usize, columns: &Range<usize>) {
        /// Taps of a line of the cache.
        const LINE: usize = 8;
        if row >= self.rows() {
            return;
        }
        for Span { taps, .. } in self.row_part(row, columns) {
            (0..taps.len()).step_by(LINE).for_each(|tap| prefetch(taps, tap));
        }
    }
}

/// The smaller singular values, in pixels, of matrices whose columns are the sides of the footprints of neighbouring cells
/// (see [`Sides`]). They are of the middle one of three rows, whose columns and rows on the source are in 1/1024 pixel and
/// begin with the cell before the first.
fn smaller_singular_values(isa: Isa, rows: [[&[i32]; 2]; 3], values: &mut [f32]) {
    #[inline(always)]
    fn body(rows: [[&[i32]; 2]; 3], values: &mut [f32]) {
        let cells = values.len();
        let [[above_x, above_y], [x, y], [below_x, below_y]] = rows.map(|axes| axes.map(|axis| &axis[..cells + 2]));
        for i in 0..cells {
            let sides = [
                slope(x[i], x[i + 1], x[i + 2]),
                slope(y[i], y[i + 1], y[i + 2]),
                slope(above_x[i + 1], x[i + 1], below_x[i + 1]),
                slope(above_y[i + 1], y[i + 1], below_y[i + 1]),
            ];
            let [ax, ay, bx, by] = sides.map(|side| side as f32 / (1 << FRACTION_BITS) as f32);
            let (sum, area) = (ax * ax + ay * ay + bx * bx + by * by, (ax * by - ay * bx).abs());
            let difference = sum * sum - 4.0 * area * area;
            let largest = (sum + (if difference > 0.0 { difference } else { 0.0 }).sqrt()) / 2.0;
            values[i] = if largest > 0.0 { area / largest.sqrt() } else { 0.0 };
        }
    }
    for_each_isa!(isa, (body, body, body)(rows: [[&[i32]; 2]; 3], values: &mut [f32]));
}
