//! What is odd about a table of a camera and its road.

use nalgebra::Vector3;

use super::Lut;
use crate::camera::Camera;
use crate::finding::{Finding, Unseen};
use crate::grid::BevGrid;
use crate::ground::{Ground, is_edge_on};

/// Cells along a side of the grid that are asked why they are not seen.
const ASKED: usize = 33;

impl Lut {
    /// What is odd about the table's camera, grid and road, which is usually a mistake: a camera that is not above its
    /// road, and a table that samples nothing. Nothing for most tables, and where they are not known.
    pub fn plausibility(&self) -> Vec<Finding> {
        let (Some(camera), Some(grid), Some(ground)) = (self.camera(), self.grid(), self.ground()) else {
            return Vec::new();
        };
        let eye = camera.position();
        let road = ground.nearest_height(&eye);
        let sees_nothing = self.valid_cells() == 0;
        let mut findings = Vec::new();
        if is_edge_on(eye.z - road) {
            findings.push(Finding::EdgeOn { camera: eye.z, road });
            return findings;
        }
        if eye.z < road {
            findings.push(Finding::UnderRoad { camera: eye.z, road });
        }
        if sees_nothing {
            findings.push(Finding::NoCell {
                because: why_unseen(camera, grid, ground),
                position: eye.into(),
                optical_axis: camera.optical_axis().into(),
                sees: bottom_of_view(camera, ground),
            });
        }
        findings
    }
}

/// (x, y) of the road that the middle of the image's bottom row sees.
fn bottom_of_view(camera: &Camera, ground: &Ground) -> Option<[f64; 2]> {
    let (width, height) = camera.image_size();
    let pixel = [f64::from(width - 1) / 2.0, f64::from(height - 1)];
    camera.ground_from_pixel(pixel, ground).map(|point| [point.x, point.y])
}

/// What most cells of a grid have against them.
fn why_unseen(camera: &Camera, grid: &BevGrid, ground: &Ground) -> Unseen {
    let some = |cells: usize| {
        let asked = cells.min(ASKED);
        (0..asked).map(move |k| if asked == 1 { 0.0 } else { (k * (cells - 1) / (asked - 1)) as f64 })
    };
    let mut counts: Vec<(Unseen, usize)> = Vec::new();
    for cell in some(grid.rows()).flat_map(|row| some(grid.columns()).map(move |column| [row, column])) {
        let because = why_cell_unseen(camera, grid.ground_from_cell(cell), ground);
        match counts.iter_mut().find(|(known, _)| *known == because) {
            Some((_, count)) => *count += 1,
            None => counts.push((because, 1)),
        }
    }
    counts.into_iter().max_by_key(|(_, count)| *count).map_or(Unseen::Unknown, |(because, _)| because)
}

