//! Tables from a camera and a grid, from maps, and from a homography.
//!
//! The loops over the coordinates of a row are written without branches and with float64 alone, so that the compiler turns
//! one body into vectors for each instruction set. Every operation is exact or correctly rounded and nothing is fused, so
//! all give the same table to the last bit (decision 0005).

mod bent;
mod heights;
mod pack;
mod projective;
mod surface;
mod window;

use std::ops::Range;

use bent::{BentRow, Offsets};
use nalgebra::{Matrix3, Vector3};
pub(crate) use projective::ProjectiveRow;
use surface::Surface;
use window::Window;

use super::{Lut, Scene};
use crate::camera::Camera;
use crate::error::{Error, LutError, Result, ViewError};
use crate::grid::BevGrid;
use crate::ground::{Ground, Plane};
use crate::isa::Isa;
use crate::kernels::Row;
use crate::table::{BorderMode, Edges, Table};
use crate::view::check_image_size;

/// A disc on the ground, outside which a table need not say anything.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Disc {
    pub(crate) center: [f64; 2],
    pub(crate) radius: f64,
}

impl Disc {
    /// The columns of the row at `x` that lie within it; `ys` of the columns descend.
    fn columns(&self, x: f64, ys: &[f64]) -> Range<usize> {
        let squared = self.radius.powi(2) - (x - self.center[0]).powi(2);
        if squared < 0.0 {
            return 0..0;
        }
        let (middle, half) = (self.center[1], squared.sqrt());
        ys.partition_point(|&y| y > middle + half)..ys.partition_point(|&y| y >= middle - half)
    }
}

/// A row of a grid on a plane road in the camera frame: `origin + step * y`.
struct GroundRow {
    origin: Vector3<f64>,
    step: Vector3<f64>,
}

impl GroundRow {
    /// The road point at (`x`, 0), in the camera frame.
    fn origin(camera: &Camera, plane: &Plane, x: f64) -> Vector3<f64> {
        camera.camera_from_vehicle().transform(&Vector3::new(x, 0.0, plane.height_at(x, 0.0)))
    }

    /// How far a point moves in the camera frame for each metre of y, the same in all rows.
    fn step(camera: &Camera, plane: &Plane) -> Vector3<f64> {
        let rotation = camera.camera_from_vehicle().rotation();
        let [_, _, bank] = plane.coefficients();
        rotation.column(1) + rotation.column(2) * bank
    }

    /// The row's pixels, as a pinhole sees them.
    fn projected(&self, intrinsics: &Matrix3<f64>) -> ProjectiveRow {
        ProjectiveRow { origin: intrinsics * self.origin, step: intrinsics * self.step, culled: true }
    }
}

impl Lut {
    /// The table of a bird's-eye view: each cell of the grid samples the pixel that sees its road point. Cells behind
    /// the camera, outside its lens's domain or outside its image are invalid; nothing wraps. Of a height map, so are
    /// cells where the road is not known, and those that a crest hides; and all cells of a road that passes through the
    /// camera, which sees it edge-on. Of a panorama of 360 degrees the last column of pixels is followed by the first.
    /// [`Lut::plausibility`] says what is odd.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`] where there is no memory for the table, [`IsaError`](crate::error::IsaError) where the
    /// environment variable IPM_RS_ISA names no instruction set that is available. Camera, grid and ground were checked
    /// when they were made.
    pub fn new(camera: &Camera, grid: &BevGrid, ground: &Ground) -> Result<Self> {
        Self::new_with(camera, grid, ground, BorderMode::Constant)
    }

    /// [`Lut::new`], and for cells whose point is seen, but outside the image, the pixels that `mode` has there. The mask
    /// says nothing of these cells: they are not valid in any mode. Cells that no picture shows, because they are behind the
    /// camera or outside its lens's domain, have no pixel in any mode either.
    ///
    /// # Errors
    /// Those of [`Lut::new`], and [`TableError::Transparent`](crate::error::TableError::Transparent).
    pub fn new_with(camera: &Camera, grid: &BevGrid, ground: &Ground, mode: BorderMode) -> Result<Self> {
        Self::build(camera, grid, ground, mode, None)
    }

    /// [`Lut::new`] that says nothing of cells outside a disc.
    ///
    /// # Errors
    /// Those of [`Lut::new`].
    pub(crate) fn within(camera: &Camera, grid: &BevGrid, ground: &Ground, disc: Disc) -> Result<Self> {
        Self::build(camera, grid, ground, BorderMode::Constant, Some(disc))
    }

