//! The look-up table between a grid and an image: built once, used for every frame.

mod build;
mod cells;
mod density;
mod derived;
pub(crate) mod error;
pub(crate) mod footprint;
mod maps;
mod plausibility;
mod scene;

use std::io::BufRead;

use crate::camera::Camera;
use crate::error::{Error, Result, TableError};
use crate::grid::BevGrid;
use crate::ground::Ground;
use crate::table::{BorderMode, Table};
pub(crate) use build::{Disc, check_homography, homography_row};
pub(crate) use density::Resolution;
pub(crate) use derived::Derivative;
use derived::Derived;
pub(crate) use scene::Scene;

/// For every cell of an output grid, where on a source image it samples: immutable, comparable, cheap to share.
///
/// One table serves images of any dtype, channel count and row stride, nearest and bilinear; see
/// [`Lut::warp_into`](crate::Lut::warp_into). Two are equal where every cell samples alike, whatever they were built from.
#[derive(Clone)]
pub struct Lut {
    table: Table,
    scene: Option<Box<Scene>>,
    derived: Derived,
}

impl PartialEq for Lut {
    fn eq(&self, other: &Self) -> bool {
        self.table == other.table
    }
}

impl Lut {
    /// The table as bytes, the same on every machine; not what it was built from.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`](crate::Error::OutOfMemory) and [`Error::Interrupted`](crate::Error::Interrupted).
    pub fn to_bytes(&self) -> Result<Vec<u8>> {
        self.table.to_bytes()
    }

    /// A table from [`Lut::to_bytes`]. Every bound that the kernels rely on is proved again, so that no bytes, however
    /// damaged or forged, make a warp read outside an image.
    ///
    /// # Errors
    /// [`TableError::Damaged`], and [`Error::OutOfMemory`](crate::Error::OutOfMemory).
    pub fn from_bytes(bytes: &[u8]) -> Result<Self> {
        Self::read_from(bytes, bytes.len() as u64)
    }

    /// A table from the next `length` bytes of a file, as [`Lut::from_bytes`]. They are read piece by piece, with no buffer
    /// for all of them.
    ///
    /// # Errors
    /// Those of [`Lut::from_bytes`], and [`TableError::Unreadable`].
    pub fn read_from(input: impl BufRead, length: u64) -> Result<Self> {
        Ok(Self::of_table(Table::read(input, length)?))
    }

    /// Rows of the output.
    pub fn rows(&self) -> usize {
        self.table.rows()
    }

    /// Columns of the output.
    pub fn columns(&self) -> usize {
        self.table.columns()
    }

    /// (width, height) of the images it is for.
    pub fn source_size(&self) -> (u32, u32) {
        self.table.source()
    }

    /// What cells take whose place is outside the image. None of these is valid.
    pub fn border_mode(&self) -> BorderMode {
        self.table.edges().mode
    }

    /// Whether the source's last column is followed by its first, as in a panorama of 360 degrees.
    pub fn source_wraps(&self) -> bool {
        self.table.edges().wraps
    }

    /// Bytes that the table holds, and those of what interpolations need beyond, from their first use on:
    /// [`Interpolation::Area`](crate::Interpolation::Area), and [`Interpolation::Nearest`](crate::Interpolation::Nearest)
    /// with AVX2 (4 bytes a cell).
    pub fn nbytes(&self) -> usize {
        self.table.nbytes() + self.derived.nbytes()
    }

    /// What follows from the table; made by the first call.
    ///
    /// # Errors
    /// Those of `make`.
    pub(crate) fn derived<T: Derivative>(&self, make: impl FnOnce(&Table) -> Result<T>) -> Result<&T> {
        self.derived.get_or_make(&self.table, make)
    }

    /// The camera that the table is of; none where it was made of maps, of a homography or of pairs of points.
    pub fn camera(&self) -> Option<&Camera> {
        self.scene.as_ref()?.camera()
    }

    /// The grid of its cells; none where it was made of maps or of a homography.
    pub fn grid(&self) -> Option<&BevGrid> {
        self.scene.as_ref().map(|scene| scene.grid())
    }

    /// The road that its camera looks at; none where there is no camera.
    pub fn ground(&self) -> Option<&Ground> {
        self.scene.as_ref()?.ground()
    }

    /// A table of plain coordinates.
    fn of_table(table: Table) -> Self {
        Self { table, scene: None, derived: Derived::default() }
    }

    /// This table as that of a scene: of this camera, grid and road.
    ///
    /// # Errors
    /// [`TableError::Damaged`] where their sizes differ.
    pub(crate) fn with_scene(self, scene: Scene) -> Result<Self> {
        let (cells, source) = ((self.rows(), self.columns()), self.source_size());
        if (scene.grid().rows(), scene.grid().columns()) != cells
            || scene.camera().is_some_and(|camera| camera.image_size() != source)
        {
            return Err(Error::Table(TableError::Damaged { problem: "it is not the table of its camera and grid" }));
        }
        Ok(Self { scene: Some(Box::new(scene)), ..self })
    }

    /// The table of some of its cells, those for which `keep` is true, said to be of the same scene.
    pub(crate) fn restricted(&self, keep: &[bool]) -> Result<Self> {
        Ok(Self { scene: self.scene.clone(), ..Self::of_table(self.table.restricted(keep)?) })
    }

    pub(crate) fn table(&self) -> &Table {
        &self.table
    }
}

impl std::fmt::Debug for Lut {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (width, height) = self.source_size();
        write!(
            f,
            "Lut({} x {} cells from {width} x {height} pixels, {} bytes)",
            self.rows(),
            self.columns(),
            self.nbytes()
        )
    }
}
