//! Several cameras on one grid: which of them shows a cell best, and one bird's-eye view of all.
//!
//! A [`RigLut`] has the table of each camera, and for each row of the grid *pieces*: neighbouring cells that the same
//! cameras show. Cells of one camera go straight into the output; those of a seam, where
//! several are mixed, through a little memory that stays in the core's own cache. Weights are integers worked out when
//! the table is built, so a view depends neither on threads nor on the order of the cameras.
//!
//! ```
//! use ipm_rs::rig::{RigLut, RigOptions};
//! use ipm_rs::{BevGrid, Camera, Ground, ImageView, Pinhole, SampleAt, WarpOptions};
//!
//! # fn main() -> ipm_rs::Result<()> {
//! let camera = |yaw: f64| {
//!     let lens = Pinhole::new(40.0, 40.0, 31.5, 23.5, 0.0)?;
//!     Camera::from_euler(lens, (64, 48), [0.0, 0.0, 1.5], 0.0, 0.4, yaw)
//! };
//! let cameras = [("front", camera(0.0)?), ("left", camera(0.9)?)];
//! let grid = BevGrid::new((-2.0, 8.0), (-4.0, 8.0), (0.25, 0.25), SampleAt::Center)?;
//! let lut = RigLut::new(&cameras, &grid, &Ground::default(), &RigOptions::default())?;
//! let frames = [vec![50u8; 64 * 48], vec![90u8; 64 * 48]];
//! let images = [ImageView::new(&frames[0], (64, 48), 1)?, ImageView::new(&frames[1], (64, 48), 1)?];
//! let mut bev = vec![0; lut.rows() * lut.columns()];
//! let mut out = ipm_rs::ImageViewMut::new(&mut bev, (lut.columns(), lut.rows()), 1)?;
//! lut.warp_into(&images, &mut out, &WarpOptions::default(), &[])?;
//! assert!(bev.contains(&50) && bev.contains(&90));
//! # Ok(())
//! # }
//! ```

mod adjoint;
mod compose;
pub(crate) mod error;
mod gains;
mod pieces;
mod region;
mod shares;
mod weights;

pub use compose::Mix;

use std::sync::OnceLock;

use crate::camera::Camera;
use crate::error::{Error, Result, RigError};
use crate::grid::BevGrid;
use crate::ground::Ground;
use crate::isa::Isa;
use crate::lut::Lut;
use crate::parallel::check_interrupt;
use crate::raster::{check_polygon, draw_polygon};
use crate::view::{ImageMask, buffer};
use gains::Overlap;
use pieces::{Builder, Pieces};
use region::Region;
use shares::Shares;
use weights::View;

/// What memory is asked for, in errors.
const WHAT: &str = "RigLut";

/// More cameras than any rig has; their numbers are bytes.
pub const MAX_CAMERAS: usize = 64;

/// Which camera shows a cell that several see.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum BlendMode {
    /// The one that resolves the cell best in its worse direction, mixed along seams. The default.
    #[default]
    Best,
    /// All that see it, the more the farther they are from the edge of what they see.
    Feather,
    /// The first one in the rig's order, mixed along seams.
    Priority,
}

/// How a [`RigLut`] is built.
#[derive(Debug, Clone, Default)]
pub struct RigOptions<'a> {
    /// For each camera, which of its pixels show the road, or `None` where all do: own bonnet, image circle.
    pub masks: Vec<Option<&'a ImageMask>>,
    /// Polygons on the ground, (x, y) in metres, that are not to be shown: the own car.
    pub exclude: Vec<Vec<[f64; 2]>>,
    /// Which camera shows what several see.
    pub blend: BlendMode,
    /// Metres across which cameras are mixed along a seam; 0 is a hard one.
    pub feather: f64,
}

/// For every cell of a grid, which cameras show it, where they sample and by what weights: built once, used for every
/// set of images.
#[derive(Clone)]
pub struct RigLut {
    grid: BevGrid,
    /// A table for each camera, in the order of their names, also of cells that others show.
    tables: Vec<Lut>,
    /// For each of these, which camera of the rig it is.
    cameras: Vec<usize>,
    /// For each table which cells it sees that may be shown.
    seen: Vec<Region>,
    pieces: Pieces,
    /// Tables of the cells that each camera shows; made when they are first asked for.
    shown: OnceLock<Vec<Lut>>,
    /// Where pairs of cameras see the same, for their gains; made when they are first asked for.
    overlaps: OnceLock<Vec<Overlap>>,
}

