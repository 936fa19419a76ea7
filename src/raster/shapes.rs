//! Boxes and polygons onto a grid: labels of the cells whose centres are inside.

use super::WHAT;
use crate::error::{Error, RasterError, Result};
use crate::grid::BevGrid;
use crate::parallel::check_interrupt;
use crate::view::buffer;

/// Coordinates beyond this, metres, are taken for a mistake: differences of larger ones lose the cells.
const FARTHEST: f64 = 1e9;

/// The corners of a box on the ground: its centre (x, y), its length along the heading, its width, its heading (radians,
/// positive turns left).
///
/// # Errors
/// [`RasterError::Shape`] for a number that is not finite or too large, or a negative size.
pub fn box_corners([x, y, length, width, yaw]: [f64; 5], index: usize) -> Result<[[f64; 2]; 4]> {
    let refuse = |problem| Err(Error::Raster(RasterError::Shape { what: "boxes", index, problem }));
    if ![x, y, length, width, yaw].iter().all(|number| number.is_finite()) {
        return refuse("a number that is not finite");
    }
    if length < 0.0 || width < 0.0 {
        return refuse("a negative size");
    }
    if [x, y, length, width].iter().any(|number| number.abs() > FARTHEST) {
        return refuse("a number beyond 1e9 m");
    }
    let (sin, cos) = yaw.sin_cos();
    let corner = |along: f64, left: f64| {
        let (along, left) = (along * length / 2.0, left * width / 2.0);
        [x + along * cos - left * sin, y + along * sin + left * cos]
    };
    Ok([corner(1.0, 1.0), corner(-1.0, 1.0), corner(-1.0, -1.0), corner(1.0, -1.0)])
}

/// Gives `label` to the cells of `out` (rows x columns) whose centres are inside a polygon.
///
/// Inside is what an odd number of edges separates from far away (the even-odd rule): any winding, and where a polygon
/// crosses itself, what it surrounds twice is outside. A centre on an edge belongs to the side that is nearer or to the
/// right of it, as points on the edges of cells do, so polygons that share an edge share no cell and leave none out.
///
/// # Errors
/// [`RasterError::Shape`] for fewer than three corners, or one that is not finite or too far; then nothing is drawn.
///
/// # Panics
/// Where `out` has another number of cells than the grid.
pub fn draw_polygon(corners: &[[f64; 2]], label: i32, grid: &BevGrid, index: usize, out: &mut [i32]) -> Result<()> {
    assert_eq!(out.len(), grid.rows() * grid.columns());
    check_polygon(corners, index)?;
    let (dx, dy) = grid.resolution();
    let (x_max, y_max) = (grid.x().1, grid.y().1);
    let centre_x = |row: usize| x_max - (row as f64 + 0.5) * dx;
    let centre_y = |column: usize| y_max - (column as f64 + 0.5) * dy;

    // the edges by the first row whose centre they reach, from far to near
    let mut edges: Vec<Edge> = buffer::reserved(WHAT, corners.len())?;
    for (i, &near) in corners.iter().enumerate() {
        let far = corners[(i + 1) % corners.len()];
        let (near, far) = if near[0] <= far[0] { (near, far) } else { (far, near) };
        // rows whose centre x has near < x <= far
        let first = count_where(grid.rows(), |row| centre_x(row) > far[0], (x_max - far[0]) / dx - 0.5);
        let end = count_where(grid.rows(), |row| centre_x(row) > near[0], (x_max - near[0]) / dx - 0.5);
        if first < end {
            edges.push(Edge { first, end, near, far });
        }
    }
    edges.sort_unstable_by_key(|edge| edge.first);

    let (mut waiting, mut active): (_, Vec<Edge>) = {
        let count = edges.len();
        (edges.into_iter().peekable(), buffer::reserved(WHAT, count)?)
    };
    let mut crossings = buffer::reserved(WHAT, active.capacity())?;
    let Some(mut row) = waiting.peek().map(|edge| edge.first) else { return Ok(()) };
    while row < grid.rows() {
        check_interrupt()?;
        active.retain(|edge| edge.end > row);
        while let Some(edge) = waiting.next_if(|edge| edge.first <= row) {
            active.push(edge);
        }
        if active.is_empty() {
            match waiting.peek() {
                Some(edge) => row = edge.first,
                None => break,
            }
            continue;
        }
        crossings.clear();
        crossings.extend(active.iter().map(|edge| edge.y_at(centre_x(row))));
        crossings.sort_unstable_by(f64::total_cmp);
        let cells = &mut out[row * grid.columns()..][..grid.columns()];
        for pair in crossings.as_chunks::<2>().0 {
            // columns whose centre y has right < y <= left
            let [right, left] = *pair;
            let first = count_where(grid.columns(), |column| centre_y(column) > left, (y_max - left) / dy - 0.5);
            let end = count_where(grid.columns(), |column| centre_y(column) > right, (y_max - right) / dy - 0.5);
            if first < end {
                cells[first..end].fill(label);
            }
        }
        row += 1;
    }
    Ok(())
}

/// Refuses what is no polygon.
///
/// # Errors
/// [`RasterError::Shape`].
pub fn check_polygon(corners: &[[f64; 2]], index: usize) -> Result<()> {
    let refuse = |problem| Err(Error::Raster(RasterError::Shape { what: "polygons", index, problem }));
    if corners.len() < 3 {
        return refuse("fewer than 3 corners");
    }
    if !corners.iter().flatten().all(|number| number.is_finite()) {
        return refuse("a corner that is not finite");
    }
    if corners.iter().flatten().any(|number| number.abs() > FARTHEST) {
        return refuse("a corner beyond 1e9 m");
    }
    Ok(())
}