    fn build(camera: &Camera, grid: &BevGrid, ground: &Ground, mode: BorderMode, disc: Option<Disc>) -> Result<Self> {
        let edges = Edges::new(mode, camera.is_panorama())?;
        let isa = Isa::active()?;
        let ys = Row::collected((0..grid.columns()).map(|column| grid.y_of_column(column as f64)))?;
        let wanted = |row: usize| match &disc {
            Some(disc) => disc.columns(grid.x_of_row(row as f64), &ys[..]),
            None => 0..ys.len(),
        };
        let (shape, intrinsics) = ((grid.rows(), grid.columns()), camera.intrinsics());
        let table = match ground {
            Ground::Plane(plane) => {
                let window = if edges.see_all() { None } else { Window::of(camera) };
                let step = GroundRow::step(camera, plane);
                let rows = window.as_ref().map(|window| window.over(grid, &step));
                let edge_on = plane.is_edge_on(&camera.position());
                let row_and_seen = |row: usize| {
                    let origin = GroundRow::origin(camera, plane, grid.x_of_row(row as f64));
                    let columns = match &rows {
                        _ if edge_on => 0..0,
                        Some(rows) => rows.columns(&origin),
                        None => 0..grid.columns(),
                    };
                    let wanted = wanted(row);
                    let first = columns.start.max(wanted.start);
                    let columns = first..columns.end.min(wanted.end).max(first);
                    (GroundRow { origin, step }, columns)
                };
                match camera.lens() {
                    None => Table::build(shape, camera.image_size(), edges, isa, |row, us, vs| {
                        let (row, seen) = row_and_seen(row);
                        let (us, vs) = (&mut us[seen.clone()], &mut vs[seen.clone()]);
                        row.projected(&intrinsics).fill(isa, &ys[seen.clone()], us, vs);
                        Ok(seen)
                    }),
                    Some(lens) => {
                        let offsets = Offsets::along(&step, &ys)?;
                        Table::build(shape, camera.image_size(), edges, isa, |row, us, vs| {
                            let (row, seen) = row_and_seen(row);
                            let (us, vs) = (&mut us[seen.clone()], &mut vs[seen.clone()]);
                            let row = BentRow { origin: row.origin, step: row.step, intrinsics, lens };
                            row.fill(isa, offsets.of(seen.clone()), us, vs);
                            Ok(seen)
                        })
                    }
                }
            }
            Ground::HeightMap(map) => {
                let surface = Surface::new(camera, map, &ys)?;
                Table::build(shape, camera.image_size(), edges, isa, |row, us, vs| {
                    surface.fill(isa, grid.x_of_row(row as f64), us, vs)?;
                    Ok(wanted(row))
                })
            }
        }?;
        Self::of_table(table).with_scene(Scene::new(*grid, Some((*camera, ground.clone()))))
    }

    /// The table of maps as `cv2.remap` takes them: output cell i samples the source at (`map_x[i]`, `map_y[i]`); NaN
    /// and infinite entries sample nothing. Row-major, `columns` to a row.
    ///
    /// # Errors
    /// [`LutError::MapLength`] where the maps differ in length or are no whole number of rows,
    /// [`ViewError::EmptyImage`] where they are empty, [`ViewError::ImageSize`],
    /// [`TableError::TooManyCells`](crate::error::TableError::TooManyCells), [`Error::OutOfMemory`] and
    /// [`IsaError`](crate::error::IsaError).
    pub fn from_maps<T: Copy + Into<f64> + Sync>(
        map_x: &[T],
        map_y: &[T],
        columns: usize,
        source_size: (u32, u32),
    ) -> Result<Self> {
        Self::from_maps_with(map_x, map_y, columns, source_size, BorderMode::Constant, false)
    }

    /// [`Lut::from_maps`], and for entries outside the image the pixels that `mode` has there; such cells are not valid.
    /// Where the source `wraps`, as a panorama of 360 degrees does, its last column is followed by its first: entries
    /// between the two are inside the image.
    ///
    /// # Errors
    /// Those of [`Lut::from_maps`], and [`TableError::Transparent`](crate::error::TableError::Transparent).
    pub fn from_maps_with<T: Copy + Into<f64> + Sync>(
        map_x: &[T],
        map_y: &[T],
        columns: usize,
        source_size: (u32, u32),
        mode: BorderMode,
        wraps: bool,
    ) -> Result<Self> {
        let edges = Edges::new(mode, wraps)?;
        let source = check_image_size("source_size", source_size.0.into(), source_size.1.into())?;
        let rows = map_x.len().checked_div(columns).unwrap_or(0);
        if rows == 0 {
            return Err(Error::View(ViewError::EmptyImage {
                what: "map_x",
                width: columns,
                height: rows,
                channels: 1,
            }));
        }
        if map_x.len() != map_y.len() || rows * columns != map_x.len() {
            return Err(Error::Lut(LutError::MapLength { expected: map_x.len(), got: map_y.len() }));
        }
        let table = Table::build((rows, columns), source, edges, Isa::active()?, |row, us, vs| {
            let cells = row * columns..(row + 1) * columns;
            us.iter_mut().zip(&map_x[cells.clone()]).for_each(|(u, &map)| *u = map.into());
            vs.iter_mut().zip(&map_y[cells]).for_each(|(v, &map)| *v = map.into());
            Ok(0..columns)
        })?;
        Ok(Self::of_table(table))
    }

