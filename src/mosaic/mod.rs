//! Frames of a drive on one map: integer accumulators of square tiles.
//!
//! A frame is a camera placed in the map. Each tile that it sees well has a table of its own, so an image is sampled once,
//! from its pixels to the map's cells. What is added depends on the frame and the tile alone.
//!
//! ```
//! use ipm_rs::mosaic::{Frame, Kept, Layers, Tile};
//! use ipm_rs::{BevGrid, Camera, Ground, ImageView, Pinhole, SampleAt};
//!
//! # fn main() -> ipm_rs::Result<()> {
//! const SIDE: usize = 40; // cells of a tile of 10 x 10 m, ahead of the camera
//! let window = BevGrid::new((2.0, 12.0), (-5.0, 5.0), (0.25, 0.25), SampleAt::Center)?;
//! let (mut weights, mut totals, mut counts) = (vec![0; SIDE * SIDE], vec![0; SIDE * SIDE], vec![0; SIDE * SIDE]);
//! let (mut sums, mut squares) = (vec![0; SIDE * SIDE], vec![0; SIDE * SIDE]);
//! let (mut resolutions, mut bests) = (vec![0; SIDE * SIDE], vec![0u8; SIDE * SIDE]);
//! let layers = Layers {
//!     weights: &mut weights, totals: &mut totals, counts: &mut counts, sums: &mut sums, squares: &mut squares,
//!     resolutions: &mut resolutions, bests: &mut bests, keys: &mut [], samples: &mut [],
//! };
//! let lens = Pinhole::new(80.0, 80.0, 63.5, 47.5, 0.0)?;
//! let camera = Camera::from_euler(lens, (128, 96), [0.0, 0.0, 1.5], 0.0, 0.3, 0.0)?;
//! let (ground, distance) = (Ground::default(), (0.0, 20.0));
//! let frame = Frame { camera, mask: None, ground: &ground, from: [0.0, 0.0], distance, weight: 1.0, id: 0 };
//! let kept = Kept { channels: 1, samples: 0, labels: false };
//! let pixels = vec![77u8; 128 * 96];
//! let image = ImageView::new(&pixels, (128, 96), 1)?;
//! let counted = frame.add(&image, &window, Tile::new(SIDE, kept, layers)?, (0, 0), None)?;
//! assert!(counted > 500);
//! assert!(weights.iter().zip(&totals).all(|(weight, total)| *total == 77 * weight));
//! # Ok(())
//! # }
//! ```

mod accumulate;
pub(crate) mod error;
mod tile;

pub use tile::{Kept, Layers, Tile, Value};

use crate::camera::Camera;
use crate::error::{Error, MosaicError, Result};
use crate::grid::BevGrid;
use crate::ground::Ground;
use crate::isa::Isa;
use crate::lut::{Disc, Lut, Resolution};
use crate::parallel::{self, Work};
use crate::view::{ImageMask, ImageView, ImageViewMut, buffer};
use crate::warp::{Interpolation, WarpOptions};
use accumulate::{COARSEST, Cells, ID_BITS, Scratch, WHOLE, Weights};

const WHAT: &str = "mosaic";

/// A frame's camera in the map.
#[derive(Clone)]
pub struct Frame<'a> {
    /// The camera, placed in the map: its vehicle frame is the map.
    pub camera: Camera,
    /// Which pixels show the road, where some do not.
    pub mask: Option<&'a ImageMask>,
    /// The road, in the map.
    pub ground: &'a Ground,
    /// (x, y) of the place in the map from which distances are measured.
    pub from: [f64; 2],
    /// Cells nearer than the first number of metres are left out, and those as far as the second, or farther.
    pub distance: (f64, f64),
    /// How much the frame counts, above 0 and up to 1.
    pub weight: f64,
    /// What tells it from other frames, where samples are kept; all but 20 bits are left out.
    pub id: u32,
}

