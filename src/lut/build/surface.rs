//! Coordinates of a grid over a height map.

use std::cell::RefCell;

use nalgebra::Vector3;

use super::heights::HeightsRow;
use crate::camera::Camera;
use crate::error::Result;
use crate::ground::{HeightMap, HeightRows, Sight};
use crate::isa::Isa;
use crate::view::buffer;

/// A grid's rows as a camera sees them over a height map.
pub(super) struct Surface<'a> {
    camera: &'a Camera,
    heights: HeightRows<'a>,
    sight: Sight<'a>,
    ys: &'a [f64],
}

impl<'a> Surface<'a> {
    /// `ys` are those of the grid's columns.
    pub(super) fn new(camera: &'a Camera, map: &'a HeightMap, ys: &'a [f64]) -> Result<Self> {
        Ok(Self { camera, heights: HeightRows::new(map, ys)?, sight: Sight::new(map, camera.position())?, ys })
    }

    /// Writes the pixel of each road point of the row at `x`; NaN where it has none, where the road is not known, and
    /// where a crest hides it.
    pub(super) fn fill(&self, isa: Isa, x: f64, us: &mut [f64], vs: &mut [f64]) -> Result<()> {
        thread_local! {
            /// Heights of a row, and room to work them out.
            static SCRATCH: RefCell<(Vec<f64>, Vec<f64>)> = const { RefCell::new((Vec::new(), Vec::new())) };
        }
        SCRATCH.with_borrow_mut(|(zs, profile)| {
            buffer::resize("Lut", zs, self.ys.len(), 0.0)?;
            self.heights.fill(x, zs, profile)?;
            self.project(isa, x, zs, us, vs);
            self.hide(x, zs, us, vs);
            Ok(())
        })
    }

    fn project(&self, isa: Isa, x: f64, zs: &[f64], us: &mut [f64], vs: &mut [f64]) {
        let pose = self.camera.camera_from_vehicle();
        let [across, up] = [1, 2].map(|axis| Vector3::from(pose.rotation().column(axis)));
        let origin = pose.transform(&Vector3::new(x, 0.0, 0.0));
        let (intrinsics, lens) = (self.camera.intrinsics(), self.camera.lens());
        HeightsRow { origin, across, up, intrinsics, lens }.fill(isa, self.ys, zs, us, vs);
    }