    /// The table of a homography that maps output pixel (column, row, 1) to source pixel. Both signs of its third
    /// component sample the image, because a homography's sign is arbitrary; where it is 0 there is nothing.
    ///
    /// # Errors
    /// [`LutError::Homography`] where the matrix is singular or not finite, [`ViewError::ImageSize`],
    /// [`TableError::TooManyCells`](crate::error::TableError::TooManyCells), [`Error::OutOfMemory`] and
    /// [`IsaError`](crate::error::IsaError).
    pub fn from_homography(m: &Matrix3<f64>, size: (u32, u32), source_size: (u32, u32)) -> Result<Self> {
        Self::from_homography_with(m, size, source_size, BorderMode::Constant)
    }

    /// [`Lut::from_homography`], and for what lies outside the image the pixels that `mode` has there; such cells are not
    /// valid.
    ///
    /// # Errors
    /// Those of [`Lut::from_homography`], and [`TableError::Transparent`](crate::error::TableError::Transparent).
    pub fn from_homography_with(
        m: &Matrix3<f64>,
        size: (u32, u32),
        source_size: (u32, u32),
        mode: BorderMode,
    ) -> Result<Self> {
        check_homography(m)?;
        let edges = Edges::new(mode, false)?;
        let size = check_image_size("size", size.0.into(), size.1.into())?;
        let source = check_image_size("source_size", source_size.0.into(), source_size.1.into())?;
        let isa = Isa::active()?;
        let columns = Row::collected((0..size.0 as usize).map(|column| column as f64))?;
        let table = Table::build((size.1 as usize, size.0 as usize), source, edges, isa, |row, us, vs| {
            homography_row(m, row).fill(isa, &columns, us, vs);
            Ok(0..columns.len())
        })?;
        Ok(Self::of_table(table))
    }
}

/// Refuses what maps the plane to a line or to nothing.
pub(crate) fn check_homography(m: &Matrix3<f64>) -> Result<()> {
    let problem = if m.iter().any(|value| !value.is_finite()) {
        "an entry is NaN or infinite"
    } else if is_singular(m) {
        "its determinant is 0"
    } else {
        return Ok(());
    };
    let got = std::array::from_fn(|row| std::array::from_fn(|column| m[(row, column)]));
    Err(Error::Lut(LutError::Homography { got, problem }))
}

/// Row `row` of the output under a homography from output pixel to source pixel.
pub(crate) fn homography_row(m: &Matrix3<f64>, row: usize) -> ProjectiveRow {
    ProjectiveRow { origin: m.column(1) * row as f64 + m.column(2), step: m.column(0).into(), culled: false }
}

/// Whether a matrix maps the plane to a line or a point, whatever the units of its rows and columns.
fn is_singular(m: &Matrix3<f64>) -> bool {
    /// |det| of a matrix whose rows and columns all have a largest entry of about 1; rounding leaves 1e-16 of a 0.
    const SMALLEST: f64 = 1e-13;
    let mut balanced = *m;
    for mut row in balanced.row_iter_mut() {
        row /= row.amax();
    }
    for mut column in balanced.column_iter_mut() {
        column /= column.amax();
    }
    let det = balanced.determinant().abs();
    det.is_nan() || det <= SMALLEST // a row or column of zeros has become NaN
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn singular_is_told_from_merely_badly_scaled() {
        let matrix = |entries: [f64; 9]| Matrix3::from_row_slice(&entries);
        for singular in
            [[0.0; 9], [1.0; 9], [0.1, 0.2, 0.3, 0.2, 0.4, 0.6, 0.7, 0.8, 0.9], [1., 0., 0., 0., 1., 0., 0., 0., 0.]]
        {
            assert!(is_singular(&matrix(singular)), "{singular:?}");
        }
        for regular in
            [[1e-4, 0.0, 1e6, 0.0, 1e-4, 1e6, 0.0, 0.0, 1.0], [1e-200, 0., 0., 0., 1e-200, 0., 0., 0., 1e-200]]
        {
            assert!(!is_singular(&matrix(regular)), "{regular:?}");
        }
    }
}