/// Equal are those that show every cell alike.
impl PartialEq for RigLut {
    fn eq(&self, other: &Self) -> bool {
        (self.grid, &self.tables, &self.cameras, &self.pieces)
            == (other.grid, &other.tables, &other.cameras, &other.pieces)
    }
}

impl RigLut {
    /// The table of named cameras on one grid. The result does not depend on their order, but for which comes first
    /// under [`BlendMode::Priority`].
    ///
    /// # Errors
    /// [`RigError`] for no or too many cameras, names that are there twice, masks of another size and a feather that is
    /// none; [`RasterError::Shape`](crate::error::RasterError::Shape) for a polygon that is none, and those
    /// of [`Lut::new`].
    pub fn new(cameras: &[(&str, Camera)], grid: &BevGrid, ground: &Ground, options: &RigOptions<'_>) -> Result<Self> {
        let order = order_of_names(cameras)?;
        check_masks(cameras, &options.masks)?;
        if !options.feather.is_finite() || !(0.0..=1e3).contains(&options.feather) {
            return Err(Error::Rig(RigError::Feather { got: options.feather }));
        }
        let excluded = excluded(&options.exclude, grid)?;
        let mut views = buffer::reserved(WHAT, cameras.len())?;
        for &index in &order {
            let lut = Lut::new(&cameras[index].1, grid, ground)?;
            let mask = options.masks.get(index).copied().flatten();
            let shown = shown_cells(&lut, mask, excluded.as_deref())?;
            views.push(View { seen: Region::seen(&lut, shown.as_deref())?, lut, priority: index });
        }
        let pieces = weights::pieces(&views, grid, options.blend, options.feather)?;
        let (tables, seen) = views.into_iter().map(|view| (view.lut, view.seen)).unzip();
        Ok(Self::of_pieces(*grid, tables, order, seen, pieces))
    }

    fn of_pieces(grid: BevGrid, tables: Vec<Lut>, cameras: Vec<usize>, seen: Vec<Region>, pieces: Pieces) -> Self {
        Self { grid, tables, cameras, seen, pieces, shown: OnceLock::new(), overlaps: OnceLock::new() }
    }

    /// The grid of its cells.
    pub fn grid(&self) -> &BevGrid {
        &self.grid
    }

    /// Rows of the output.
    pub fn rows(&self) -> usize {
        self.grid.rows()
    }

    /// Columns of the output.
    pub fn columns(&self) -> usize {
        self.grid.columns()
    }

    /// How many cameras it is of.
    pub fn cameras(&self) -> usize {
        self.tables.len()
    }

    /// (width, height) of the images of a camera, by its place in the rig.
    ///
    /// # Panics
    /// Where the rig has no such camera.
    pub fn source_size(&self, camera: usize) -> (u32, u32) {
        self.tables[self.table_of(camera)].source_size()
    }

    /// Bytes that tables, pieces and weights hold.
    pub fn nbytes(&self) -> usize {
        let shown = self.shown.get().into_iter().flatten();
        self.tables.iter().chain(shown).map(Lut::nbytes).sum::<usize>() + self.pieces.nbytes()
    }

