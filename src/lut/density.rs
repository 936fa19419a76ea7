//! How much of the source a cell sees.

use super::Lut;
use super::area::{Coordinates, Q, Sides, check_sides};
use crate::cpu::Isa;
use crate::error::Result;
use crate::parallel;

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
    /// [`Error::AreaSize`](crate::Error::AreaSize), [`Error::Isa`](crate::Error::Isa).
    pub fn sampling_density(&self) -> Result<Vec<f32>> {
        check_sides(self.source_size())?;
        let (rows, columns) = (self.rows(), self.columns());
        let mut density = vec![f32::NAN; 2 * rows * columns];
        let isa = Isa::active()?;
        let threads = parallel::num_threads();
        let band_rows = parallel::rows_per_band(rows, columns, threads);
        let bands = density.chunks_mut(2 * columns * band_rows).enumerate();
        parallel::for_each(threads, bands, |(band, density)| {
            let first = band * band_rows;
            let mut near = Coordinates::three(isa, &self.table, first);
            let mut sides = Sides::new(columns);
            for (row, cells) in (first..).zip(density.chunks_mut(2 * columns)) {
                near[2].read(isa, &self.table, Some(row + 1));
                sides.read(isa, &near);
                for (cell, values) in cells.chunks_exact_mut(2).enumerate().filter(|&(cell, _)| near[1].is_valid(cell))
                {
                    let [ax, ay, bx, by] = sides.of(cell);
                    let length = |x: i32, y: i32| f64::from(x).hypot(f64::from(y)) / f64::from(1 << Q);
                    values.copy_from_slice(&[length(bx, by) as f32, length(ax, ay) as f32]);
                }
                near.rotate_left(1);
            }
        });
        Ok(density)
    }

    /// Which cells' content is really seen, row-major: valid, and along both of its axes at least `minimum` source pixels a
    /// cell. 0.5 asks for one source pixel for every two cells.
    ///
    /// # Errors
    /// [`Error::AreaSize`](crate::Error::AreaSize), [`Error::Isa`](crate::Error::Isa).
    pub fn resolved_mask(&self, minimum: f32) -> Result<Vec<bool>> {
        let density = self.sampling_density()?;
        Ok(density.as_chunks::<2>().0.iter().map(|cell| cell.iter().all(|&axis| axis >= minimum)).collect())
    }
}