/// An edge from its nearer to its farther end, and the rows whose centres it passes.
struct Edge {
    first: usize,
    end: usize,
    near: [f64; 2],
    far: [f64; 2],
}

impl Edge {
    /// y where the edge has that x.
    fn y_at(&self, x: f64) -> f64 {
        let share = (x - self.near[0]) / (self.far[0] - self.near[0]);
        self.near[1] + share * (self.far[1] - self.near[1])
    }
}

/// How many of `0..count` a condition holds for, that holds for the first of them and not for the rest; `guess` is about
/// how many.
fn count_where(count: usize, holds: impl Fn(usize) -> bool, guess: f64) -> usize {
    let mut found = (guess.max(0.0) as usize).min(count); // saturates
    while found > 0 && !holds(found - 1) {
        found -= 1;
    }
    while found < count && holds(found) {
        found += 1;
    }
    found
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::SampleAt;

    fn grid() -> BevGrid {
        BevGrid::new((0.0, 8.0), (-3.0, 3.0), (1.0, 0.5), SampleAt::Center).unwrap()
    }

    fn draw(corners: &[[f64; 2]]) -> Vec<i32> {
        let mut out = vec![0; 8 * 12];
        draw_polygon(corners, 1, &grid(), 0, &mut out).unwrap();
        out
    }

    #[test]
    fn a_rectangle_of_cells_in_both_windings() {
        let mut corners = vec![[2.0, -1.0], [5.0, -1.0], [5.0, 1.0], [2.0, 1.0]];
        let one = draw(&corners);
        assert_eq!(one.iter().sum::<i32>(), 3 * 4);
        assert_eq!((one[3 * 12 + 4], one[5 * 12 + 7], one[2 * 12 + 4], one[3 * 12 + 3]), (1, 1, 0, 0));
        corners.reverse();
        assert_eq!(draw(&corners), one);
    }

    #[test]
    fn centres_on_edges_go_to_the_far_left_polygon_alone() {
        // its edges run through centres: x = 2.5 and 4.5, y = -1.25 and 0.75
        let one = draw(&[[2.5, -1.25], [4.5, -1.25], [4.5, 0.75], [2.5, 0.75]]);
        assert_eq!(one.iter().sum::<i32>(), 2 * 4);
        assert_eq!((one[3 * 12 + 4], one[5 * 12 + 4], one[3 * 12 + 8]), (1, 0, 0));
    }

    #[test]
    fn what_is_surrounded_twice_is_outside() {
        let star = |k: f64| [4.0 + 3.5 * (k * 2.513_274_1).cos(), 2.5 * (k * 2.513_274_1).sin()];
        let drawn = draw(&[star(0.0), star(1.0), star(2.0), star(3.0), star(4.0)]);
        assert_eq!(drawn[3 * 12 + 5], 0); // the middle
        assert!(drawn.iter().sum::<i32>() > 5);
    }

    #[test]
    fn boxes_turn_left() {
        let [a, ..] = box_corners([10.0, 5.0, 4.0, 2.0, std::f64::consts::FRAC_PI_2], 0).unwrap();
        assert!((a[0] - 9.0).abs() < 1e-12 && (a[1] - 7.0).abs() < 1e-12);
        for numbers in [[f64::NAN, 0.0, 1.0, 1.0, 0.0], [0.0, 0.0, -1.0, 1.0, 0.0], [1e300, 0.0, 1.0, 1.0, 0.0]] {
            assert!(matches!(box_corners(numbers, 3), Err(Error::Raster(RasterError::Shape { index: 3, .. }))));
        }
    }

    #[test]
    fn refuses_what_is_no_polygon() {
        for corners in [&[[0.0; 2]; 2][..], &[[0.0, 0.0], [f64::NAN, 0.0], [1.0, 1.0]], &[[0.0, 1e10]; 3]] {
            assert!(matches!(check_polygon(corners, 1), Err(Error::Raster(RasterError::Shape { index: 1, .. }))));
        }
    }

    /// The rule itself: an odd number of edges cross the ray to the left of the centre.
    fn inside(corners: &[[f64; 2]], x: f64, y: f64) -> bool {
        let mut odd = false;
        for (i, a) in corners.iter().enumerate() {
            let b = corners[(i + 1) % corners.len()];
            let (near, far) = if a[0] <= b[0] { (*a, b) } else { (b, *a) };
            if near[0] < x && x <= far[0] {
                let at = near[1] + (x - near[0]) / (far[0] - near[0]) * (far[1] - near[1]);
                odd ^= at >= y;
            }
        }
        odd
    }

    proptest! {
        #[test]
        fn cell_by_cell(corners in prop::collection::vec(prop::array::uniform2(-6i32..20), 3..9), half in any::<bool>()) {
            // halves and quarters of metres, so that centres on edges and corners are common
            let scale = if half { 0.5 } else { 0.25 };
            let corners: Vec<[f64; 2]> = corners.iter().map(|c| [f64::from(c[0]) * scale, f64::from(c[1]) * scale - 2.0]).collect();
            let drawn = draw(&corners);
            for (cell, label) in drawn.iter().enumerate() {
                let (x, y) = (8.0 - (cell / 12) as f64 - 0.5, 3.0 - ((cell % 12) as f64 + 0.5) * 0.5);
                prop_assert_eq!(*label == 1, inside(&corners, x, y), "{} {} {:?}", x, y, corners);
            }
        }
    }
}
