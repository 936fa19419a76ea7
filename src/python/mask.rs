//! Masks of images, which say what shows the road.

use numpy::PyUntypedArrayMethods;
use pyo3::prelude::*;

use super::arrays;
use super::convert::{Floats, items_up_to, tuple_text};
use super::error::classes::{ArgumentError, ArgumentTypeError, ImageError};
use crate::raster::draw_polygon;
use crate::view::buffer;
use crate::{BevGrid, Camera, ImageMask, SampleAt};

/// More polygons than anybody draws by hand.
const MOST_POLYGONS: usize = 1000;

/// (H, W); what is not 0 shows the road.
pub(super) fn mask_of(name: &str, mask: &Bound<'_, PyAny>, camera: &Camera) -> PyResult<ImageMask> {
    let (width, height) = camera.image_size();
    let mask = Floats::new(name, "an array of bool", mask)?;
    if mask.shape() != [height as usize, width as usize] {
        return Err(ImageError::new_err(format!(
            "{name}: expected ({height}, {width}), which is the shape of its images, got {}; True where they show the road",
            tuple_text(mask.shape())
        )));
    }
    Ok(ImageMask::new(
        camera.image_size(),
        buffer::collected("mask", mask.values().iter().map(|&value| value != 0.0))?,
    )?)
}

/// A polygon of pixels (u, v), or several.
pub(super) fn polygons(object: &Bound<'_, PyAny>) -> PyResult<Vec<Vec<[f64; 2]>>> {
    let refuse = |got: String| {
        ArgumentTypeError::new_err(format!("hide: expected an (M, 2) polygon of pixels (u, v), or several, got {got}"))
    };
    let items = items_up_to(MOST_POLYGONS + 1, object, refuse)?;
    if items.len() > MOST_POLYGONS {
        return Err(ArgumentError::new_err(format!("hide: expected at most {MOST_POLYGONS} polygons, got more")));
    }
    let polygon = |name: &str, object: &Bound<'_, PyAny>| {
        let corners = Floats::new(name, "an (M, 2) array", object)?;
        Ok::<_, PyErr>(buffer::copied("hide", corners.rows::<2>(name)?)?)
    };
    match items.first() {
        Some(first) if arrays::numbers("hide[0]", "an (M, 2) array", first)?.shape().len() == 1 => {
            Ok(vec![polygon("hide", object)?])
        }
        _ => items.iter().enumerate().map(|(index, item)| polygon(&format!("hide[{index}]"), item)).collect(),
    }
}

/// The mask of the pixels whose centres are in none of the polygons.
pub(super) fn outside(polygons: &[Vec<[f64; 2]>], camera: &Camera) -> crate::Result<ImageMask> {
    let (width, height) = camera.image_size();
    // the grid whose cell (row, column) is pixel (v, u): its x points up the image, its y to the left
    let side = |pixels: u32| (0.5 - f64::from(pixels), 0.5);
    let grid = BevGrid::new(side(height), side(width), (1.0, 1.0), SampleAt::Center)?;
    let mut labels = buffer::zeroed("mask", grid.rows() * grid.columns())?;
    for (index, polygon) in polygons.iter().enumerate() {
        let corners = buffer::collected("mask", polygon.iter().map(|[u, v]| [-v, -u]))?;
        draw_polygon(&corners, 1, &grid, index, &mut labels)?;
    }
    ImageMask::new(camera.image_size(), buffer::collected("mask", labels.into_iter().map(|label| label == 0))?)
}