fn why_cell_unseen(camera: &Camera, [x, y]: [f64; 2], ground: &Ground) -> Unseen {
    let point = Vector3::new(x, y, ground.height_at(x, y));
    if point.z.is_nan() {
        return Unseen::Unknown;
    }
    let seen = camera.project(&point);
    let [u, v] = seen.pixel;
    if seen.valid {
        return Unseen::Hidden;
    }
    if u.is_nan() {
        return if seen.depth > 0.0 { Unseen::BeyondLens } else { Unseen::Behind };
    }
    // by how many image sizes it is off each edge
    let (width, height) = camera.image_size();
    let [across, down] = [(u, width), (v, height)].map(|(at, size)| at / f64::from(size) - 0.5);
    Unseen::OffImage(match (across.abs() > down.abs(), across < 0.0, down < 0.0) {
        (true, true, _) => "left",
        (true, false, _) => "right",
        (false, _, true) => "top",
        (false, _, false) => "bottom",
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{KannalaBrandt, Pinhole};
    use crate::{HeightMap, Plane, SampleAt};

    fn camera(z: f64, pitch: f64, yaw: f64) -> Camera {
        let model = Pinhole::new(820.0, 815.0, 640.0, 362.0, 0.0).unwrap();
        Camera::from_euler(model, (1280, 720), [1.2, -0.1, z], 0.0, pitch, yaw).unwrap()
    }

    fn grid() -> BevGrid {
        BevGrid::new((5.0, 25.0), (-4.0, 4.0), (0.25, 0.25), SampleAt::Center).unwrap()
    }

    fn map(height: impl Fn(f64, f64) -> f64) -> Ground {
        let heights = (0..27 * 21).map(|k| height(f64::from(k / 21), f64::from(k % 21) - 10.0)).collect();
        HeightMap::new(heights, 21, (0.0, -10.0), (1.0, 1.0)).unwrap().into()
    }

    fn findings(camera: &Camera, ground: &Ground) -> (Vec<Finding>, usize) {
        let lut = Lut::new(camera, &grid(), ground).unwrap();
        (lut.plausibility(), lut.valid_cells())
    }

    fn because(camera: &Camera, ground: &Ground) -> Unseen {
        match findings(camera, ground).0[..] {
            [Finding::NoCell { because, .. }] => because,
            ref other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_camera_above_a_road_that_it_sees_is_not_odd() {
        let slope = Plane::from_angles(0.06, 0.0, 0.0).unwrap();
        for ground in [Ground::default(), slope.into(), map(|x, _| 0.2 * (x - 5.0)), map(|_, y| 0.1 * y)] {
            let (odd, seen) = findings(&camera(1.4, 0.1, 0.0), &ground);
            assert_eq!(odd, [], "{ground:?}");
            assert!(seen > 1000);
        }
    }

    #[test]
    fn a_road_through_the_camera_has_no_valid_cell() {
        let sloped = Plane::from_angles(0.1, -0.05, 0.4).unwrap();
        let at = sloped.height_at(1.2, -0.1);
        let as_map = map(|x, y| sloped.height_at(x, y));
        let ahead = (0..20 * 21).map(|k| sloped.height_at(f64::from(k / 21) + 5.0, f64::from(k % 21) - 10.0)).collect();
        let ahead = Ground::from(HeightMap::new(ahead, 21, (5.0, -10.0), (1.0, 1.0)).unwrap());
        for (z, ground) in
            [(0.0, Ground::default()), (0.0, map(|_, _| 0.0)), (at, sloped.into()), (at, as_map), (at, ahead)]
        {
            for pitch in [0.0, 0.1, -0.1] {
                let camera = camera(z, pitch, 0.02);
                let (odd, seen) = findings(&camera, &ground);
                assert_eq!(seen, 0, "{ground:?}");
                assert!(matches!(odd[..], [Finding::EdgeOn { .. }]), "{odd:?}");
                for point in [[9.0, 1.0], [20.0, -2.3]] {
                    assert!(!camera.project_ground(point, &ground).valid);
                }
                for pixel in [[640.0, 700.0], [640.0, 100.0]] {
                    assert_eq!(camera.ground_from_pixel(pixel, &ground), None);
                }
            }
        }
    }

    #[test]
    fn a_camera_under_its_road_is_odd_and_sees_it() {
        for ground in [Ground::default(), map(|_, _| 0.0), Plane::from_angles(0.05, 0.0, -0.1).unwrap().into()] {
            let (odd, seen) = findings(&camera(-1.4, -0.1, 0.0), &ground);
            assert!(matches!(odd[..], [Finding::UnderRoad { camera, .. }] if (camera + 1.4).abs() < 1e-9), "{odd:?}");
            assert!(seen > 1000);
        }
        let (odd, _) = findings(&camera(1.4, -0.1, 0.0), &Ground::height(2.0).unwrap());
        assert!(matches!(odd[..], [Finding::UnderRoad { road: 2.0, .. }]), "{odd:?}");
    }

    #[test]
    fn says_why_no_cell_is_seen() {
        use std::f64::consts::{FRAC_PI_2, PI};
        let level = Ground::default();
        assert_eq!(because(&camera(1.4, 0.1, PI), &level), Unseen::Behind);
        assert_eq!(because(&camera(1.4, 0.1, 1.47), &level), Unseen::OffImage("right"));
        assert_eq!(because(&camera(1.4, 0.1, -1.47), &level), Unseen::OffImage("left"));
        assert_eq!(because(&camera(1.4, FRAC_PI_2, 0.0), &level), Unseen::OffImage("top"));
        assert_eq!(because(&camera(1.4, -0.9, 0.0), &level), Unseen::OffImage("bottom"));
        assert_eq!(because(&camera(1.4, 0.1, 0.0), &map(|x, _| if x < 2.0 { 0.0 } else { f64::NAN })), Unseen::Unknown);
        let hill = map(|x, _| if x == 3.0 { 6.0 } else { 0.0 });
        assert_eq!(because(&camera(1.4, -0.3, 0.0), &hill), Unseen::Hidden);
        let narrow = KannalaBrandt::new(&[0.0; 4], Some(0.1)).unwrap();
        assert_eq!(because(&camera(1.4, 0.1, 1.3).with_lens(Some(narrow.into())), &level), Unseen::BeyondLens);
    }
}
