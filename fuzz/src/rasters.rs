//! Points and polygons on grids, against their definitions.

use ipm_rs::raster::{RasterOptions, Reduce, box_corners, draw_polygon, rasterize};
use ipm_rs::view::Strided;
use ipm_rs::{BevGrid, SampleAt};

use crate::input::Input;

pub fn run(data: &[u8]) {
    let mut input = Input::new(data);
    let resolution = (input.one_of(&[0.1, 0.25, 0.5, 1.0]), input.one_of(&[0.1, 0.25, 0.5, 1.0]));
    let (rows, columns) = (input.count(1, 30), input.count(1, 30));
    let from = [f64::from(input.byte() as i8), f64::from(input.byte() as i8)];
    let ends = [from[0] + rows as f64 * resolution.0, from[1] + columns as f64 * resolution.1];
    let grid = BevGrid::new((from[0], ends[0]), (from[1], ends[1]), resolution, SampleAt::Center);
    let Ok(grid) = grid else { return };
    if input.flag() {
        points(&grid, &mut input)
    } else {
        polygons(&grid, &mut input)
    }
    // and ranges that nobody would choose: refused or not
    let [x, y, each] = [input.point(100.0), input.point(100.0), input.point(1.0)];
    let _ = BevGrid::new(x.into(), y.into(), each.into(), SampleAt::Corner);
}

fn points(grid: &BevGrid, input: &mut Input<'_>) {
    let slices = input.count(0, 3);
    let slices: Vec<f64> = (0..slices).map(|_| input.number(3.0)).collect();
    let count = input.count(0, 60);
    let (middle_x, middle_y) = ((grid.x().0 + grid.x().1) / 2.0, (grid.y().0 + grid.y().1) / 2.0);
    let points: Vec<f64> = (0..count)
        .flat_map(|_| [middle_x + input.number(12.0), middle_y + input.number(12.0), input.number(3.0)])
        .collect();
    let options = RasterOptions { reduce: &Reduce::ALL, slices: &slices, threads: Some(2), ..RasterOptions::default() };
    let table = Strided::new(&points, 3).expect("whole rows");
    let Ok(raster) = rasterize(&table, None, grid, &options) else {
        assert!(slices.len() == 1 || !slices.is_sorted_by(|a, b| a < b) || !slices.iter().all(|edge| edge.is_finite()));
        return;
    };
    let layers = slices.len().saturating_sub(1).max(1);
    let counts = raster.count.expect("was asked for");
    assert_eq!(counts.len(), layers * grid.rows() * grid.columns());
    let mut expected = vec![0; counts.len()];
    for point in points.chunks(3).filter(|point| point.iter().all(|number| number.is_finite())) {
        let slice = if slices.is_empty() {
            Some(0)
        } else {
            slices.windows(2).position(|e| e[0] <= point[2] && point[2] < e[1])
        };
        let row = ((grid.x().1 - point[0]) / grid.resolution().0).floor();
        let column = ((grid.y().1 - point[1]) / grid.resolution().1).floor();
        let on = row >= 0.0 && column >= 0.0 && row < grid.rows() as f64 && column < grid.columns() as f64;
        if let (Some(slice), true) = (slice, on && point[0] > grid.x().0 && point[1] > grid.y().0) {
            expected[(slice * grid.rows() + row as usize) * grid.columns() + column as usize] += 1;
        }
    }
    assert_eq!(counts, expected, "{points:?}");
    let [lowest, highest, mean] = [raster.min, raster.max, raster.mean].map(|layer| layer.expect("was asked for"));
    for cell in 0..counts.len() {
        let none = counts[cell] == 0;
        assert!(lowest[cell].is_nan() == none && highest[cell].is_nan() == none);
        // a sum may be beyond float64 where its numbers are not
        assert!(
            none || lowest[cell] <= highest[cell] && !(mean[cell] > highest[cell] + 1e-9 * highest[cell].abs())
                || !mean[cell].is_finite()
        );
    }
}

fn polygons(grid: &BevGrid, input: &mut Input<'_>) {
    let (cells, corners) = (grid.rows() * grid.columns(), input.count(0, 9));
    let middle = [(grid.x().0 + grid.x().1) / 2.0, (grid.y().0 + grid.y().1) / 2.0];
    let corners: Vec<[f64; 2]> = if input.flag() {
        (0..corners).map(|_| [middle[0] + input.number(15.0), middle[1] + input.number(15.0)]).collect()
    } else {
        let [x, y] = input.point(15.0);
        match box_corners([middle[0] + x, middle[1] + y, input.number(9.0), input.number(9.0), input.number(7.0)], 0) {
            Ok(corners) => corners.to_vec(),
            Err(_) => return,
        }
    };
    let mut out = vec![0; cells];
    if draw_polygon(&corners, 7, grid, 0, &mut out).is_err() {
        assert!(out.iter().all(|label| *label == 0), "what is refused draws nothing");
        return;
    }
    for (cell, &label) in out.iter().enumerate() {
        let (row, column) = ((cell / grid.columns()) as f64, (cell % grid.columns()) as f64);
        let (x, y) = (grid.x_of_row(row), grid.y_of_column(column));
        let inside = inside(&corners, x, y);
        assert!(inside.is_none_or(|inside| inside == (label == 7)), "{x} {y} of {corners:?}");
        assert!(label == 7 || label == 0);
    }
}

/// An odd number of edges cross the ray to the left of a place; none where rounding decides.
fn inside(corners: &[[f64; 2]], x: f64, y: f64) -> Option<bool> {
    let mut odd = false;
    for (i, a) in corners.iter().enumerate() {
        let b = corners[(i + 1) % corners.len()];
        let (near, far) = if a[0] <= b[0] { (*a, b) } else { (b, *a) };
        if (near[0] - x).abs() < 1e-9 || (far[0] - x).abs() < 1e-9 {
            return None;
        }
        if near[0] < x && x <= far[0] {
            let at = near[1] + (x - near[0]) / (far[0] - near[0]) * (far[1] - near[1]);
            if (at - y).abs() < 1e-9 * (1.0 + near[1].abs() + far[1].abs()) {
                return None;
            }
            odd ^= at >= y;
        }
    }
    Some(odd)
}
