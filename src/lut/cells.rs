//! Cells of a grid on the image, as a table samples them.

use nalgebra::{Matrix3, Vector3};

use super::build::{ProjectiveRow, check_homography};
use super::{Lut, Scene};
use crate::camera::{Camera, Projection};
use crate::error::{Error, PointsError, Result};
use crate::geometry::homography_from_points;
use crate::grid::BevGrid;
use crate::ground::Ground;
use crate::isa::Isa;
use crate::kernels::Row;
use crate::table::{BorderMode, Edges, Table};
use crate::view::check_image_size;

impl Camera {
    /// Where a table of this camera, grid and road samples the image for a cell (row, column), whole at the samples;
    /// also between cells and outside the grid.
    pub fn project_cell(&self, cell: [f64; 2], grid: &BevGrid, ground: &Ground) -> Projection {
        self.project_ground(grid.ground_from_cell(cell), ground)
    }

    /// The cell (row, column) that shows what a pixel sees, fractional and also outside the grid: the inverse of
    /// [`Camera::project_cell`]. `None` where the pixel sees no road.
    pub fn cell_from_pixel(&self, pixel: [f64; 2], grid: &BevGrid, ground: &Ground) -> Option<[f64; 2]> {
        let point = self.ground_from_pixel(pixel, ground)?;
        Some(grid.cell_from_ground([point.x, point.y]))
    }
}

impl Lut {
    /// The table of a bird's-eye view without a calibration: from four or more points of the road, (x, y) in metres in
    /// the vehicle frame, and the pixels that see them. What lies beyond their horizon is invalid.
    ///
    /// # Errors
    /// Those of [`homography_from_points`], [`PointsError::Unfit`] where the pairs make a mirror image of the road (y
    /// points left), [`ViewError::ImageSize`](crate::error::ViewError::ImageSize), [`Error::OutOfMemory`] and
    /// [`IsaError`](crate::error::IsaError).
    pub fn from_ground_points(
        image: &[[f64; 2]],
        ground: &[[f64; 2]],
        grid: &BevGrid,
        source_size: (u32, u32),
    ) -> Result<Self> {
        let source = check_image_size("source_size", source_size.0.into(), source_size.1.into())?;
        let found = homography_from_points(image, ground)?.image_from_ground;
        // of a camera above the road, K [r1 r2 t], it is the focal lengths times the height below it
        if found.determinant() > 0.0 {
            return Err(Error::Points(PointsError::Unfit {
                what: "image_points, ground_points",
                expected: "a road seen from above, x ahead and y to the left",
                got: "its mirror image; change the sign of y, or the order of the points".to_owned(),
            }));
        }
        Self::from_image_from_ground(&found, grid, source, BorderMode::Constant)
    }

    /// The table of a bird's-eye view by a homography from (x, y, 1) in metres, x ahead and y to the left, to source pixels.
    /// What lies beyond its horizon is invalid: of the two sides the one seen by a camera above the ground. `mode` as
    /// [`Lut::from_homography_with`] takes it.
    ///
    /// # Errors
    /// Those of [`Lut::from_homography_with`], and [`PointsError::Unfit`] where the middle of the picture's last row would be
    /// beyond the horizon, as it is where the matrix has y to the right, or the picture is upside down.
    pub fn from_ground_homography(
        m: &Matrix3<f64>,
        grid: &BevGrid,
        source_size: (u32, u32),
        mode: BorderMode,
    ) -> Result<Self> {
        check_homography(m)?;
        let source = check_image_size("source_size", source_size.0.into(), source_size.1.into())?;
        // of a camera above the road, K [r1 r2 t], the determinant is the focal lengths times the height below it
        let m = if m.determinant() > 0.0 { -m } else { *m };
        let nearest = Vector3::new(0.5 * f64::from(source.0 - 1), f64::from(source.1 - 1), 1.0);
        let ground = m.try_inverse().map(|inverse| inverse * nearest);
        if ground.is_none_or(|ground| ground.z <= 0.0) {
            return Err(Error::Points(PointsError::Unfit {
                what: "M",
                expected: "a map from metres, x ahead and y to the left, to pixels, which sees ground below its horizon",
                got: "its mirror image, or a picture upside down; change the sign of y with M @ diag([1, -1, 1]), or invert \
                      an M that maps pixels to metres"
                    .to_owned(),
            }));
        }
        Self::from_image_from_ground(&m, grid, source, mode)
    }