    /// Takes the pixel from the points that are hidden. Only those with a pixel in the image or its halo are asked.
    fn hide(&self, x: f64, zs: &[f64], us: &mut [f64], vs: &mut [f64]) {
        let (width, height) = self.camera.image_size();
        if self.sight.sees_all() {
            return;
        }
        for (((&y, &z), u), v) in self.ys.iter().zip(zs).zip(us).zip(vs) {
            let seen = *u > -1.0 && *u < f64::from(width) && *v > -1.0 && *v < f64::from(height);
            if seen && self.sight.hides(&Vector3::new(x, y, z)) {
                (*u, *v) = (f64::NAN, f64::NAN);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Surface;
    use crate::camera::{BrownConrady, KannalaBrandt, Lens, Pinhole};
    use crate::isa::Isa;
    use crate::{BevGrid, Camera, Ground, HeightMap, Lut, Plane, SampleAt};

    fn camera() -> Camera {
        let model = Pinhole::new(800.0, 810.0, 639.5, 359.5, 1.5).unwrap();
        Camera::from_euler(model, (1280, 720), [1.5, 0.1, 1.4], 0.02, 0.09, -0.03).unwrap()
    }

    fn grid() -> BevGrid {
        BevGrid::new((3.0, 43.0), (-8.0, 8.0), (0.25, 0.2), SampleAt::Center).unwrap()
    }

    /// Heights at the samples of the grid itself.
    fn map(height: impl Fn(f64, f64) -> f64) -> Ground {
        let grid = grid();
        let (x0, y0) = (grid.x_of_row(0.0), grid.y_of_column(0.0));
        let heights = (0..grid.rows() * grid.columns())
            .map(|k| (k / grid.columns(), k % grid.columns()))
            .map(|(i, j)| height(grid.x_of_row(i as f64), grid.y_of_column(j as f64)))
            .collect();
        HeightMap::new(heights, grid.columns(), (x0, y0), (-0.25, -0.2)).unwrap().into()
    }

    #[test]
    fn a_plane_as_a_height_map_makes_the_table_of_the_plane() {
        let plane = Plane::from_coefficients(-0.1, 0.02, -0.03).unwrap();
        let flat = Lut::new(&camera(), &grid(), &plane.into()).unwrap();
        let mapped = Lut::new(&camera(), &grid(), &map(|x, y| plane.height_at(x, y))).unwrap();
        assert_eq!(mapped.mask().unwrap(), flat.mask().unwrap());
        assert!(flat.valid_cells() > 5000);
        let (flat, mapped) = (flat.maps(-9.0).unwrap(), mapped.maps(-9.0).unwrap());
        let pairs = flat.0.iter().zip(&mapped.0).chain(flat.1.iter().zip(&mapped.1));
        assert!(pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max) < 2e-4);
    }

    #[test]
    fn cells_are_those_of_project_and_hidden_ones_are_invalid() {
        let bent: Lens = KannalaBrandt::new(&[0.02, -0.004, 0.0, 0.0], None).unwrap().into();
        for lens in [None, Some(bent)] {
            check_cells(&camera().with_lens(lens));
        }
    }

    #[test]
    fn every_instruction_set_gives_the_same_bits() {
        let ground = map(|x, y| 0.6 * (x * 0.4).sin() + 0.1 * (y * 1.3).cos());
        let Ground::HeightMap(heights) = &ground else { unreachable!("made of heights") };
        let ys: Vec<f64> = (0..80).map(|column| grid().y_of_column(f64::from(column))).collect();
        let bent = |lens: Lens| camera().with_lens(lens);
        let cameras = [
            camera(),
            bent(KannalaBrandt::new(&[0.02, -0.004, 0.0, 0.0], None).unwrap().into()),
            bent(BrownConrady::new(&[-0.1, 0.02, 1e-3, -1e-3, 1e-3], None).unwrap().into()),
        ];
        for camera in &cameras {
            let surface = Surface::new(camera, heights, &ys).unwrap();
            for row in (0..160).step_by(7) {
                let filled = |isa| {
                    let (mut us, mut vs) = (vec![0.0; 80], vec![0.0; 80]);
                    surface.fill(isa, grid().x_of_row(f64::from(row)), &mut us, &mut vs).unwrap();
                    us.into_iter().chain(vs).map(f64::to_bits).collect::<Vec<_>>()
                };
                for &isa in Isa::available() {
                    assert_eq!(filled(isa), filled(Isa::Scalar), "{isa:?}");
                }
            }
        }
    }

    fn check_cells(camera: &Camera) {
        let ground = map(|x, y| if x > 41.0 { f64::NAN } else { 0.6 * (x * 0.4).sin() + 0.1 * (y * 1.3).cos() });
        let grid = grid();
        let lut = Lut::new(camera, &grid, &ground).unwrap();
        let (mask, maps) = (lut.mask().unwrap(), lut.maps(f32::NAN).unwrap());
        let mut hidden = 0;
        for (cell, &valid) in mask.iter().enumerate() {
            let (row, column) = (cell / grid.columns(), cell % grid.columns());
            let [x, y] = grid.ground_from_cell([row as f64, column as f64]);
            let point = nalgebra::Vector3::new(x, y, ground.height_at(x, y));
            let projection = camera.project(&point);
            let hides = ground.hides(&camera.position(), &point);
            assert_eq!(valid, projection.valid && !hides, "{x} {y}");
            hidden += usize::from(projection.valid && hides);
            if valid {
                assert!((f64::from(maps.0[cell]) - projection.pixel[0]).abs() < 2e-4);
                assert!((f64::from(maps.1[cell]) - projection.pixel[1]).abs() < 2e-4);
            }
        }
        assert!(hidden > 500 && lut.valid_cells() > 3000, "{hidden} {}", lut.valid_cells());
    }
}