    /// For each cell the camera that has the largest weight, by its place in the rig; -1 where none sees it.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    pub fn source(&self) -> Result<Vec<i16>> {
        let mut source = buffer::filled(WHAT, self.rows() * self.columns(), -1)?;
        for (row, cells) in source.chunks_mut(self.columns()).enumerate() {
            for piece in self.pieces.row(row).filter(|piece| !piece.tables.is_empty()) {
                cells[piece.first..piece.first + piece.cells].fill(self.cameras[usize::from(piece.tables[0])] as i16);
            }
        }
        Ok(source)
    }

    /// Which cells a camera shows.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    pub fn mask(&self) -> Result<Vec<bool>> {
        let source = self.source()?;
        buffer::collected(WHAT, source.into_iter().map(|camera| camera >= 0))
    }

    /// Which cells a camera sees, by its place in the rig, whether or not another one shows them: not those that are excluded
    /// or where its mask hides the road.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    ///
    /// # Panics
    /// Where the rig has no such camera.
    pub fn seen(&self, camera: usize) -> Result<Vec<bool>> {
        let region = &self.seen[self.table_of(camera)];
        let mut seen = buffer::filled(WHAT, self.rows() * self.columns(), false)?;
        for (row, cells) in seen.chunks_mut(self.columns()).enumerate() {
            for &(first, end) in region.row(row) {
                cells[first as usize..end as usize].fill(true);
            }
        }
        Ok(seen)
    }

    /// The weight of a camera in each cell, from 0 to 1, by its place in the rig. Those of a cell sum to 1.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    ///
    /// # Panics
    /// Where the rig has no such camera.
    pub fn weights(&self, camera: usize) -> Result<Vec<f32>> {
        let table = self.table_of(camera);
        let mut weights = buffer::zeroed::<u32>(WHAT, self.rows() * self.columns())?;
        for (row, weights) in weights.chunks_mut(self.columns()).enumerate() {
            for piece in self.pieces.row(row) {
                piece.write_weights(table, &mut weights[piece.first..piece.first + piece.cells]);
            }
        }
        buffer::collected(WHAT, weights.into_iter().map(|weight| weight as f32 / pieces::ONE as f32))
    }

    /// The table without some cameras, by their places in the rig, whose pictures are missing: cells that they showed with
    /// others go to those, cells that they showed alone to nobody. Those that are left are numbered anew, in their order.
    ///
    /// # Errors
    /// [`RigError::NoImage`] where no camera is left; [`Error::OutOfMemory`].
    pub fn without(&self, missing: &[usize]) -> Result<Self> {
        let left: Vec<usize> = (0..self.cameras()).filter(|camera| !missing.contains(camera)).collect();
        if left.is_empty() {
            return Err(Error::Rig(RigError::NoImage));
        }
        let kept: Vec<usize> = (0..self.cameras()).filter(|&table| left.contains(&self.cameras[table])).collect();
        let columns = self.columns();
        let (mut builder, mut shares, isa) = (Builder::new(columns), Shares::default(), Isa::active()?);
        for row in 0..self.rows() {
            check_interrupt()?;
            for piece in self.pieces.row(row) {
                // the numbers that its tables have from now on, in rising order, and where their weights are
                let mut left: Vec<(u8, usize)> = (piece.tables.iter().enumerate())
                    .filter_map(|(place, &table)| {
                        Some((kept.iter().position(|&kept| kept == usize::from(table))? as u8, place))
                    })
                    .collect();
                left.sort_unstable();
                let (tables, places): (Vec<u8>, Vec<usize>) = left.into_iter().unzip();
                if tables.len() < 2 {
                    builder.alone(piece.first..piece.first + piece.cells, tables.first().copied())?;
                    continue;
                }
                shares.begin(tables.len(), piece.cells)?;
                for (place, &before) in places.iter().enumerate() {
                    let raw = shares.raw(place);
                    match piece.weights_of(before) {
                        Some(weights) => raw.iter_mut().zip(weights).for_each(|(raw, &weight)| *raw = weight.into()),
                        None => raw.fill(pieces::ONE),
                    }
                }
                shares.settle(isa);
                builder.cells(piece.first, &tables, &shares)?;
            }
            builder.end_row()?;
        }
        let cameras = (kept.iter())
            .map(|&table| left.iter().position(|&camera| camera == self.cameras[table]).expect("kept"))
            .collect();
        let tables = kept.iter().map(|&table| self.tables[table].clone()).collect();
        let seen = kept.iter().map(|&table| self.seen[table].clone()).collect();
        Ok(Self::of_pieces(self.grid, tables, cameras, seen, builder.finish()))
    }

    /// For each camera the table of the cells that it shows, for what takes longer the more cells a table has.
    fn shown(&self) -> Result<&[Lut]> {
        if let Some(shown) = self.shown.get() {
            return Ok(shown);
        }
        let (columns, mut all) = (self.columns(), buffer::reserved(WHAT, self.tables.len())?);
        for (table, lut) in self.tables.iter().enumerate() {
            let mut keep = buffer::filled(WHAT, self.rows() * columns, false)?;
            for (row, keep) in keep.chunks_mut(columns).enumerate() {
                let pieces = self.pieces.row(row);
                for piece in pieces.filter(|piece| piece.tables.iter().any(|&shown| usize::from(shown) == table)) {
                    keep[piece.first..piece.first + piece.cells].fill(true);
                }
            }
            all.push(lut.restricted(&keep)?);
        }
        Ok(self.shown.get_or_init(|| all))
    }

    /// Where pairs of cameras see the same.
    fn overlaps(&self) -> Result<&[Overlap]> {
        if let Some(overlaps) = self.overlaps.get() {
            return Ok(overlaps);
        }
        let overlaps = gains::overlaps(&self.tables, &self.seen)?;
        Ok(self.overlaps.get_or_init(|| overlaps))
    }

    fn table_of(&self, camera: usize) -> usize {
        self.cameras.iter().position(|&index| index == camera).expect("a camera of this rig")
    }
}