    /// The table of a homography from (x, y, 1) on the road to the image; what has a third component of 0 or less lies
    /// behind the camera.
    fn from_image_from_ground(h: &Matrix3<f64>, grid: &BevGrid, source: (u32, u32), mode: BorderMode) -> Result<Self> {
        let edges = Edges::new(mode, false)?;
        let isa = Isa::active()?;
        let ys = Row::collected((0..grid.columns()).map(|column| grid.y_of_column(column as f64)))?;
        let table = Table::build((grid.rows(), grid.columns()), source, edges, isa, |row, us, vs| {
            let origin = h.column(0) * grid.x_of_row(row as f64) + h.column(2);
            ProjectiveRow { origin, step: h.column(1).into(), culled: true }.fill(isa, &ys, us, vs);
            Ok(0..ys.len())
        })?;
        Self::of_table(table).with_scene(Scene::new(*grid, None))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Pinhole;
    use crate::{Plane, SampleAt};

    fn camera() -> Camera {
        let model = Pinhole::new(800.0, 810.0, 639.5, 359.5, 1.5).unwrap();
        Camera::from_euler(model, (1280, 720), [1.5, 0.1, 1.4], 0.02, 0.09, -0.03).unwrap()
    }

    fn grid() -> BevGrid {
        // also behind the camera
        BevGrid::new((-20.0, 40.0), (-8.0, 8.0), (0.25, 0.2), SampleAt::Center).unwrap()
    }

    #[test]
    fn four_points_make_the_table_of_the_camera_that_saw_them() {
        let ground = [[8.0, 3.0], [8.0, -3.0], [30.0, 4.0], [28.0, -3.5]];
        let image = ground.map(|point| camera().project_ground(point, &Ground::default()).pixel);
        let lut = Lut::from_ground_points(&image, &ground, &grid(), (1280, 720)).unwrap();
        let expected = Lut::new(&camera(), &grid(), &Ground::default()).unwrap();
        assert_eq!(lut.mask().unwrap(), expected.mask().unwrap());
        let (got, expected) = (lut.maps(-9.0).unwrap(), expected.maps(-9.0).unwrap());
        let pairs = got.0.iter().zip(&expected.0).chain(got.1.iter().zip(&expected.1));
        assert!(pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max) < 2e-4);
        let mirrored = ground.map(|[x, y]| [x, -y]);
        let error = Lut::from_ground_points(&image, &mirrored, &grid(), (1280, 720)).unwrap_err();
        assert!(error.to_string().contains("mirror image"), "{error}");
    }

    #[test]
    fn a_homography_of_either_sign_is_the_table_of_its_camera_up_to_the_horizon() {
        let camera = camera();
        let pose = camera.camera_from_vehicle();
        let rotation = pose.rotation();
        let columns = [rotation.column(0).into(), rotation.column(1).into(), *pose.translation()];
        let m = camera.intrinsics() * Matrix3::from_columns(&columns);
        let expected = Lut::new(&camera, &grid(), &Ground::default()).unwrap();
        for scale in [1.0, -3.0, 1e-3] {
            let lut = Lut::from_ground_homography(&(m * scale), &grid(), (1280, 720), BorderMode::Constant).unwrap();
            assert_eq!(lut.mask().unwrap(), expected.mask().unwrap());
            let (got, expected) = (lut.maps(-9.0).unwrap(), expected.maps(-9.0).unwrap());
            let pairs = got.0.iter().zip(&expected.0).chain(got.1.iter().zip(&expected.1));
            assert!(pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max) < 2e-4);
            assert_eq!(lut.grid(), Some(&grid()));
        }
        let mirrored = m * Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, 1.0));
        let error = Lut::from_ground_homography(&mirrored, &grid(), (1280, 720), BorderMode::Constant).unwrap_err();
        assert!(error.to_string().contains("mirror image"), "{error}");
    }

    #[test]
    fn cells_and_pixels_are_inverse_and_those_of_the_table() {
        let (camera, grid) = (camera(), grid());
        let ground = Ground::from(Plane::from_angles(0.03, 0.01, -0.2).unwrap());
        let lut = Lut::new(&camera, &grid, &ground).unwrap();
        let (mask, (map_x, map_y)) = (lut.mask().unwrap(), lut.maps(f32::NAN).unwrap());
        for cell in (0..mask.len()).step_by(37) {
            let at = [(cell / grid.columns()) as f64, (cell % grid.columns()) as f64];
            let projection = camera.project_cell(at, &grid, &ground);
            assert_eq!(projection.valid, mask[cell]);
            if mask[cell] {
                assert!((f64::from(map_x[cell]) - projection.pixel[0]).abs() < 2e-4);
                assert!((f64::from(map_y[cell]) - projection.pixel[1]).abs() < 2e-4);
                let back = camera.cell_from_pixel(projection.pixel, &grid, &ground).unwrap();
                assert!((back[0] - at[0]).abs() < 1e-6 && (back[1] - at[1]).abs() < 1e-6);
            }
        }
        assert_eq!(camera.cell_from_pixel([640.0, 10.0], &grid, &ground), None);
    }
}
