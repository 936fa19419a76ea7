//! Points onto a [`BevGrid`]: counts, heights and whatever else the points carry, as layers.
//!
//! ```
//! use ipm_rs::raster::{RasterOptions, Reduce, Strided, rasterize};
//! use ipm_rs::{BevGrid, SampleAt};
//!
//! # fn main() -> ipm_rs::Result<()> {
//! let grid = BevGrid::new((0.0, 50.0), (-25.0, 25.0), (0.1, 0.1), SampleAt::Center)?;
//! let cloud = [10.0f32, 0.0, 0.2, 10.02, 0.01, 1.4, 60.0, 0.0, 0.0]; // x, y, z of three points
//! let points = Strided::new(&cloud, 3)?;
//! let options = RasterOptions { reduce: &[Reduce::Count, Reduce::Max], ..RasterOptions::default() };
//! let raster = rasterize(&points, None, &grid, &options)?;
//! assert_eq!((raster.inside, raster.outside, raster.ignored), (2, 1, 0));
//! # Ok(())
//! # }
//! ```
//!
//! A point's cell is `row = floor((x_max - x) / dx)`, `column = floor((y_max - y) / dy)` in float64: the far and the
//! left edge of the grid are in, the near and the right edge are out. A cell is the same square whatever the grid's
//! [`SampleAt`](crate::SampleAt), which says where images are sampled.

mod bands;
mod kernels;
mod layers;
mod number;
mod points;
mod records;
mod shapes;
mod strided;
mod zeroed;

pub use layers::Raster;
pub use number::{Cast, Real};
pub use points::{Coordinates, Values};
pub use shapes::{box_corners, check_polygon, draw_polygon};
pub use strided::Strided;

use crate::cpu::Isa;
use crate::error::{Error, Result};
use crate::grid::{BevGrid, MAX_CELLS};
use crate::parallel;

use kernels::Finder;
use layers::{Cells, Work};
use points::{BLOCK, Block, Source};
use records::{Count, Full, Peak, Record};

/// Most points of one call: their number in a cell is an `i32`.
pub const MAX_POINTS: usize = i32::MAX as usize;

/// What becomes of the points of a cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Reduce {
    /// How many points there are.
    Count,
    /// How many there are, on a scale from 0 to 1: `min(1, ln(count + 1) / ln(full))`.
    Density,
    /// The lowest value.
    Min,
    /// The highest value.
    Max,
    /// The sum of the values in float64, in the order of the points, divided by their number.
    Mean,
    /// The value of the last point.
    Last,
    /// The value of the point with the greatest z, the first of several.
    Top,
}

impl Reduce {
    /// All of them.
    pub const ALL: [Self; 7] = [Self::Count, Self::Density, Self::Min, Self::Max, Self::Mean, Self::Last, Self::Top];

    /// Its name in Python.
    pub fn name(self) -> &'static str {
        match self {
            Self::Count => "count",
            Self::Density => "density",
            Self::Min => "min",
            Self::Max => "max",
            Self::Mean => "mean",
            Self::Last => "last",
            Self::Top => "top",
        }
    }

    /// Whether it looks at values, and not only at where the points are.
    pub fn needs_values(self) -> bool {
        !matches!(self, Self::Count | Self::Density)
    }
}

/// How to make layers of points.
#[derive(Debug, Clone, Copy)]
pub struct RasterOptions<'a> {
    /// The layers to make.
    pub reduce: &'a [Reduce],
    /// Edges of height slices, ascending: slice s takes `edges[s] <= z < edges[s + 1]`. No edges: one slice of all heights.
    pub slices: &'a [f64],
    /// The count plus one at which the density is 1; the field's is 64.
    pub density_full: f64,
    /// At most how many threads; `None` is [`num_threads`](crate::num_threads). The result does not depend on it.
    pub threads: Option<usize>,
}

impl Default for RasterOptions<'_> {
    fn default() -> Self {
        Self { reduce: &[Reduce::Count, Reduce::Max, Reduce::Mean], slices: &[], density_full: 64.0, threads: None }
    }
}

impl RasterOptions<'_> {
    fn check(&self) -> Result<()> {
        let full = self.density_full;
        if !(full > 1.0 && full.is_finite()) {
            return Err(Error::DensityFull { got: full });
        }
        let ascending = self.slices.windows(2).all(|edge| edge[0] < edge[1]);
        if self.slices.len() == 1 || !ascending || !self.slices.iter().all(|edge| edge.is_finite()) {
            return Err(Error::Slices { got: self.slices.to_vec() });
        }
        Ok(())
    }
}

