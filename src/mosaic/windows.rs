//! Which windows of which tiles a frame sees well.

use super::accumulate::COARSEST;
use super::{Frame, WHAT};
use crate::error::{Error, GridError, MosaicError, Result};
use crate::grid::{BevGrid, SampleAt};
use crate::view::buffer;

/// Some cells of a tile.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Window {
    /// Tile (i, j) spans x from i times its side on, and y from j times its side on.
    pub tile: (i64, i64),
    /// The first row and column in the tile.
    pub at: (usize, usize),
    /// The cells, in the map.
    pub grid: BevGrid,
}

/// Cells of the map that make one of the coarse grid, along each side: enough that there are few, up to a tile's least side.
const FINEST_STEP: usize = 8;
pub(super) const COARSEST_STEP: usize = 64;

/// A coarse grid has at most so many cells from its middle to its rim, where steps may still grow.
const COARSE_CELLS: f64 = 64.0;

/// Metres from the camera to the road where its height is not known.
const USUAL_HEIGHT: f64 = 2.0;

impl Frame<'_> {
    /// The windows that hold all cells of a map that the frame sees well, tile by tile, for cells of `resolution` metres and
    /// tiles of `side` cells, a multiple of 64. The mask is not looked at.
    ///
    /// A coarse table says where they are. A part of the picture that is smaller than one of its cells, and touches none
    /// that is seen, is left out.
    ///
    /// # Errors
    /// [`MosaicError::Side`] and [`GridError::CellSize`]; those of [`BevGrid::new`], of
    /// [`Lut::new`](crate::Lut::new) and of [`Lut::resolved_mask`](crate::Lut::resolved_mask).
    pub fn windows(&self, resolution: f64, side: usize) -> Result<Vec<Window>> {
        if side == 0 || !side.is_multiple_of(COARSEST_STEP) {
            return Err(Error::Mosaic(MosaicError::Side { got: side }));
        }
        if !(resolution > 0.0 && resolution.is_finite()) {
            return Err(Error::Grid(GridError::CellSize { axis: "x", got: resolution }));
        }
        let [x, y, _] = self.camera.position().into();
        let beside = (x - self.from[0]).hypot(y - self.from[1]);
        let reach = self.reach(resolution).min(self.distance.1 + beside);
        let mut step = FINEST_STEP;
        while step < COARSEST_STEP && reach > COARSE_CELLS * step as f64 * resolution {
            step *= 2;
        }
        let unit = step as f64 * resolution;
        // beyond it cells cannot be told apart by float64, and grids of the same corners have other numbers of them
        let most = (1_u64 << 50) as f64 * resolution;
        if let Some(far) = [("x", x), ("y", y)].into_iter().find(|(_, at)| at.abs() + reach >= most) {
            let (axis, at) = far;
            return Err(Error::Grid(GridError::Range { axis, min: at - reach, max: at + reach }));
        }
        let coarse = |at: f64| {
            let (low, high) = (((at - reach) / unit).floor() as i64, ((at + reach) / unit).ceil() as i64);
            (low.saturating_sub(1), high.saturating_add(1)) // of a place that no map has; the grid is refused then
        };
        let (coarse_x, coarse_y) = (coarse(x), coarse(y));
        let span = |(low, high): (i64, i64), cell: f64| (low as f64 * cell, high as f64 * cell);
        let cells = |x: (i64, i64), y: (i64, i64), cell: f64| {
            BevGrid::new(span(x, cell), span(y, cell), (cell, cell), SampleAt::Center)
        };
        let seen = Seen::new(self.sees(&cells(coarse_x, coarse_y, unit)?, step as f64)?, coarse_x, coarse_y);
        let (of_tile, step) = ((side / step) as i64, step as i64);
        let tiles = |(low, high): (i64, i64)| low.div_euclid(of_tile)..=(high - 1).div_euclid(of_tile);
        let mut found = Vec::new();
        for (i, j) in tiles(coarse_x).flat_map(|i| tiles(coarse_y).map(move |j| (i, j))) {
            let own = |tile: i64, (low, high): (i64, i64)| (low.max(tile * of_tile), high.min((tile + 1) * of_tile));
            let Some((x, y)) = seen.bounds(own(i, coarse_x), own(j, coarse_y)) else { continue };
            let at = [((i + 1) * of_tile - x.1) * step, ((j + 1) * of_tile - y.1) * step].map(|cell| cell as usize);
            let grid = cells((x.0 * step, x.1 * step), (y.0 * step, y.1 * step), resolution)?;
            buffer::push(WHAT, &mut found, Window { tile: (i, j), at: (at[0], at[1]), grid })?;
        }
        Ok(found)
    }

    /// Metres from the camera beyond which a level road is seen too coarsely, generously.
    ///
    /// From a height h a pixel of 1/f covers r^2 / (h f) of the road ahead at a distance r. Slopes, and lenses that magnify
    /// at their rims, are why it is half as much again.
    fn reach(&self, resolution: f64) -> f64 {
        let [x, y, z] = self.camera.position().into();
        let height = z - self.ground.height_at(x, y);
        let height = if height.is_finite() { height } else { USUAL_HEIGHT };
        let intrinsics = self.camera.intrinsics();
        let focal = intrinsics[(0, 0)].max(intrinsics[(1, 1)]);
        let reach: f64 = 1.5 * (height * focal * resolution / COARSEST).sqrt() + height;
        reach.min(512.0 * 64.0 * resolution)
    }

    /// Which cells of a coarse grid the frame sees well enough for a map whose cells are `finer` times as fine in each
    /// direction, row-major.
    fn sees(&self, coarse: &BevGrid, finer: f64) -> Result<Vec<bool>> {
        // half a diagonal of a coarse cell nearer and farther
        let half = coarse.resolution().0.hypot(coarse.resolution().1) / 2.0;
        let (near, far) = (self.distance.0 - half, self.distance.1 + half);
        let mut seen = self.unmasked_table(coarse, far)?.resolved_mask(COARSEST * finer)?;
        self.keep_within(&mut seen, coarse, (near, far));
        Ok(seen)
    }
}

