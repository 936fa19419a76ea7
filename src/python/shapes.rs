//! `rasterize_boxes` and `rasterize_polygons`.

use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadwriteArray2, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::prelude::*;

use super::arrays;
use super::convert::{Floats, MOST_ITEMS, Whole, items_up_to, tuple_text, type_name, whole_number};
use super::detached;
use super::error::OrRefuse;
use super::error::classes::{ArgumentError, ArgumentTypeError, DtypeError};
use super::raster::grid;
use crate::BevGrid;
use crate::raster::{box_corners, check_polygon, draw_polygon};
use crate::view::buffer;

#[doc = help!("rasterize_boxes")]
#[pyfunction]
#[pyo3(signature = (boxes, grid, labels = None, *, background = None, out = None), text_signature = "(boxes, grid, labels=None, *, background=0, out=None)")]
pub(super) fn rasterize_boxes<'py>(
    boxes: &Bound<'py, PyAny>,
    grid: &Bound<'py, PyAny>,
    labels: Option<&Bound<'py, PyAny>>,
    background: Option<&Bound<'py, PyAny>>,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let grid = self::grid(grid)?;
    let polygons = {
        let floats = Floats::new("boxes", "an (N, 5) array (x, y, length, width, yaw)", boxes)?;
        let rows: &[[f64; 5]] = if floats.shape() == [0] { &[] } else { floats.rows::<5>("boxes")? };
        let mut polygons = buffer::reserved("boxes", rows.len())?;
        for (index, &numbers) in rows.iter().enumerate() {
            polygons.push(buffer::copied("boxes", &box_corners(numbers, index)?)?);
        }
        polygons
    };
    draw(boxes.py(), &polygons, grid, labels, background, out)
}

#[doc = help!("rasterize_polygons")]
#[pyfunction]
#[pyo3(signature = (polygons, grid, labels = None, *, background = None, out = None), text_signature = "(polygons, grid, labels=None, *, background=0, out=None)")]
pub(super) fn rasterize_polygons<'py>(
    polygons: &Bound<'py, PyAny>,
    grid: &Bound<'py, PyAny>,
    labels: Option<&Bound<'py, PyAny>>,
    background: Option<&Bound<'py, PyAny>>,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let grid = self::grid(grid)?;
    let refuse = || {
        let got = type_name(polygons);
        ArgumentTypeError::new_err(format!("polygons: expected a list of (M, 2) arrays, one for each, got {got}"))
    };
    let mut corners = Vec::new();
    let py = polygons.py();
    let is_sized = polygons.len().or_none(py)?.is_some();
    for (index, polygon) in polygons.try_iter().or_refuse(py, refuse)?.enumerate() {
        if index == MOST_OF_AN_ITERATOR && !is_sized {
            return Err(ArgumentError::new_err(format!(
                "polygons: expected an iterator that ends, got more than {MOST_OF_AN_ITERATOR} from it; pass a list if there are so many"
            )));
        }
        let name = format!("polygons[{index}]");
        let floats = Floats::new(&name, "an (M, 2) array", &polygon.or_refuse(py, refuse)?)?;
        let polygon = buffer::copied("polygons", floats.rows::<2>(&name)?)?;
        check_polygon(&polygon, index)?;
        buffer::push("polygons", &mut corners, polygon)?;
    }
    draw(polygons.py(), &corners, grid, labels, background, out)
}

/// So many polygons are taken of an iterator, which may have no end.
const MOST_OF_AN_ITERATOR: usize = 1_000_000;

/// Draws polygons, all of them checked, in their order.
fn draw<'py>(
    py: Python<'py>,
    polygons: &[Vec<[f64; 2]>],
    grid: BevGrid,
    labels: Option<&Bound<'py, PyAny>>,
    background: Option<&Bound<'py, PyAny>>,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let labels = match labels {
        Some(object) => labels_of(object, polygons.len())?,
        None => {
            buffer::collected("labels", (0..polygons.len()).map(|index| i32::try_from(index + 1).unwrap_or(i32::MAX)))?
        }
    };
    let shape = [grid.rows(), grid.columns()];
    let work = |cells: &mut [i32]| {
        for (index, (polygon, &label)) in polygons.iter().zip(&labels).enumerate() {
            draw_polygon(polygon, label, &grid, index, cells)?;
        }
        Ok(())
    };
    if let Some(object) = out {
        if background.is_some() {
            return Err(ArgumentError::new_err(
                "background: expected none where out= is drawn on, got one; fill out with it first",
            ));
        }
        let mut out = output(object, shape)?;
        let cells = out.as_slice_mut()?;
        detached::run(py, || work(cells))?;
        return Ok(object.clone());
    }
    let background = background.map_or(Ok(0), |object| label("background", object))?;
    let cells = shape[0] * shape[1];
    let mut drawn = buffer::filled("rasterize", cells, background)?;
    detached::run(py, || work(&mut drawn))?;
    Ok(PyArray1::from_vec(py, drawn).reshape(shape)?.into_any())
}

/// An array that can be drawn on, borrowed.
fn output<'py>(object: &Bound<'py, PyAny>, shape: [usize; 2]) -> PyResult<PyReadwriteArray2<'py, i32>> {
    let Ok(array) = object.cast::<PyUntypedArray>() else {
        return Err(ArgumentTypeError::new_err(format!("out: expected a NumPy array, got {}", type_name(object))));
    };
    let array = arrays::own_class("out", array.clone())?;
    if array.shape() != shape {
        let (expected, got) = (tuple_text(&shape), tuple_text(array.shape()));
        return Err(ArgumentError::new_err(format!("out: expected shape {expected}, that of the grid, got {got}")));
    }
    let Ok(out) = array.cast::<PyArray2<i32>>() else {
        return Err(DtypeError::new_err(format!("out: expected dtype int32, got {}", array.dtype())));
    };
    if !out.is_c_contiguous() || !out.is_aligned() {
        return Err(ArgumentError::new_err(
            "out: expected aligned rows without gaps, got others; use numpy.empty(grid.shape, numpy.int32)",
        ));
    }
    out.try_readwrite().map_err(|error| {
        ArgumentError::new_err(format!("out: expected a writable array that nobody else uses, got: {error}"))
    })
}

/// A label for each shape.
fn labels_of(object: &Bound<'_, PyAny>, count: usize) -> PyResult<Vec<i32>> {
    let refuse = || {
        let got = type_name(object);
        ArgumentTypeError::new_err(format!("labels: expected whole numbers, one for each, got {got}"))
    };
    let items = items_up_to(count + MOST_ITEMS, object, |_| refuse())?;
    if items.len() != count {
        let more = if items.len() == count + MOST_ITEMS { "at least " } else { "" };
        let got = items.len();
        return Err(ArgumentError::new_err(format!("labels: expected one for each of the {count}, got {more}{got}")));
    }
    let mut labels = buffer::reserved("labels", count)?;
    for item in &items {
        labels.push(label("labels", item)?);
    }
    Ok(labels)
}

/// A whole number that an int32 holds.
fn label(name: &str, object: &Bound<'_, PyAny>) -> PyResult<i32> {
    let outside = |got: String| {
        ArgumentError::new_err(format!("{name}: expected whole numbers from -2^31 to 2^31 - 1, got {got}"))
    };
    match whole_number(object)? {
        Whole::Number(number) => i32::try_from(number).map_err(|_| outside(number.to_string())),
        Whole::Beyond => Err(outside("one beyond 128 bits".to_owned())),
        Whole::Other => {
            let got = type_name(object);
            Err(ArgumentTypeError::new_err(format!("{name}: expected whole numbers, got {got}")))
        }
    }
}