impl Frame<'_> {
    /// The table of the cells of a window that the camera sees.
    fn table(&self, window: &BevGrid) -> Result<Lut> {
        // what is too far away does not count: a fifth of the windows, which need not be sampled. Two cells more, so that
        // the cells at the rim have neighbours, and a footprint
        let (along, across) = window.resolution();
        let disc = Disc { center: self.from, radius: self.distance.1 + 2.0 * along.max(across) };
        let lut = Lut::within(&self.camera, window, self.ground, disc)?;
        match self.mask {
            Some(mask) => lut.masked(mask),
            None => Ok(lut),
        }
    }

    /// Which cells of a coarse grid the frame sees well enough for a mosaic whose cells are `finer` times as fine in each
    /// direction, row-major: from these follows which tiles, and which part of them, are worth a table. The mask is not
    /// looked at.
    ///
    /// # Errors
    /// Those of [`Lut::new`] and of [`Lut::resolved_mask`].
    pub fn sees(&self, coarse: &BevGrid, finer: f64) -> Result<Vec<bool>> {
        let mut seen = Lut::new(&self.camera, coarse, self.ground)?.resolved_mask(COARSEST * finer)?;
        // half a diagonal of a coarse cell nearer and farther
        let half = coarse.resolution().0.hypot(coarse.resolution().1) / 2.0;
        self.keep_within(&mut seen, coarse, (self.distance.0 - half, self.distance.1 + half));
        Ok(seen)
    }

    /// What the frame shows of a window, and where: in cells that it resolves with at least `least` pixels and whose distance
    /// counts. Averages are those of [`Interpolation::Area`].
    ///
    /// # Errors
    /// Those of [`Lut::new`], [`Lut::warp`] and [`Lut::resolved_mask`].
    pub fn shows<T: Value>(
        &self,
        image: &ImageView<'_, T>,
        window: &BevGrid,
        least: f64,
        threads: Option<usize>,
    ) -> Result<(Vec<T>, Vec<bool>)> {
        let lut = self.table(window)?;
        let options = WarpOptions { interpolation: Interpolation::Area, threads, ..WarpOptions::default() };
        let values = lut.warp(image, &options)?;
        let mut seen = lut.resolved_mask(least)?;
        self.keep_within(&mut seen, window, self.distance);
        Ok((values, seen))
    }

    /// Leaves those cells of a grid whose distance is between two.
    fn keep_within(&self, seen: &mut [bool], grid: &BevGrid, (near, far): (f64, f64)) {
        for (row, seen) in seen.chunks_mut(grid.columns()).enumerate() {
            let x = grid.x_of_row(row as f64) - self.from[0];
            for (column, seen) in seen.iter_mut().enumerate() {
                let y = grid.y_of_column(column as f64) - self.from[1];
                let squared = x * x + y * y;
                *seen &= squared >= near * near.abs() && squared < far * far; // a near one below 0 leaves out nothing
            }
        }
    }

    /// Adds what the frame shows of a window of a tile, whose first cell is the tile's cell `at` (row, column). Returns how
    /// many cells counted. Averages are those of [`Interpolation::Area`]; of labels each cell has the most frequent one.
    ///
    /// # Errors
    /// [`MosaicError`], and those of [`Lut::new`] and [`Lut::warp`]; nothing has been added then.
    pub fn add<T: Value>(
        &self,
        image: &ImageView<'_, T>,
        window: &BevGrid,
        tile: Tile<'_, T>,
        at: (usize, usize),
        threads: Option<usize>,
    ) -> Result<usize> {
        let (rows, columns, side, kept) = (window.rows(), window.columns(), tile.side, tile.kept);
        let channels = kept.channels;
        if image.channels() != channels {
            return Err(Error::Mosaic(MosaicError::Channels { expected: channels, got: image.channels() }));
        }
        if at.0 + rows > side || at.1 + columns > side {
            return Err(Error::Mosaic(MosaicError::Window { side, rows, columns, at }));
        }
        let lut = self.table(window)?;
        let options = WarpOptions { interpolation: Interpolation::Area, threads, ..WarpOptions::default() };
        let values = if kept.labels {
            let mut values = buffer::filled(WHAT, rows * columns * channels, T::default())?;
            let out = ImageViewMut::new(&mut values, (columns, rows), channels)?;
            lut.warp_many_mode_into(&[*image], &mut [out], &options)?;
            values
        } else {
            lut.warp(image, &options)?
        };
        let threads = Work::bytes(rows * columns * (24 + (32 + 4 * kept.samples) * channels)).threads(threads)?;
        let band_rows = parallel::rows_per_band(rows, columns, threads);
        let mut bands = buffer::reserved(WHAT, rows.div_ceil(band_rows))?;
        let (_, mut left) = tile.layers.split(at.0 * side, kept);
        for first in (0..rows).step_by(band_rows) {
            let count = band_rows.min(rows - first);
            let (layers, below) = left.split(count * side, kept);
            bands.push(Band { layers, rows: first..first + count, counted: 0 });
            left = below;
        }
        let whole = ((self.weight * f64::from(WHOLE)).round() as u32).clamp(1, WHOLE);
        let id = 1 + self.id % ((1 << ID_BITS) - 1); // 0 is of no frame
        let weights = Weights::new(whole)?;
        let mut y_squared = buffer::reserved(WHAT, columns)?;
        y_squared.extend((0..columns).map(|column| (window.y_of_column(column as f64) - self.from[1]).powi(2)));
        let shared = Shared {
            frame: self,
            lut: &lut,
            window,
            values: &values,
            kept,
            side,
            column: at.1,
            weights: &weights,
            y_squared: &y_squared,
            id,
        };
        parallel::for_each(threads, bands.iter_mut(), |band: &mut Band<'_, T>| band.add(&shared))?;
        Ok(bands.iter().map(|band| band.counted).sum())
    }
}

