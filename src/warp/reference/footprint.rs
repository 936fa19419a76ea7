//! Area and mode of exact footprints: each pixel a square of one value, weighted by what the footprint covers of it.

use std::ops::Range;

use super::{Cell, sample};
use crate::view::ImageView;
use crate::warp::Interpolation;

/// What a cell covers of the image: its four corners in order around it, pixels.
pub type Footprint = [[f64; 2]; 4];

/// The footprint of a cell whose sides are these, widened to a pixel where they are shorter: a footprint of exactly one
/// upright pixel is bilinear interpolation, since the areas that it covers are the products of the fractions.
pub fn parallelogram(middle: [f64; 2], along: [f64; 2], down: [f64; 2]) -> Footprint {
    // a side without a length has no direction either, and gets that of its axis
    let widened = |side: [f64; 2], axis: [f64; 2]| match f64::hypot(side[0], side[1]) {
        0.0 => axis,
        length => side.map(|number| number * (1.0 / length).max(1.0)),
    };
    let (along, down) = (widened(along, [1.0, 0.0]), widened(down, [0.0, 1.0]));
    [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]
        .map(|(a, b)| [0, 1].map(|axis| middle[axis] + a * along[axis] + b * down[axis]))
}

/// The area that a polygon covers of each of these pixels, row by row. The polygon must not cross itself.
///
/// The area of the polygon left of X and above Y is the sum over its edges of the integral of min(y, Y) along x, up to X
/// (Green's theorem); the area in a pixel is the difference of that at the pixel's four corners.
pub fn covered_area(polygon: &[[f64; 2]], columns: Range<i64>, rows: Range<i64>) -> Vec<f64> {
    let before = |right: f64, bottom: f64| -> f64 {
        let edges = polygon.iter().zip(polygon.iter().cycle().skip(1));
        let under = edges.map(|(&[x0, y0], &[x1, y1])| {
            if x0 == x1 {
                return 0.0; // nothing lies below a vertical edge
            }
            let (begin, end) = (x0.min(x1), right.clamp(x0.min(x1), x0.max(x1)));
            let at = |x: f64| y0 + (y1 - y0) / (x1 - x0) * (x - x0);
            let (low, high) = (at(begin).min(at(end)), at(begin).max(at(end)));
            let mean = if high <= bottom {
                low.midpoint(high)
            } else if low >= bottom {
                bottom
            } else {
                bottom - (bottom - low).powi(2) / (2.0 * (high - low))
            };
            (x1 - x0).signum() * (end - begin) * mean
        });
        under.sum()
    };
    let corner = |column: i64, row: i64| before(column as f64 - 0.5, row as f64 - 0.5);
    let pixels = rows.flat_map(|row| columns.clone().map(move |column| (column, row)));
    let area = |(column, row): (i64, i64)| {
        let [left, right] = [column, column + 1].map(|column| corner(column, row + 1) - corner(column, row));
        (right - left).abs()
    };
    pixels.map(area).collect()
}

/// The pixels of an image that a footprint touches, each with the area that it covers.
fn seen<T: Copy>(image: &ImageView<'_, T>, footprint: &Footprint) -> Vec<(usize, usize, f64)> {
    let range = |axis: usize, size: usize| {
        let side = footprint.map(|corner| corner[axis]);
        let (low, high) = side.iter().fold((f64::MAX, f64::MIN), |(low, high), &at| (low.min(at), high.max(at)));
        let first = (low + 0.5).floor().clamp(0.0, size as f64 - 1.0) as i64;
        first..((high + 0.5).ceil().min(size as f64) as i64).max(first + 1)
    };
    let (columns, rows) = (range(0, image.width()), range(1, image.height()));
    let places = rows.clone().flat_map(|row| columns.clone().map(move |column| (column as usize, row as usize)));
    let areas = covered_area(footprint, columns.clone(), rows.clone());
    places.zip(areas).map(|((column, row), area)| (column, row, area)).filter(|&(.., area)| area > 0.0).collect()
}

/// The mean of an image over a footprint; what lies outside the image takes no part. A cell that does not see the image
/// with its middle, `coordinate`, is as in [`sample`].
pub fn area<T: Copy + Into<f64>>(
    image: &ImageView<'_, T>,
    coordinate: Option<[f64; 2]>,
    footprint: &Footprint,
    border: &[f64],
) -> Cell {
    let point = sample(image, coordinate, Interpolation::Bilinear, border);
    let seen = if point.valid { seen(image, footprint) } else { Vec::new() };
    let total: f64 = seen.iter().map(|&(.., area)| area).sum();
    if total == 0.0 {
        return point;
    }
    let mean =
        |channel: usize| seen.iter().map(|&(x, y, area)| area * image.pixel(x, y)[channel].into()).sum::<f64>() / total;
    Cell { values: (0..image.channels()).map(mean).collect(), valid: true }
}

/// The ids that a footprint covers of one channel, each with its area, largest first and of equal ones the smallest id.
/// Empty where nothing of the image is covered.
pub fn ids<T: Copy + Ord>(image: &ImageView<'_, T>, footprint: &Footprint, channel: usize) -> Vec<(T, f64)> {
    let mut pixels: Vec<(T, f64)> =
        seen(image, footprint).into_iter().map(|(x, y, area)| (image.pixel(x, y)[channel], area)).collect();
    pixels.sort_by_key(|&(id, _)| id);
    let mut ids: Vec<(T, f64)> = Vec::new();
    for (id, area) in pixels {
        match ids.last_mut() {
            Some((last, total)) if *last == id => *total += area,
            _ => ids.push((id, area)),
        }
    }
    // stable, and areas that are equal differ by their rounding
    ids.sort_by(|a, b| if (a.1 - b.1).abs() < 1e-9 { a.0.cmp(&b.0) } else { b.1.total_cmp(&a.1) });
    ids
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn covered_areas_by_hand() {
        let square = parallelogram([0.5, 0.5], [1.0, 0.0], [0.0, 1.0]);
        assert_eq!(covered_area(&square, 0..2, 0..2), [0.25; 4]);
        let mut triangle = vec![[-0.5, -0.5], [1.5, -0.5], [-0.5, 0.5]]; // half of 2 x 1 pixels
        assert_eq!(covered_area(&triangle, 0..2, 0..2), [0.75, 0.25, 0.0, 0.0]);
        triangle.reverse();
        assert_eq!(covered_area(&triangle, 0..2, 0..2), [0.75, 0.25, 0.0, 0.0]);
    }

    #[test]
    fn small_footprints_are_a_pixel() {
        let [a, b, c, d] = parallelogram([3.0, 4.0], [0.5, 0.0], [0.0, 0.0]);
        assert_eq!([a, b, c, d], [[2.5, 3.5], [3.5, 3.5], [3.5, 4.5], [2.5, 4.5]]);
    }

    #[test]
    fn equal_ids_are_in_order() {
        let data = [7, 7, 2, 2, 5, 5, 5, 5];
        let view = ImageView::new(&data, (4, 2), 1).expect("a good image");
        let all = parallelogram([1.5, 0.5], [4.0, 0.0], [0.0, 2.0]);
        let ids = ids(&view, &all, 0);
        assert_eq!(ids.iter().map(|&(id, _)| id).collect::<Vec<_>>(), [5, 2, 7]);
    }
}