/// Places of the cameras in the order of their names.
fn order_of_names(cameras: &[(&str, Camera)]) -> Result<Vec<usize>> {
    if cameras.is_empty() || cameras.len() > MAX_CAMERAS {
        return Err(Error::Rig(RigError::CameraCount { got: cameras.len(), limit: MAX_CAMERAS }));
    }
    let mut order: Vec<usize> = (0..cameras.len()).collect();
    order.sort_by_key(|&index| cameras[index].0);
    match order.windows(2).find(|pair| cameras[pair[0]].0 == cameras[pair[1]].0) {
        Some(pair) => Err(Error::Rig(RigError::NameTwice { name: cameras[pair[0]].0.to_owned() })),
        None => Ok(order),
    }
}

fn check_masks(cameras: &[(&str, Camera)], masks: &[Option<&ImageMask>]) -> Result<()> {
    if !masks.is_empty() && masks.len() != cameras.len() {
        return Err(Error::Rig(RigError::MaskCount { got: masks.len() }));
    }
    for ((name, camera), mask) in cameras.iter().zip(masks) {
        let expected = camera.image_size();
        if let Some(mask) = mask
            && mask.size() != expected
        {
            let name = (*name).to_owned();
            return Err(Error::Rig(RigError::MaskSize { name, expected, got: mask.size() }));
        }
    }
    Ok(())
}

/// A label above 0 for cells within one of the polygons.
fn excluded(polygons: &[Vec<[f64; 2]>], grid: &BevGrid) -> Result<Option<Vec<i32>>> {
    if polygons.is_empty() {
        return Ok(None);
    }
    for (index, corners) in polygons.iter().enumerate() {
        check_polygon(corners, index)?;
    }
    let mut labels = buffer::zeroed(WHAT, grid.rows() * grid.columns())?;
    for (index, corners) in polygons.iter().enumerate() {
        draw_polygon(corners, 1, grid, index, &mut labels)?;
    }
    Ok(Some(labels))
}

/// The cells of a table that may be shown: none of the excluded ones, none whose footprint touches a pixel that does not
/// show the road. `None` where all may.
fn shown_cells(lut: &Lut, mask: Option<&ImageMask>, excluded: Option<&[i32]>) -> Result<Option<Vec<bool>>> {
    let mut shown = match mask {
        Some(mask) => Some(lut.unmasked(mask)?),
        None => None,
    };
    if let Some(excluded) = excluded {
        let shown = match &mut shown {
            Some(shown) => shown,
            none => none.insert(buffer::filled(WHAT, excluded.len(), true)?),
        };
        shown.iter_mut().zip(excluded).for_each(|(shown, &label)| *shown &= label == 0);
    }
    Ok(shown)
}

impl std::fmt::Debug for RigLut {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "RigLut({} x {} cells of {} cameras)", self.rows(), self.columns(), self.cameras())
    }
}
