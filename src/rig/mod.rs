//! Several cameras on one grid: which of them shows a cell best, and one bird's-eye view of all.
//!
//! A [`RigLut`] has a table for each camera, of the cells that it shows, and for each row of the grid *pieces*:
//! neighbouring cells that the same cameras show. Cells of one camera go straight into the output; those of a seam, where
//! several are mixed, through a little memory that stays in the core's own cache. Weights are integers worked out when
//! the table is built, so a view depends neither on threads nor on the order of the cameras.

mod compose;
mod gains;
mod pieces;
mod weights;

pub use compose::Mix;

use crate::camera::Camera;
use crate::error::{Error, Result};
use crate::grid::BevGrid;
use crate::ground::Ground;
use crate::lut::Lut;
use crate::parallel;
use crate::raster::{check_polygon, draw_polygon};
use crate::view::{ImageView, buffer};
use crate::warp::{Interpolation, WarpOptions};
use gains::Overlap;
use pieces::Pieces;
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
    /// For each camera, which of its pixels show the road (row-major), or `None` where all do: own bonnet, image circle.
    pub masks: Vec<Option<&'a [bool]>>,
    /// Polygons on the ground, (x, y) in metres, that are not to be shown: the own car.
    pub exclude: Vec<Vec<[f64; 2]>>,
    /// Which camera shows what several see.
    pub blend: BlendMode,
    /// Metres across which cameras are mixed along a seam; 0 is a hard one.
    pub feather: f64,
}

/// For every cell of a grid, which cameras show it, where they sample and by what weights: built once, used for every
/// set of images.
#[derive(Clone, PartialEq)]
pub struct RigLut {
    grid: BevGrid,
    /// A table for each camera, in the order of their names, of the cells that it shows.
    tables: Vec<Lut>,
    /// For each of these, which camera of the rig it is.
    cameras: Vec<usize>,
    pieces: Pieces,
    /// Where pairs of cameras see the same, for their gains.
    overlaps: Vec<Overlap>,
}

