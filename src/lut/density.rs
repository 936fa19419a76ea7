//! How much of the source a cell sees.

use super::Lut;
use super::footprint::{Coordinates, Sides, check_sides};
use crate::cpu::Isa;
use crate::error::Result;
use crate::kernels::FRACTION_BITS;
use crate::parallel;
use crate::view::buffer;

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
        let mut density = buffer::filled("sampling_density", 2 * self.rows() * self.columns(), f32::NAN)?;
        self.for_each_footprint(&mut density, |[ax, ay, bx, by]| [bx.hypot(by) as f32, ax.hypot(ay) as f32])?;
        Ok(density)
    }

    /// Which cells' content is really seen, row-major: valid, and in no direction on the output less than `minimum` source
    /// pixels a cell. 0.5 asks for one source pixel for every two cells. The direction matters: far to the side of a camera
    /// both sides of a footprint are long, and nearly the same way, so that what lies across them is not told apart.
    ///
    /// # Errors
    /// [`Error::AreaSize`](crate::Error::AreaSize), [`Error::Isa`](crate::Error::Isa).
    pub fn resolved_mask(&self, minimum: f64) -> Result<Vec<bool>> {
        let mut mask = buffer::zeroed("resolved_mask", self.rows() * self.columns())?;
        self.for_each_footprint(&mut mask, |sides| {
            let (area, largest) = area_and_length(sides);
            [area >= minimum * largest]
        })?;
        Ok(mask)
    }

    /// Source pixels a cell in the direction on the output in which there are fewest, row-major; NaN where the cell is not
    /// valid.
    pub(crate) fn resolution(&self) -> Result<Vec<f32>> {
        let mut resolution = buffer::filled("resolution", self.rows() * self.columns(), f32::NAN)?;
        self.for_each_footprint(&mut resolution, |sides| {
            let (area, largest) = area_and_length(sides);
            [if largest > 0.0 { (area / largest) as f32 } else { 0.0 }]
        })?;
        Ok(resolution)
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
        let (isa, threads) = (Isa::active()?, parallel::num_threads());
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