/// Which cells of a coarse grid are seen, from `low` to before `high` along each axis.
struct Seen {
    cells: Vec<bool>,
    x: (i64, i64),
    y: (i64, i64),
}

impl Seen {
    /// Of a grid's cells, whose first has the largest x and y.
    fn new(mut cells: Vec<bool>, x: (i64, i64), y: (i64, i64)) -> Self {
        cells.reverse(); // now both axes grow
        Self { cells, x, y }
    }

    /// From which cells to before which the cells of a rectangle go that are seen or beside one that is.
    fn bounds(&self, x: (i64, i64), y: (i64, i64)) -> Option<((i64, i64), (i64, i64))> {
        let columns = (self.y.1 - self.y.0) as usize;
        let mut found: Option<((i64, i64), (i64, i64))> = None;
        for row in (x.0 - 1).max(self.x.0)..(x.1 + 1).min(self.x.1) {
            let cells = &self.cells[(row - self.x.0) as usize * columns..][..columns];
            let first = (y.0 - 1).max(self.y.0);
            let cells = &cells[(first - self.y.0) as usize..((y.1 + 1).min(self.y.1) - self.y.0) as usize];
            let Some(low) = cells.iter().position(|&seen| seen) else { continue };
            let high = cells.iter().rposition(|&seen| seen).unwrap_or(low);
            let own = ((row - 1, row + 2), (first + low as i64 - 1, first + high as i64 + 2));
            let ((low_x, high_x), (low_y, high_y)) = found.unwrap_or(own);
            found = Some(((low_x.min(own.0.0), high_x.max(own.0.1)), (low_y.min(own.1.0), high_y.max(own.1.1))));
        }
        let ((low_x, high_x), (low_y, high_y)) = found?;
        Some(((low_x.max(x.0), high_x.min(x.1)), (low_y.max(y.0), high_y.min(y.1))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Camera, Ground, Pinhole};

    fn frame(ground: &Ground, x: f64) -> Frame<'_> {
        let lens = Pinhole::new(240.0, 240.0, 159.5, 89.5, 0.0).unwrap();
        let camera = Camera::from_euler(lens, (320, 180), [x, 0.0, 1.4], 0.0, 0.15, 0.3).unwrap();
        Frame { camera, mask: None, ground, from: [x, 0.0], distance: (1.0, 15.0), weight: 1.0, id: 0 }
    }

    #[test]
    fn windows_lie_in_their_tiles_and_move_with_the_frame() {
        let ground = Ground::default();
        let windows = frame(&ground, -3.0).windows(0.1, 64).unwrap();
        assert!(windows.len() > 3);
        for Window { tile, at, grid } in &windows {
            assert!(at.0 + grid.rows() <= 64 && at.1 + grid.columns() <= 64);
            let end = |tile: i64| (tile + 1) as f64 * 6.4;
            assert!((end(tile.0) - at.0 as f64 * 0.1 - grid.x().1).abs() < 1e-9);
            assert!((end(tile.1) - at.1 as f64 * 0.1 - grid.y().1).abs() < 1e-9);
        }
        let moved = frame(&ground, -3.0 + 640.0).windows(0.1, 64).unwrap();
        let shifted = |one: &Window| ((one.tile.0 + 100, one.tile.1), one.at, one.grid.rows(), one.grid.columns());
        let itself = |one: &Window| (one.tile, one.at, one.grid.rows(), one.grid.columns());
        assert_eq!(windows.iter().map(shifted).collect::<Vec<_>>(), moved.iter().map(itself).collect::<Vec<_>>());
    }

    #[test]
    fn sides_cells_and_places_that_no_map_has_are_refused() {
        let ground = Ground::default();
        for side in [0, 40, 100] {
            let refused = frame(&ground, 0.0).windows(0.1, side);
            assert_eq!(refused, Err(Error::Mosaic(MosaicError::Side { got: side })));
        }
        for resolution in [0.0, -0.1, f64::NAN, f64::INFINITY] {
            assert!(matches!(frame(&ground, 0.0).windows(resolution, 64), Err(Error::Grid(_))), "{resolution}");
        }
        assert!(frame(&ground, 9e11).windows(0.1, 64).is_err());
        let refused = frame(&ground, 9e11).windows(2f64.powi(-20), 64);
        assert!(matches!(refused, Err(Error::Grid(GridError::Range { axis: "x", .. }))), "{refused:?}");
    }
}
