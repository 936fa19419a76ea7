//! `render_points`.

use numpy::{PyArrayDescrMethods, PyUntypedArray, PyUntypedArrayMethods, dtype};
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use super::gather::{as_image, by_size};
use super::options::{self, wrong_dtype};
use crate::cloud::{RenderOptions, check_points, paint_into, render_points_into};
use crate::python::arrays;
use crate::python::camera::PyCamera;
use crate::python::convert::{float, tuple_text, type_name};
use crate::python::detached;
use crate::python::error::classes::{ArgumentError, ArgumentTypeError};
use crate::python::image::ImageArray;
use crate::python::layout::Layout;
use crate::python::options::{BorderValue, thread_count};
use crate::python::points::PointsArray;
use crate::view::{PointSample, Sample, buffer};
use crate::{Camera, ImageView};

#[doc = help!("render_points")]
#[pyfunction]
#[pyo3(
    signature = (
        points, camera, *, values = None, radius = None, kind = None, min_depth = None, max_depth = None,
        border_value = None, threads = None
    ),
    text_signature = "(points, camera, *, values=None, radius=0, kind='z', min_depth=None, max_depth=None, border_value=0, threads=None)"
)]
#[expect(clippy::too_many_arguments, reason = "keyword-only, each with one meaning")]
pub(in crate::python) fn render_points<'py>(
    points: &Bound<'py, PyAny>,
    camera: &Bound<'py, PyAny>,
    values: Option<&Bound<'py, PyAny>>,
    radius: Option<&Bound<'py, PyAny>>,
    kind: Option<&Bound<'py, PyAny>>,
    min_depth: Option<&Bound<'py, PyAny>>,
    max_depth: Option<&Bound<'py, PyAny>>,
    border_value: Option<&Bound<'py, PyAny>>,
    threads: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyTuple>> {
    let Ok(camera) = camera.cast::<PyCamera>() else {
        let got = type_name(camera);
        let message =
            format!("camera: expected an ipm_rs.Camera, which knows its pose and its image's size, got {got}");
        return Err(ArgumentTypeError::new_err(message));
    };
    let camera = &camera.get().camera;
    let (min_depth, max_depth) = options::depth_limits(min_depth, max_depth)?;
    let options = RenderOptions {
        kind: options::depth_kind(kind)?,
        radius: radius.map_or(Ok(0.0), |object| float("radius", object))?,
        min_depth,
        max_depth,
        threads: threads.map(|threads| thread_count("threads", threads)).transpose()?,
    };
    let border_value = BorderValue::new(border_value)?;
    let values = values.filter(|values| !values.is_none()).map(Values::array).transpose()?;
    let expected = "an (N, 3) or wider";
    let points = arrays::numbers("points", &format!("{expected} array"), points)?;

    let points = PointsArray::new("points", points, 3..=usize::MAX, expected)?;
    let values = values.map(|values| Values::new(values, points.len(), border_value)).transpose()?;
    let (depth, index) = if points.is_f32() {
        render_as::<f32>(camera, &points, &options)?
    } else {
        render_as::<f64>(camera, &points, &options)?
    };
    let painted = values.map(|values| values.paint(&index, options.threads)).transpose()?;
    let arrays = [Some(depth.into_array()), Some(index.into_array()), painted];
    PyTuple::new(points.py(), arrays.into_iter().flatten().collect::<Vec<_>>())
}

fn render_as<'py, T: PointSample>(
    camera: &Camera,
    points: &PointsArray<'py>,
    options: &RenderOptions,
) -> PyResult<(ImageArray<'py>, ImageArray<'py>)> {
    let py = points.py();
    let read = points.read()?;
    let view = read.view::<T>()?;
    let shape = [camera.image_size().1 as usize, camera.image_size().0 as usize];
    check_points("camera", (shape[1], shape[0]))?; // before it is allocated
    let depth = ImageArray::allocate(&shape, dtype::<f32>(py), Layout::Hwc)?;
    let index = ImageArray::allocate(&shape, dtype::<i64>(py), Layout::Hwc)?;
    {
        let (mut depth, mut index) = (depth.write()?, index.write()?);
        let (mut depths, mut indices) = (depth.views::<f32>()?, index.views::<i64>()?);
        detached::run(py, || render_points_into(camera, &view, options, &mut depths[0], &mut indices[0]))?;
    }
    Ok((depth, index))
}

