//! What a frame shows of a window of a tile, before it is added.

use std::borrow::Cow;
use std::ops::Range;

use super::accumulate::{Distances, WHOLE, quantise};
use super::tile::Value;
use super::{Frame, WHAT};
use crate::error::Result;
use crate::grid::BevGrid;
use crate::isa::Isa;
use crate::lut::{Lut, Resolution};
use crate::parallel::{self, Work};
use crate::view::{ImageView, buffer};

/// What a frame adds to some rows of a tile.
#[derive(Debug, Clone)]
pub struct Contribution<'a, T: Clone> {
    /// The tile's row and column of the first cell.
    pub at: (usize, usize),
    /// Cells of each row.
    pub columns: usize,
    /// What the frame shows of each cell, row-major; channels of a cell are adjacent.
    pub values: Cow<'a, [T]>,
    /// How well it resolves each cell, in 1/4096 pixel a cell; 0 where it does not count.
    pub resolutions: Cow<'a, [u16]>,
    /// How much the frame counts, in 1/65536, from 1 to 65536.
    pub weight: u32,
    /// What tells it from other frames, where samples are kept; all but 20 bits are left out.
    pub id: u32,
}

impl<T: Clone> Contribution<'_, T> {
    /// How many cells count.
    pub fn counted(&self) -> usize {
        self.resolutions.iter().filter(|&&resolution| resolution > 0).count()
    }

    /// The tile's rows.
    pub(super) fn rows(&self) -> Range<usize> {
        self.at.0..self.at.0.saturating_add(self.resolutions.len() / self.columns.max(1))
    }

    /// The columns of the contribution from the first that counts to the last one, in a row of the tile.
    pub(super) fn counted_columns(&self, row: usize) -> Range<usize> {
        let resolutions = &self.resolutions[(row - self.at.0) * self.columns..][..self.columns];
        let counts = |&resolution: &u16| resolution > 0;
        let first = resolutions.iter().position(counts).unwrap_or(self.columns);
        first..resolutions.iter().rposition(counts).map_or(first, |last| last + 1)
    }
}

impl Frame<'_> {
    /// What the frame shows of a window of a tile, whose first cell is the tile's cell `at` (row, column). Averages are those
    /// of [`Interpolation::Area`](crate::Interpolation::Area); of `labels` each cell has the most frequent one.
    ///
    /// # Errors
    /// Those of [`Lut::new`] and [`Lut::warp`].
    pub fn contribution<T: Value>(
        &self,
        image: &ImageView<'_, T>,
        window: &BevGrid,
        at: (usize, usize),
        labels: bool,
        threads: Option<usize>,
    ) -> Result<Contribution<'static, T>> {
        let lut = self.table(window)?;
        let values = self.values(image, &lut, labels, threads)?;
        let resolutions = self.resolutions(&lut, window, threads)?;
        let weight = ((self.weight * f64::from(WHOLE)).round() as u32).clamp(1, WHOLE);
        let columns = window.columns();
        Ok(Contribution { at, columns, values: values.into(), resolutions: resolutions.into(), weight, id: self.id })
    }

    /// How well each cell is resolved that counts.
    fn resolutions(&self, lut: &Lut, window: &BevGrid, threads: Option<usize>) -> Result<Vec<u16>> {
        let (rows, columns, isa) = (window.rows(), window.columns(), Isa::active()?);
        let mut y_squared = buffer::reserved(WHAT, columns)?;
        y_squared.extend((0..columns).map(|column| (window.y_of_column(column as f64) - self.from[1]).powi(2)));
        let threads = Work::bytes(rows * columns * 24).threads(threads)?;
        let band_rows = parallel::rows_per_band(rows, columns, threads);
        let mut found = buffer::zeroed(WHAT, rows * columns)?;
        let bands = found.chunks_mut(band_rows * columns).enumerate();
        parallel::for_each(threads, bands, |(band, found)| {
            let mut resolution = Resolution::of(lut)?;
            let mut pixels = buffer::zeroed::<f32>(WHAT, columns)?;
            for (row, found) in (band * band_rows..).zip(found.chunks_mut(columns)) {
                let x_squared = (window.x_of_row(row as f64) - self.from[0]).powi(2);
                for span in lut.table().row(row).filter(|span| span.kind.is_valid()) {
                    let cells = span.first..span.first + span.cells;
                    let pixels = &mut pixels[..span.cells];
                    resolution.read(row, cells.clone(), pixels)?;
                    let y_squared = &y_squared[cells.clone()];
                    let distances = Distances { x_squared, y_squared, counted: self.distance };
                    quantise(isa, &distances, pixels, &mut found[cells]);
                }
            }
            Ok(())
        })?;
        Ok(found)
    }
}
