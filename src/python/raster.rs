//! `rasterize`.

use numpy::{Element, PyArray1, PyArrayDescrMethods, PyArrayMethods, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyString, PyTuple};

use super::arrays;
use super::convert::{Floats, MOST_ITEMS, count_text, float, items, tuple_text, type_name, word};
use super::detached;
use super::error::classes::{ArgumentError, ArgumentTypeError, DtypeError};
use super::grid::PyBevGrid;
use super::options::thread_count;
use super::shared;
use crate::raster::{Coordinates, RasterOptions, Reduce, Values, rasterize_values};
use crate::view::{PointSample, Sample, Strided, buffer};
use crate::{BevGrid, raster};

#[doc = help!("rasterize")]
#[pyfunction]
#[pyo3(
    signature = (points, grid, values = None, reduce = None, *, slices = None, density_full = None, threads = None),
    text_signature = "(points, grid, values=None, reduce=('count', 'max', 'mean'), *, slices=None, density_full=64.0, threads=None)"
)]
#[expect(clippy::too_many_arguments, reason = "Python's keywords")]
pub(super) fn rasterize<'py>(
    py: Python<'py>,
    points: &Bound<'py, PyAny>,
    grid: &Bound<'py, PyAny>,
    values: Option<&Bound<'py, PyAny>>,
    reduce: Option<&Bound<'py, PyAny>>,
    slices: Option<&Bound<'py, PyAny>>,
    density_full: Option<&Bound<'py, PyAny>>,
    threads: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let grid = self::grid(grid)?;
    let reduce = reduce.map_or_else(|| Ok(RasterOptions::default().reduce.to_vec()), reduces)?;
    let slices = match slices {
        Some(object) => {
            let floats = Floats::new("slices", "a list", object)?;
            if floats.shape().len() != 1 {
                let got = tuple_text(floats.shape());
                return Err(ArgumentError::new_err(format!("slices: expected a list of heights, got shape {got}")));
            }
            if floats.values().is_empty() {
                return Err(crate::error::RasterError::Slices { got: Vec::new() }.into());
            }
            buffer::copied("slices", floats.values())?
        }
        None => Vec::new(),
    };
    let density_full = density_full.map_or(Ok(64.0), |object| float("density_full", object))?;
    let threads = threads.map(|object| thread_count("threads", object)).transpose()?;
    let options = RasterOptions { reduce: &reduce, slices: &slices, density_full, threads };

    let points = array_of("points", points)?;
    let values = values.map(|object| array_of("values", object)).transpose()?;
    let points = Table::points(points)?;
    let values = values.map(|array| Table::values(array, &points)).transpose()?;
    let call = Call { grid, options: &options };
    match (points.kind(), values) {
        (Kind::F32, None) => points.with::<f32, _>(|points| call.z(py, points)),
        (Kind::F64, None) => points.with::<f64, _>(|points| call.z(py, points)),
        (Kind::F32, Some(values)) => points.with::<f32, _>(|points| call.values(py, points, &values)),
        (Kind::F64, Some(values)) => points.with::<f64, _>(|points| call.values(py, points, &values)),
        _ => Err(DtypeError::new_err(format!(
            "points: expected float32 or float64, got {}; use points.astype(numpy.float32)",
            points.array.dtype()
        ))),
    }
}

/// What is asked for, whatever the types of points and values.
struct Call<'a> {
    grid: BevGrid,
    options: &'a RasterOptions<'a>,
}

