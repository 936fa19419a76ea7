//! Frames of a drive on one map: integer accumulators of square tiles.
//!
//! A frame is a camera placed in the map. Each tile that it sees well has a table of its own, so an image is sampled once,
//! from its pixels to the map's cells. What is added depends on the frame and the tile alone.
//!
//! The sums of a tile are large beside what a frame brings: 39 bytes a grey cell that are read and written, for 3. So
//! [`Frame::contribution`] and [`Tile::add`] are apart: several frames wait, and are added row by row at once.
//!
//! ```
//! use ipm_rs::mosaic::{Frame, Kept, OwnedTile};
//! use ipm_rs::{BevGrid, Camera, Ground, ImageView, Pinhole, SampleAt};
//!
//! # fn main() -> ipm_rs::Result<()> {
//! const SIDE: usize = 40; // cells of a tile of 10 x 10 m, ahead of the camera
//! let window = BevGrid::new((2.0, 12.0), (-5.0, 5.0), (0.25, 0.25), SampleAt::Center)?;
//! let kept = Kept { channels: 1, samples: 0, labels: false };
//! let mut tile = OwnedTile::new(SIDE, kept)?;
//! let lens = Pinhole::new(80.0, 80.0, 63.5, 47.5, 0.0)?;
//! let camera = Camera::from_euler(lens, (128, 96), [0.0, 0.0, 1.5], 0.0, 0.3, 0.0)?;
//! let (ground, distance) = (Ground::default(), (0.0, 20.0));
//! let frame = Frame { camera, mask: None, ground: &ground, from: [0.0, 0.0], distance, weight: 1.0, id: 0 };
//! let pixels = vec![77u8; 128 * 96];
//! let image = ImageView::new(&pixels, (128, 96), 1)?;
//! let counted = frame.add(&image, &window, tile.tile()?, (0, 0), None)?;
//! assert!(counted > 500);
//! assert!(tile.weights.iter().zip(&tile.totals).all(|(weight, total)| *total == 77 * weight));
//! # Ok(())
//! # }
//! ```

mod accumulate;
mod contribution;
pub(crate) mod error;
mod owned;
mod tile;
mod windows;

pub use contribution::Contribution;
pub use owned::OwnedTile;
pub use tile::{Kept, Layers, Tile, Value};
pub use windows::Window;

use crate::camera::Camera;
use crate::error::Result;
use crate::grid::BevGrid;
use crate::ground::Ground;
use crate::lut::{Disc, Lut};
use crate::view::{ImageMask, ImageView, ImageViewMut, buffer};
use crate::warp::{Interpolation, WarpOptions};

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
        let lut = self.unmasked_table(window, self.distance.1)?;
        match self.mask {
            Some(mask) => lut.masked(mask),
            None => Ok(lut),
        }
    }

    /// The table of the cells of a grid up to so many metres away, whatever the mask hides.
    fn unmasked_table(&self, grid: &BevGrid, far: f64) -> Result<Lut> {
        // what is too far away does not count: a fifth of the windows, which need not be sampled. Two cells more, so that
        // the cells at the rim have neighbours, and a footprint
        let (along, across) = grid.resolution();
        let disc = Disc { center: self.from, radius: far + 2.0 * along.max(across) };
        Lut::within(&self.camera, grid, self.ground, disc)
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
        let values = self.values(image, &lut, false, threads)?;
        let mut seen = lut.resolved_mask(least)?;
        self.keep_within(&mut seen, window, self.distance);
        Ok((values, seen))
    }

    /// What the picture shows of each cell of a table: the average over it, or of `labels` the most frequent one.
    fn values<T: Value>(
        &self,
        image: &ImageView<'_, T>,
        lut: &Lut,
        labels: bool,
        threads: Option<usize>,
    ) -> Result<Vec<T>> {
        let options = WarpOptions { interpolation: Interpolation::Area, threads, ..WarpOptions::default() };
        if !labels {
            return lut.warp(image, &options);
        }
        let size = (lut.columns(), lut.rows());
        let mut values = buffer::filled(WHAT, size.0 * size.1 * image.channels(), T::default())?;
        lut.warp_many_mode_into(&[*image], &mut [ImageViewMut::new(&mut values, size, image.channels())?], &options)?;
        Ok(values)
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
    /// many cells counted.
    ///
    /// # Errors
    /// Those of [`Frame::contribution`] and of [`Tile::add`]; nothing has been added then.
    pub fn add<T: Value>(
        &self,
        image: &ImageView<'_, T>,
        window: &BevGrid,
        mut tile: Tile<'_, T>,
        at: (usize, usize),
        threads: Option<usize>,
    ) -> Result<usize> {
        let contribution = self.contribution(image, window, at, tile.kept.labels, threads)?;
        tile.add(std::slice::from_ref(&contribution), threads)?;
        Ok(contribution.counted())
    }
}
