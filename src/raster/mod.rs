//! Points onto a [`BevGrid`]: counts, heights and whatever else the points carry, as layers.
//!
//! ```
//! use ipm_rs::raster::{RasterOptions, Reduce, rasterize};
//! use ipm_rs::view::Strided;
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
pub(crate) mod error;
mod kernels;
mod layers;
mod points;
mod records;
mod shapes;

pub use layers::Raster;
pub use points::{Coordinates, Values};
pub use shapes::{box_corners, check_polygon, draw_polygon};

use crate::error::{Error, RasterError, Result};
use crate::grid::BevGrid;
use crate::isa::Isa;
use crate::parallel::{self, check_interrupt};
use crate::view::{MAX_CELLS, PointSample, Strided};

/// What memory is asked for, in errors.
const WHAT: &str = "rasterize";

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
    /// Every reduction.
    pub const ALL: [Self; 7] = [Self::Count, Self::Density, Self::Min, Self::Max, Self::Mean, Self::Last, Self::Top];

    /// Its name.
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
            return Err(Error::Raster(RasterError::DensityFull { got: full }));
        }
        let ascending = self.slices.windows(2).all(|edge| edge[0] < edge[1]);
        if self.slices.len() == 1 || !ascending || !self.slices.iter().all(|edge| edge.is_finite()) {
            // no more than a message shows
            return Err(Error::Raster(RasterError::Slices { got: self.slices[..self.slices.len().min(100)].to_vec() }));
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
/// [`RasterError::PointColumns`], [`RasterError::PointValues`], [`RasterError::TooManyPoints`],
/// [`RasterError::Slices`], [`RasterError::DensityFull`], [`RasterError::TooManyCells`],
/// [`ThreadsError::Zero`](crate::error::ThreadsError::Zero),
/// [`Error::OutOfMemory`] and [`IsaError`](crate::error::IsaError).
pub fn rasterize<T: PointSample>(
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
pub fn rasterize_values<T: PointSample>(
    points: &dyn Coordinates,
    values: &dyn Values<T>,
    grid: &BevGrid,
    options: &RasterOptions<'_>,
) -> Result<Raster<T>> {
    run(&Source { points, values: Some(values) }, grid, options)
}

fn run<T: PointSample>(source: &Source<'_, T>, grid: &BevGrid, options: &RasterOptions<'_>) -> Result<Raster<T>> {
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

fn collect<T: PointSample, R: Record<T>>(
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
        return Err(Error::Raster(RasterError::TooManyCells {
            rows,
            columns: grid.columns() as f64,
            limit: MAX_CELLS,
        }));
    }
    let isa = Isa::active()?;
    let finder = Finder::new(grid, options.slices)?;
    let wants_heights = options.reduce.contains(&Reduce::Top);
    let mut raster = Raster::new(options, (slices, grid.rows(), grid.columns()), source.channels())?;
    let cells = Cells::<T, R>::new(&mut raster, options.density_full);
    // below that, to ask another thread for help takes longer than to do it
    const POINTS_PER_THREAD: usize = if cfg!(miri) { 2 * BLOCK } else { 16 * BLOCK }; // Miri is to see threads, soon
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
fn whole<T: PointSample, R: Record<T>>(
    source: &Source<'_, T>,
    finder: &Finder,
    isa: Isa,
    mut cells: Cells<'_, T, R>,
    wants_heights: bool,
) -> Result<Census> {
    let mut census = Census::default();
    let mut block = Block::new(source.channels(), wants_heights)?;
    cells.begin(Work::default())?;
    let count = source.points.rows();
    for first in (0..count).step_by(BLOCK) {
        check_interrupt()?;
        let points = BLOCK.min(count - first);
        if block.is_plain(source) {
            census += block.find(source, finder, isa, first, points);
            let (keys, heights) = block.plain(cells.len());
            cells.add_plain(keys, heights);
            continue;
        }
        census += block.read(source, finder, isa, first, points);
        cells.add::<true>(&block.keys, block.values.iter().map(Vec::as_slice), &block.heights);
    }
    cells.finish(isa);
    Ok(census)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::SampleAt;
    use crate::error::ThreadsError;

    fn grid() -> BevGrid {
        BevGrid::new((0.0, 20.0), (-8.0, 8.0), (0.25, 0.5), SampleAt::Center).unwrap()
    }

    /// Points in no order, some beyond the grid, many in one cell.
    fn cloud(count: usize) -> Vec<f32> {
        let mut state = 1u32;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32
        };
        (0..count)
            .flat_map(|i| match i % 3 {
                0 => [10.1, 0.1, next() - 0.5],
                _ => [next() * 24.0 - 2.0, next() * 20.0 - 10.0, next() * 4.0],
            })
            .collect()
    }

    fn bits<T: PointSample>(layer: &Option<Vec<T>>) -> Vec<u64> {
        layer.iter().flatten().map(|value| value.to_f64().to_bits()).collect()
    }

    #[test]
    fn threads_and_batches_change_nothing() {
        // beyond one batch of 4 million points, once; what Miri interprets is one batch of two threads
        let counts: &[usize] = if cfg!(miri) { &[4_100] } else { &[0, 1, 40_000, 100_003, 4_300_000] };
        for &count in counts {
            let cloud = cloud(count);
            let points = Strided::new(&cloud, 3).unwrap();
            let run = |threads| {
                let options =
                    RasterOptions { reduce: &Reduce::ALL, threads: Some(threads), ..RasterOptions::default() };
                rasterize(&points, None, &grid(), &options).unwrap()
            };
            let one = run(1);
            assert_eq!(one.inside + one.outside, count);
            assert_eq!(one.count.iter().flatten().map(|&n| n as usize).sum::<usize>(), one.inside);
            for threads in [2, 5] {
                let many = run(threads);
                assert_eq!(one.count, many.count);
                let all = |r: &Raster<f32>| [&r.min, &r.max, &r.mean, &r.last, &r.top, &r.density].map(bits);
                assert!(all(&one) == all(&many), "{count} points, {threads} threads");
            }
        }
    }

    #[test]
    fn refuses_what_does_not_fit() {
        let cloud = cloud(10);
        let points = Strided::new(&cloud, 3).unwrap();
        let with = |options: RasterOptions<'_>| rasterize(&points, None, &grid(), &options).map(|_| ());
        let fresh = RasterOptions::default;
        assert!(matches!(
            with(RasterOptions { slices: &[1.0, 1.0], ..fresh() }),
            Err(Error::Raster(RasterError::Slices { .. }))
        ));
        assert!(matches!(
            with(RasterOptions { density_full: 1.0, ..fresh() }),
            Err(Error::Raster(RasterError::DensityFull { .. }))
        ));
        assert!(matches!(
            with(RasterOptions { threads: Some(0), ..fresh() }),
            Err(Error::Threads(ThreadsError::Zero { got: 0 }))
        ));
        let flat = Strided::new(&cloud[..20], 2).unwrap();
        assert_eq!(
            rasterize(&flat, None, &grid(), &fresh()).map(|_| ()),
            Err(Error::Raster(RasterError::PointColumns { expected: 3, got: 2 }))
        );
        let few = Strided::new(&cloud[..9], 1).unwrap();
        assert!(matches!(
            rasterize(&points, Some(&few), &grid(), &fresh()),
            Err(Error::Raster(RasterError::PointValues { expected: 10, .. }))
        ));
        let many = Strided::with_strides(&cloud, (1 << 31, 3), 0, (0, 1)).unwrap();
        assert!(matches!(
            rasterize(&many, None, &grid(), &fresh()),
            Err(Error::Raster(RasterError::TooManyPoints { .. }))
        ));
    }

    proptest! {
        /// Cell by cell, from the definition.
        #[test]
        fn as_the_definition(cloud in prop::collection::vec(prop::array::uniform3(-20i32..100), 0..120)) {
            let flat: Vec<f64> = cloud.iter().flatten().map(|&quarter| f64::from(quarter) / 4.0).collect();
            let points = Strided::new(&flat, 3).unwrap();
            let options = RasterOptions { reduce: &Reduce::ALL, ..RasterOptions::default() };
            let raster = rasterize(&points, None, &grid(), &options).unwrap();
            let (columns, mut found) = (32, 0);
            for cell in 0..80 * columns {
                let inside = |p: &&[f64]| {
                    let (row, column) = (((20.0 - p[0]) / 0.25).floor(), ((8.0 - p[1]) / 0.5).floor());
                    p[0] > 0.0 && p[1] > -8.0 && row == (cell / columns) as f64 && column == (cell % columns) as f64
                };
                let heights: Vec<f64> = flat.chunks(3).filter(inside).map(|p| p[2]).collect();
                found += heights.len();
                prop_assert_eq!(raster.count.as_ref().unwrap()[cell], heights.len() as i32);
                let at = |layer: &Option<Vec<f64>>| layer.as_ref().unwrap()[cell];
                if let (Some(&last), false) = (heights.last(), heights.is_empty()) {
                    let most = heights.iter().copied().fold(f64::MIN, f64::max);
                    prop_assert_eq!(at(&raster.max), most);
                    prop_assert_eq!(at(&raster.top), most);
                    prop_assert_eq!(at(&raster.min), heights.iter().copied().fold(f64::MAX, f64::min));
                    prop_assert_eq!(at(&raster.mean), heights.iter().sum::<f64>() / heights.len() as f64);
                    prop_assert_eq!(at(&raster.last), last);
                } else {
                    prop_assert!([&raster.min, &raster.max, &raster.mean, &raster.last, &raster.top].iter().all(|l| at(l).is_nan()));
                }
            }
            prop_assert_eq!(found, raster.inside);
        }
    }
}