/// What all bands of a window need.
struct Shared<'a, T> {
    frame: &'a Frame<'a>,
    lut: &'a Lut,
    window: &'a BevGrid,
    values: &'a [T],
    kept: Kept,
    side: usize,
    column: usize,
    weights: &'a Weights,
    /// Of each column, how far it is away along y.
    y_squared: &'a [f64],
    id: u32,
}

/// Some rows of a window, and the tile's layers there.
struct Band<'a, T> {
    layers: Layers<'a, T>,
    rows: std::ops::Range<usize>,
    counted: usize,
}

impl<T: Value> Band<'_, T> {
    fn add(&mut self, shared: &Shared<'_, T>) -> Result<()> {
        let &Shared { frame, lut, window, values, kept, side, column, weights, y_squared, id } = shared;
        let (isa, columns) = (Isa::active()?, window.columns());
        let mut resolution = Resolution::of(lut)?;
        let mut resolutions = buffer::zeroed::<f32>(WHAT, columns)?;
        let mut scratch = Scratch::new(columns)?;
        for (below, row) in self.rows.clone().enumerate() {
            let x = window.x_of_row(row as f64) - frame.from[0];
            for span in lut.table().row(row).filter(|span| span.kind.is_valid()) {
                let cells = span.first..span.first + span.cells;
                let resolutions = &mut resolutions[..span.cells];
                resolution.read(row, cells.clone(), resolutions)?;
                let first = below * side + column + span.first;
                let numbers =
                    (row * columns + cells.start) * kept.channels..(row * columns + cells.end) * kept.channels;
                self.counted += Cells {
                    layers: self.layers.cells(first..first + span.cells, kept),
                    kept,
                    values: &values[numbers],
                    resolutions,
                    x_squared: x * x,
                    y_squared: &y_squared[cells],
                    distance: frame.distance,
                    weights,
                    id,
                    scratch: &mut scratch,
                }
                .add(isa);
            }
        }
        Ok(())
    }
}
