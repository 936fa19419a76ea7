//! The look-up table between a grid and an image: built once, used for every frame.

pub(crate) mod area;
mod build;
mod cells;
mod density;
mod maps;
mod plausibility;

use crate::cpu::Isa;
use crate::error::Result;
use crate::table::Table;
pub(crate) use build::{check_homography, homography_row};

/// For every cell of an output grid, where on a source image it samples: immutable, comparable, cheap to share.
///
/// One table serves images of any dtype, channel count and row stride, nearest and bilinear; see
/// [`Lut::warp_into`](crate::Lut::warp_into).
#[derive(Clone, PartialEq)]
pub struct Lut {
    pub(crate) table: Table,
}

impl Lut {
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

    /// Bytes that the table holds, and from the first use of [`Interpolation::Area`](crate::Interpolation::Area) on those
    /// of what it needs beyond.
    pub fn nbytes(&self) -> usize {
        self.table.nbytes() + self.table.area.get().map_or(0, area::Plan::nbytes)
    }

    /// What `area` needs beyond the table; made by the first call.
    ///
    /// # Errors
    /// [`Error::AreaSize`](crate::Error::AreaSize), [`Error::Isa`](crate::Error::Isa), [`Error::OutOfMemory`](crate::Error::OutOfMemory).
    pub(crate) fn area_plan(&self) -> Result<&area::Plan> {
        match self.table.area.get() {
            Some(plan) => Ok(plan),
            None => Ok(self.table.area.set(area::Plan::new(Isa::active()?, &self.table)?)),
        }
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