impl Call<'_> {
    fn z<'py, P: PointSample + Element>(
        &self,
        py: Python<'py>,
        points: &Strided<'_, P>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let raster = detached::run(py, || raster::rasterize(points, None, &self.grid, self.options))?;
        self.layers(py, raster, None)
    }

    fn values<'py>(
        &self,
        py: Python<'py>,
        points: &dyn Coordinates,
        values: &Table<'py>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let channels = (values.array.ndim() > values.points_dims).then_some(values.columns);
        macro_rules! with {
            ($number:ty, $layer:ty) => {
                values.with::<$number, _>(|values| self.run::<$layer>(py, points, values, channels))
            };
        }
        match values.kind() {
            Kind::F32 => with!(f32, f32),
            Kind::F64 => with!(f64, f64),
            Kind::U8 => with!(u8, f32),
            Kind::I8 => with!(i8, f32),
            Kind::U16 => with!(u16, f32),
            Kind::I16 => with!(i16, f32),
            Kind::U32 => with!(u32, f64),
            Kind::I32 => with!(i32, f64),
            Kind::U64 => with!(u64, f64),
            Kind::I64 => with!(i64, f64),
            Kind::Other => Err(DtypeError::new_err(format!(
                "values: expected bool, integers, float32 or float64, got {}; use values.astype(numpy.float32)",
                values.array.dtype()
            ))),
        }
    }

    fn run<'py, T: PointSample + Element>(
        &self,
        py: Python<'py>,
        points: &dyn Coordinates,
        values: &dyn Values<T>,
        channels: Option<usize>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let raster = detached::run(py, || rasterize_values(points, values, &self.grid, self.options))?;
        self.layers(py, raster, channels)
    }

    /// `ipm_rs.Layers`.
    fn layers<'py, T: PointSample + Element>(
        &self,
        py: Python<'py>,
        mut raster: raster::Raster<T>,
        channels: Option<usize>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (slices, rows, columns) = raster.shape;
        let mut shape = vec![rows, columns];
        if !self.options.slices.is_empty() {
            shape.insert(0, slices);
        }
        let mut sample_shape = shape.clone();
        sample_shape.extend(channels);
        let layers = PyDict::new(py);
        for &reduce in self.options.reduce {
            let layer = match reduce {
                Reduce::Count => array(py, raster.count.take(), &shape)?,
                Reduce::Density => array(py, raster.density.take(), &shape)?,
                Reduce::Min => array(py, raster.min.take(), &sample_shape)?,
                Reduce::Max => array(py, raster.max.take(), &sample_shape)?,
                Reduce::Mean => array(py, raster.mean.take(), &sample_shape)?,
                Reduce::Last => array(py, raster.last.take(), &sample_shape)?,
                Reduce::Top => array(py, raster.top.take(), &sample_shape)?,
            };
            if let Some(layer) = layer {
                layers.set_item(reduce.name(), layer)?;
            }
        }
        let class = py.import("ipm_rs.layers")?.getattr("Layers")?;
        class.call1((layers, raster.inside, raster.outside, raster.ignored))
    }
}

/// A layer as an array, once: a name that is asked for twice is one layer.
fn array<'py, E: Element>(
    py: Python<'py>,
    layer: Option<Vec<E>>,
    shape: &[usize],
) -> PyResult<Option<Bound<'py, PyAny>>> {
    layer.map(|layer| Ok(PyArray1::from_vec(py, layer).reshape(shape)?.into_any())).transpose()
}

pub(super) fn grid(object: &Bound<'_, PyAny>) -> PyResult<BevGrid> {
    match object.cast::<PyBevGrid>() {
        Ok(grid) => Ok(grid.get().grid),
        Err(_) => {
            let got = type_name(object);
            Err(ArgumentTypeError::new_err(format!("grid: expected an ipm_rs.BevGrid, got {got}")))
        }
    }
}

/// One name or several.
fn reduces(object: &Bound<'_, PyAny>) -> PyResult<Vec<Reduce>> {
    let names = Reduce::ALL.map(|reduce| format!("\"{}\"", reduce.name())).join(", ");
    let expected = format!("reduce: expected names of layers among {names}");
    let refuse = |got: String| ArgumentTypeError::new_err(format!("{expected}, got {got}"));
    let items = match object.is_instance_of::<PyString>() {
        true => vec![object.clone()],
        false => items(object, refuse)?,
    };
    if items.is_empty() || items.len() == MOST_ITEMS {
        let got = if items.is_empty() { "none".to_owned() } else { count_text(items.len()) };
        return Err(ArgumentError::new_err(format!("{expected}, got {got}")));
    }
    let one = |item: &Bound<'_, PyAny>| {
        let name = word(&expected, item)?;
        let found = Reduce::ALL.into_iter().find(|reduce| reduce.name() == name);
        found.ok_or_else(|| ArgumentError::new_err(format!("{expected}, got {name:?}")))
    };
    items.iter().map(one).collect()
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    F32,
    F64,
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
    U64,
    I64,
    Other,
}

/// An array as rows and columns of numbers: (N,), (N, C), (H, W) or (H, W, C).
struct Table<'py> {
    name: &'static str,
    array: Bound<'py, PyUntypedArray>,
    rows: usize,
    columns: usize,
    /// Bytes from one row to the next, and from one column to the next.
    strides: (isize, isize),
    /// How many axes of the array count points.
    points_dims: usize,
}

impl<'py> Table<'py> {
    fn points(array: Bound<'py, PyUntypedArray>) -> PyResult<Self> {
        if !matches!(array.ndim(), 2 | 3) || array.shape()[array.ndim() - 1] < 2 {
            return Err(ArgumentError::new_err(format!(
                "points: expected shape (N, 3), or (H, W, 3) of an organised cloud, with at least x, y in the last axis, got {}",
                tuple_text(array.shape())
            )));
        }
        let points_dims = array.ndim() - 1;
        Self::new("points", array, points_dims)
    }