/// An attribute of each point: (N,) or (N, C) of any dtype.
struct Values<'py> {
    array: Bound<'py, PyUntypedArray>,
    border: BorderValue<'py>,
}

impl<'py> Values<'py> {
    fn array(object: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyUntypedArray>> {
        let Ok(array) = object.cast::<PyUntypedArray>() else {
            let message = format!("values: expected a NumPy array, got {}", type_name(object));
            return Err(ArgumentTypeError::new_err(message));
        };
        arrays::own_class("values", array.clone())
    }

    fn new(array: Bound<'py, PyUntypedArray>, count: usize, border: BorderValue<'py>) -> PyResult<Self> {
        let fits = matches!(*array.shape(), [rows] if rows == count)
            || matches!(*array.shape(), [rows, columns] if rows == count && columns > 0);
        if !fits {
            return Err(ArgumentError::new_err(format!(
                "values: expected shape ({count},) or ({count}, C), one row for each point, got {}",
                tuple_text(array.shape())
            )));
        }
        let values = Self { array: arrays::native("values", array)?, border };
        by_size!(values.array, "values", check_border(&values))?;
        Ok(values)
    }

    /// The image of the points that `index` names.
    fn paint(&self, index: &ImageArray<'py>, threads: Option<usize>) -> PyResult<Bound<'py, PyUntypedArray>> {
        by_size!(self.array, "values", paint_as(self, index, threads))
    }
}

fn check_border<T: Sample>(values: &Values<'_>) -> PyResult<()> {
    border::<T>(values).map(drop)
}

/// The border value of each column.
fn border<T: Sample>(values: &Values<'_>) -> PyResult<Vec<T>> {
    let columns = values.array.shape().get(1).copied().unwrap_or(1);
    let border = values.border.samples::<T>(&values.array.dtype())?;
    match border.len() {
        1 => Ok(buffer::filled("border_value", columns, border[0])?),
        got if got == columns => Ok(border),
        got => Err(crate::error::ViewError::BorderChannels { expected: columns, got }.into()),
    }
}

fn paint_as<'py, T: Sample>(
    values: &Values<'py>,
    index: &ImageArray<'py>,
    threads: Option<usize>,
) -> PyResult<Bound<'py, PyUntypedArray>> {
    let py = values.array.py();
    let border = border::<T>(values)?;
    let (width, height) = index.size();
    let shape = [height, width, border.len()];
    let out = ImageArray::allocate(&shape[..values.array.ndim() + 1], values.array.dtype(), Layout::Hwc)?;
    let rows = match values.array.shape()[0] {
        0 => None,
        _ => {
            let contiguous = py.import("numpy")?.call_method1("ascontiguousarray", (&values.array,))?;
            Some(ImageArray::new("values", as_image(&contiguous.cast_into()?)?, Layout::Hwc)?)
        }
    };
    {
        let (rows, index) = (rows.as_ref().map(ImageArray::read).transpose()?, index.read()?);
        let views = rows.as_ref().map(|rows| rows.views::<T>()).transpose()?;
        let indices = index.views::<i64>()?;
        let mut write = out.write()?;
        let mut outs = write.views::<T>()?;
        let rows: Option<&ImageView<'_, T>> = views.as_ref().map(|views| &views[0]);
        detached::run(py, || paint_into(&indices[0], rows, &border, &mut outs[0], threads))?;
    }
    Ok(out.into_array())
}