/// Makes layers of points (rows of x, y and, where there is one, z; further columns are not looked at).
///
/// The values are those given, one row for each point, or z. A point whose coordinates are not all finite, or that lies
/// on the grid and has a value that is not, takes part in nothing.
///
/// Besides the layers, memory is needed for what the cells collect (4 bytes a cell for counts alone, else 16 or 24 bytes for
/// each of its channels, 24 or 40 in float64), 8 bytes a cell for the top, and at most 64 MiB of points at a time.
///
/// # Errors
/// [`Error::PointColumns`], [`Error::PointValues`], [`Error::TooManyPoints`], [`Error::Slices`],
/// [`Error::DensityFull`], [`Error::TooManyCells`], [`Error::Threads`] and [`Error::OutOfMemory`].
pub fn rasterize<T: Real>(
    points: &Strided<'_, T>,
    values: Option<&dyn Values<T>>,
    grid: &BevGrid,
    options: &RasterOptions<'_>,
) -> Result<Raster<T>> {
    run(&Source { points, values }, grid, options)
}

/// As [`rasterize`], with values of another type than the points'.
///
/// # Errors
/// As [`rasterize`].
pub fn rasterize_values<T: Real>(
    points: &dyn Coordinates,
    values: &dyn Values<T>,
    grid: &BevGrid,
    options: &RasterOptions<'_>,
) -> Result<Raster<T>> {
    run(&Source { points, values: Some(values) }, grid, options)
}

fn run<T: Real>(source: &Source<'_, T>, grid: &BevGrid, options: &RasterOptions<'_>) -> Result<Raster<T>> {
    options.check()?;
    source.check(options)?;
    let asked = |reduce| options.reduce.contains(&reduce);
    if asked(Reduce::Min) || asked(Reduce::Last) {
        collect::<T, Full<T>>(source, grid, options)
    } else if asked(Reduce::Max) || asked(Reduce::Mean) {
        collect::<T, Peak<T>>(source, grid, options)
    } else {
        collect::<T, Count>(source, grid, options)
    }
}

fn collect<T: Real, R: Record<T>>(
    source: &Source<'_, T>,
    grid: &BevGrid,
    options: &RasterOptions<'_>,
) -> Result<Raster<T>> {
    let threads = options.threads.unwrap_or_else(parallel::num_threads);
    parallel::check_threads(threads)?;
    let slices = options.slices.len().saturating_sub(1).max(1);
    let cells = slices.saturating_mul(grid.rows() * grid.columns());
    if cells > MAX_CELLS {
        let rows = slices as f64 * grid.rows() as f64;
        return Err(Error::TooManyCells { what: "rasterize", rows, columns: grid.columns() as f64, limit: MAX_CELLS });
    }
    let isa = Isa::active()?;
    let finder = Finder::new(grid, options.slices);
    let wants_heights = options.reduce.contains(&Reduce::Top);
    let mut raster = Raster::new(options, (slices, grid.rows(), grid.columns()), source.channels())?;
    let cells = Cells::<T, R>::new(&mut raster, options.density_full);
    // below that, to ask another thread for help takes longer than to do it
    const POINTS_PER_THREAD: usize = 16 * BLOCK;
    let count = source.points.rows();
    let threads = threads.min(count / POINTS_PER_THREAD).max(1);
    let census = if threads == 1 {
        whole(source, &finder, isa, cells, wants_heights)?
    } else {
        bands::run(source, &finder, isa, cells, wants_heights, threads)?
    };
    raster.note(census, count);
    Ok(raster)
}

/// How many points found a cell, and how many are not finite.
#[derive(Debug, Clone, Copy, Default)]
struct Census {
    inside: usize,
    ignored: usize,
}

impl std::ops::Add for Census {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { inside: self.inside + other.inside, ignored: self.ignored + other.ignored }
    }
}

impl std::ops::AddAssign for Census {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

/// On this thread, block after block.
fn whole<T: Real, R: Record<T>>(
    source: &Source<'_, T>,
    finder: &Finder,
    isa: Isa,
    mut cells: Cells<'_, T, R>,
    wants_heights: bool,
) -> Result<Census> {
    let mut census = Census::default();
    let mut block = Block::new(source.channels(), wants_heights);
    cells.begin(Work::default())?;
    let count = source.points.rows();
    for first in (0..count).step_by(BLOCK) {
        census += block.read(source, finder, isa, first, BLOCK.min(count - first));
        cells.add::<true>(&block.keys, block.values.iter().map(Vec::as_slice), &block.heights);
    }
    cells.finish(isa);
    Ok(census)
}