impl RigLut {
    /// The table of named cameras on one grid. The result does not depend on their order, but for which comes first
    /// under [`BlendMode::Priority`].
    ///
    /// # Errors
    /// [`Error::Rig`] for no or too many cameras, names that are there twice, and masks of another size;
    /// [`Error::Shape`] for a polygon that is none, [`Error::NotFinite`] for `feather`, and those of [`Lut::new`].
    pub fn new(cameras: &[(&str, Camera)], grid: &BevGrid, ground: &Ground, options: &RigOptions<'_>) -> Result<Self> {
        let order = order_of_names(cameras)?;
        check_masks(cameras, &options.masks)?;
        if !options.feather.is_finite() || !(0.0..=1e3).contains(&options.feather) {
            return Err(Error::Rig { expected: "feather from 0 to 1000 metres", got: format!("{}", options.feather) });
        }
        let excluded = excluded(&options.exclude, grid)?;
        let mut luts = buffer::reserved(WHAT, cameras.len())?;
        let mut views = buffer::reserved(WHAT, cameras.len())?;
        for &index in &order {
            let camera = &cameras[index].1;
            let lut = Lut::new(camera, grid, ground)?;
            let mut seen = lut.mask()?;
            if let Some(Some(mask)) = options.masks.get(index) {
                keep_unmasked(&lut, mask, &mut seen)?;
            }
            if let Some(excluded) = &excluded {
                seen.iter_mut().zip(excluded).for_each(|(seen, &label)| *seen &= label == 0);
            }
            views.push(View { seen, resolution: lut.resolution()?, priority: index });
            luts.push(lut);
        }
        let overlaps = gains::overlaps(&luts, &views)?;
        let weights = weights::of(&views, grid, options.blend, options.feather)?;
        drop(views);
        let mut tables = buffer::reserved(WHAT, cameras.len())?;
        for (lut, weights) in luts.into_iter().zip(&weights) {
            let keep = buffer::collected(WHAT, weights.iter().map(|&weight| weight > 0))?;
            tables.push(lut.restricted(&keep)?);
        }
        let pieces = Pieces::new(&weights, grid.rows(), grid.columns())?;
        Ok(Self { grid: *grid, tables, cameras: order, pieces, overlaps })
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
    pub fn source_size(&self, camera: usize) -> (u32, u32) {
        self.tables[self.table_of(camera)].source_size()
    }

    /// Bytes that tables, pieces and weights hold.
    pub fn nbytes(&self) -> usize {
        self.tables.iter().map(Lut::nbytes).sum::<usize>() + self.pieces.nbytes()
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

    /// The weight of a camera in each cell, from 0 to 1, by its place in the rig. Those of a cell sum to 1.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
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
    /// [`Error::Rig`] where no camera is left; [`Error::OutOfMemory`].
    pub fn without(&self, missing: &[usize]) -> Result<Self> {
        let left: Vec<usize> = (0..self.cameras()).filter(|camera| !missing.contains(camera)).collect();
        if left.is_empty() {
            return Err(Error::Rig { expected: "at least one camera whose picture is there", got: "none".to_owned() });
        }
        let kept: Vec<usize> = (0..self.cameras()).filter(|&table| left.contains(&self.cameras[table])).collect();
        let cells = self.rows() * self.columns();
        let mut raw = buffer::reserved(WHAT, kept.len())?;
        for &table in &kept {
            let mut weights = buffer::zeroed::<u32>(WHAT, cells)?;
            for (row, weights) in weights.chunks_mut(self.columns()).enumerate() {
                for piece in self.pieces.row(row) {
                    piece.write_weights(table, &mut weights[piece.first..piece.first + piece.cells]);
                }
            }
            raw.push(weights);
        }
        let weights = weights::shares(&raw, cells)?;
        let number = |table: usize| kept.iter().position(|&kept| kept == table);
        let overlaps = self.overlaps.iter().filter_map(|overlap| overlap.renumbered(number)).collect();
        Ok(Self {
            grid: self.grid,
            tables: kept.iter().map(|&table| self.tables[table].clone()).collect(),
            cameras: (kept.iter())
                .map(|&table| left.iter().position(|&camera| camera == self.cameras[table]).expect("kept"))
                .collect(),
            pieces: Pieces::new(&weights, self.rows(), self.columns())?,
            overlaps,
        })
    }

    fn table_of(&self, camera: usize) -> usize {
        self.cameras.iter().position(|&index| index == camera).expect("a camera of this rig")
    }
}

/// Places of the cameras in the order of their names.
fn order_of_names(cameras: &[(&str, Camera)]) -> Result<Vec<usize>> {
    if cameras.is_empty() || cameras.len() > MAX_CAMERAS {
        return Err(Error::Rig { expected: "1 to 64 cameras", got: format!("{}", cameras.len()) });
    }
    let mut order: Vec<usize> = (0..cameras.len()).collect();
    order.sort_by_key(|&index| cameras[index].0);
    match order.windows(2).find(|pair| cameras[pair[0]].0 == cameras[pair[1]].0) {
        Some(pair) => Err(Error::Rig {
            expected: "a name of its own for each camera",
            got: format!("{:?} twice", cameras[pair[0]].0),
        }),
        None => Ok(order),
    }
}

fn check_masks(cameras: &[(&str, Camera)], masks: &[Option<&[bool]>]) -> Result<()> {
    if !masks.is_empty() && masks.len() != cameras.len() {
        return Err(Error::Rig { expected: "a mask, or none, for each camera", got: format!("{} masks", masks.len()) });
    }
    for ((name, camera), mask) in cameras.iter().zip(masks) {
        let (width, height) = camera.image_size();
        if let Some(mask) = mask
            && mask.len() != width as usize * height as usize
        {
            return Err(Error::Rig {
                expected: "masks of the size of their images",
                got: format!("{} pixels for {name:?} of {width} x {height}", mask.len()),
            });
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

/// Takes out the cells whose footprint touches a pixel that does not show the road.
fn keep_unmasked(lut: &Lut, mask: &[bool], seen: &mut [bool]) -> Result<()> {
    let (width, height) = lut.source_size();
    let shown: Vec<u8> = buffer::collected(WHAT, mask.iter().map(|&shown| if shown { u8::MAX } else { 0 }))?;
    let image = ImageView::new(&shown, (width as usize, height as usize), 1)?;
    let options = WarpOptions { interpolation: Interpolation::Area, ..WarpOptions::default() };
    let whole = lut.warp(&image, &options)?;
    seen.iter_mut().zip(whole).for_each(|(seen, whole)| *seen &= whole == u8::MAX);
    Ok(())
}

impl std::fmt::Debug for RigLut {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "RigLut({} x {} cells of {} cameras)", self.rows(), self.columns(), self.cameras())
    }
}

/// Threads for work on so many cells.
fn threads_for(cells: usize) -> usize {
    const INLINE_CELLS: usize = 1 << 13;
    if cells < INLINE_CELLS { 1 } else { parallel::num_threads() }
}