    fn values(array: Bound<'py, PyUntypedArray>, points: &Self) -> PyResult<Self> {
        let dims = points.points_dims;
        let expected = &points.array.shape()[..dims];
        if !(dims..=dims + 1).contains(&array.ndim()) || array.shape()[..dims] != *expected {
            let lengths = expected.iter().map(usize::to_string).collect::<Vec<_>>().join(", ");
            return Err(ArgumentError::new_err(format!(
                "values: expected shape ({lengths},) or ({lengths}, C), a value or C of them for each point, got {}",
                tuple_text(array.shape())
            )));
        }
        Self::new("values", array, dims)
    }

    /// Over the array's own memory where its numbers can be read there, else over a copy.
    fn new(name: &'static str, array: Bound<'py, PyUntypedArray>, points_dims: usize) -> PyResult<Self> {
        let array = arrays::native(name, array)?;
        if let Some(strides) = strides_of(&array, points_dims) {
            return Ok(Self::with_strides(name, array, strides, points_dims));
        }
        let array = arrays::copied(name, &array, &array.dtype())?;
        let columns = array.shape()[points_dims..].iter().product::<usize>() as isize;
        let sample = array.dtype().itemsize() as isize;
        Ok(Self::with_strides(name, array, (columns * sample, sample), points_dims))
    }

    fn with_strides(
        name: &'static str,
        array: Bound<'py, PyUntypedArray>,
        strides: (isize, isize),
        points_dims: usize,
    ) -> Self {
        let rows = array.shape()[..points_dims].iter().product();
        let columns = array.shape().get(points_dims).copied().unwrap_or(1);
        let strides = (if rows > 1 { strides.0 } else { 0 }, if columns > 1 { strides.1 } else { 0 });
        Self { name, array, rows, columns, strides, points_dims }
    }

    fn kind(&self) -> Kind {
        let dtype = self.array.dtype();
        match (dtype.kind(), dtype.itemsize()) {
            (b'f', 4) => Kind::F32,
            (b'f', 8) => Kind::F64,
            (b'u' | b'b', 1) => Kind::U8,
            (b'i', 1) => Kind::I8,
            (b'u', 2) => Kind::U16,
            (b'i', 2) => Kind::I16,
            (b'u', 4) => Kind::U32,
            (b'i', 4) => Kind::I32,
            (b'u', 8) => Kind::U64,
            (b'i', 8) => Kind::I64,
            _ => Kind::Other,
        }
    }

    /// Borrows the array while `work` reads its numbers, which are of the size and the kind of `S`.
    fn with<S: Sample, R>(&self, work: impl FnOnce(&Strided<'_, S>) -> PyResult<R>) -> PyResult<R> {
        if self.rows == 0 || self.columns == 0 {
            return work(&Strided::with_strides(&[], (self.rows, self.columns), 0, (0, 0))?);
        }
        let borrowed = arrays::to_borrow(&self.array)?;
        // SAFETY: `PyArrayDyn<T>` is a transparent NumPy array whatever T is, and no element is read as T.
        let _borrow = arrays::borrow::<u8>(self.name, unsafe { borrowed.cast_unchecked() })?;
        // SAFETY: the strides are the array's own, or lead over its axes one after the other, and the borrow keeps
        // writers that use rust-numpy away.
        let table = unsafe { arrays::table::<S>(&self.array, (self.rows, self.columns), self.strides) }?;
        work(&table)
    }
}

/// Bytes from one point to the next, and from one number of a point to the next; `None` where no one step leads from
/// each point to the next, or a step is no whole number of elements.
fn strides_of(array: &Bound<'_, PyUntypedArray>, points_dims: usize) -> Option<(isize, isize)> {
    let (shape, strides) = (array.shape(), array.strides());
    let rows: usize = shape[..points_dims].iter().product();
    // two axes of points are one if no row of the cloud has a gap behind it
    let row = match points_dims {
        1 => strides[0],
        _ if shape[0] <= 1 => strides[1],
        _ if shape[1] == 1 => strides[0],
        _ if strides[0] == strides[1].wrapping_mul(shape[1] as isize) || rows == 0 => strides[1],
        _ => return None,
    };
    let column = strides.get(points_dims).copied().unwrap_or(0);
    let sample = array.dtype().itemsize().max(1) as isize;
    let is_whole = |count: usize, stride: isize| count <= 1 || stride % sample == 0;
    let columns = shape.get(points_dims).copied().unwrap_or(1);
    (is_whole(rows, row) && is_whole(columns, column)).then_some((row, column))
}

/// The array of an argument; of a list, that of its numbers. Its Python code runs here.
fn array_of<'py>(name: &str, object: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyUntypedArray>> {
    if object.is_instance_of::<PyList>() || object.is_instance_of::<PyTuple>() {
        let array = arrays::numbers(name, "an array", object)?;
        return Ok(arrays::require::<f64>(name, &array)?.as_untyped().clone());
    }
    shared::array(name, object, false)
}
