//! `Plane`, `HeightMap`, and the argument `ground=`.

use std::hash::{Hash, Hasher};
use std::sync::Arc;

use numpy::{PyArray1, PyArray2, PyArrayMethods, PyUntypedArray};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyFloat, PyTuple, PyType};

use super::arrays;
use super::convert::{Call, Floats, Reduced, float, float_or_two, floats, rebuilt_by_new, tuple_text, type_name};
use super::detached;
use super::each::each_number;
use super::error::classes::{ArgumentError, ArgumentTypeError};
use super::grid::bev_grid;
use crate::view::buffer;
use crate::{Ground, HeightMap, Plane};

#[doc = help!("Plane")]
#[pyclass(frozen, eq, hash, module = "ipm_rs", name = "Plane")]
#[derive(PartialEq)]
pub(super) struct PyPlane {
    pub(super) plane: Plane,
}

impl Hash for PyPlane {
    fn hash<H: Hasher>(&self, state: &mut H) {
        hash_floats(&self.plane.coefficients(), state);
    }
}

#[pymethods]
impl PyPlane {
    #[new]
    #[pyo3(signature = (*positional, normal = None, point = None), text_signature = "(*, normal, point=(0.0, 0.0, 0.0))")]
    fn new(
        positional: &Bound<'_, PyTuple>,
        normal: Option<&Bound<'_, PyAny>>,
        point: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let call = Call::new("Plane", "Plane(normal=(0, 0, 1), point=(0, 0, -0.3))", positional)?;
        let normal = call.needs("normal", normal)?;
        let normal = floats("normal", "(x, y, z)", normal)?;
        let point = point.map_or(Ok([0.0; 3]), |object| floats("point", "(x, y, z) in metres", object))?;
        Ok(Self { plane: Plane::new(normal, point)? })
    }

    #[doc = help!("Plane.from_coefficients")]
    #[classmethod]
    fn from_coefficients(
        _cls: &Bound<'_, PyType>,
        a: &Bound<'_, PyAny>,
        b: &Bound<'_, PyAny>,
        c: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        Ok(Self { plane: Plane::from_coefficients(float("a", a)?, float("b", b)?, float("c", c)?)? })
    }

    #[doc = help!("Plane.from_angles")]
    #[classmethod]
    #[pyo3(
        signature = (*positional, slope = None, bank = None, height = None),
        text_signature = "(*, slope=0.0, bank=0.0, height=0.0)"
    )]
    fn from_angles(
        _cls: &Bound<'_, PyType>,
        positional: &Bound<'_, PyTuple>,
        slope: Option<&Bound<'_, PyAny>>,
        bank: Option<&Bound<'_, PyAny>>,
        height: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        Call::new("Plane.from_angles", "Plane.from_angles(slope=0.02, bank=0.01, height=-0.3)", positional)?;
        let number = |name, object: Option<&Bound<'_, PyAny>>| object.map_or(Ok(0.0), |object| float(name, object));
        let (slope, bank, height) = (number("slope", slope)?, number("bank", bank)?, number("height", height)?);
        Ok(Self { plane: Plane::from_angles(slope, bank, height)? })
    }

    #[doc = help!("Plane.coefficients")]
    #[getter]
    fn coefficients(&self) -> (f64, f64, f64) {
        self.plane.coefficients().into()
    }

    #[doc = help!("Plane.normal")]
    #[getter]
    fn normal<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.plane.normal().as_slice())
    }

    #[doc = help!("Plane.height_at")]
    fn height_at<'py>(&self, xy: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        heights_at(&self.plane.into(), xy)
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (f64, f64, f64))> {
        Ok((py.get_type::<Self>().getattr("from_coefficients")?, self.coefficients()))
    }

    fn __repr__(&self) -> String {
        let (a, b, c) = self.coefficients();
        format!("Plane.from_coefficients({a:?}, {b:?}, {c:?})  # z = a + b x + c y")
    }
}

#[doc = help!("HeightMap")]
#[pyclass(frozen, eq, hash, module = "ipm_rs", name = "HeightMap")]
#[derive(PartialEq)]
pub(super) struct PyHeightMap {
    map: Arc<HeightMap>,
}

impl Hash for PyHeightMap {
    fn hash<H: Hasher>(&self, state: &mut H) {
        let (origin, spacing) = (self.map.origin(), self.map.spacing());
        hash_floats(&[origin.0, origin.1, spacing.0, spacing.1], state);
        self.shape().hash(state);
        hash_floats(self.map.heights(), state);
    }
}

#[pymethods]
impl PyHeightMap {
    #[new]
    #[pyo3(
        signature = (heights, *positional, origin = None, spacing = None),
        text_signature = "(heights, *, origin, spacing)"
    )]
    fn new(
        heights: &Bound<'_, PyAny>,
        positional: &Bound<'_, PyTuple>,
        origin: Option<&Bound<'_, PyAny>>,
        spacing: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let call = Call::new("HeightMap", "HeightMap(heights, origin=(0, -10), spacing=0.5)", positional)?;
        let (origin, spacing) = (call.needs("origin", origin)?, call.needs("spacing", spacing)?);
        let origin = floats::<2>("origin", "(x, y) of heights[0, 0] in metres", origin)?;
        let spacing = float_or_two("spacing", "metres between nodes, or (along x, along y)", spacing)?;
        Self::of(&heights_of(heights)?, origin.into(), spacing.into())
    }

    #[doc = help!("HeightMap.on_grid")]
    #[classmethod]
    fn on_grid(_cls: &Bound<'_, PyType>, heights: &Bound<'_, PyAny>, grid: &Bound<'_, PyAny>) -> PyResult<Self> {
        let grid = &bev_grid(grid)?.grid;
        let expected = [grid.rows(), grid.columns()];
        let heights = heights_of(heights)?;
        let got = Floats::of("heights", &heights)?;
        if got.shape() != expected {
            return Err(ArgumentError::new_err(format!(
                "heights: expected the grid's shape {}, got {}",
                tuple_text(&expected),
                tuple_text(got.shape())
            )));
        }
        let [x, y] = grid.ground_from_cell([0.0, 0.0]);
        let (dx, dy) = grid.resolution();
        Self::of(&heights, (x, y), (-dx, -dy))
    }

    #[doc = help!("HeightMap.heights")]
    #[getter]
    fn heights<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        PyArray1::from_slice(py, self.map.heights()).reshape(self.shape())
    }

    #[doc = help!("HeightMap.shape")]
    #[getter]
    fn shape(&self) -> (usize, usize) {
        (self.map.rows(), self.map.columns())
    }

    #[doc = help!("HeightMap.origin")]
    #[getter]
    fn origin(&self) -> (f64, f64) {
        self.map.origin()
    }

    #[doc = help!("HeightMap.spacing")]
    #[getter]
    fn spacing(&self) -> (f64, f64) {
        self.map.spacing()
    }

    #[doc = help!("HeightMap.height_at")]
    fn height_at<'py>(&self, xy: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        heights_at(&Ground::HeightMap(Arc::clone(&self.map)), xy)
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        let keywords = PyDict::new(py);
        keywords.set_item("origin", self.origin())?;
        keywords.set_item("spacing", self.spacing())?;
        rebuilt_by_new(py.get_type::<Self>(), PyTuple::new(py, [self.heights(py)?])?, keywords)
    }

    fn __repr__(&self) -> String {
        let (rows, columns) = self.shape();
        let (origin, spacing) = (self.origin(), self.spacing());
        let known = self.map.heights().iter().filter(|height| !height.is_nan());
        let (low, high) = known.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), z| (low.min(*z), high.max(*z)));
        format!("HeightMap({rows} x {columns} heights from {low} to {high} m, origin={origin:?}, spacing={spacing:?})")
    }
}

impl PyHeightMap {
    fn of(heights: &Bound<'_, PyUntypedArray>, origin: (f64, f64), spacing: (f64, f64)) -> PyResult<Self> {
        let floats = Floats::of("heights", heights)?;
        let [_, columns] = *floats.shape() else {
            let got = tuple_text(floats.shape());
            return Err(ArgumentError::new_err(format!("heights: expected shape (rows, columns), got {got}")));
        };
        let values = floats.values();
        let map = detached::run(heights.py(), || {
            HeightMap::new(buffer::copied("heights", values)?, columns, origin, spacing)
        })?;
        Ok(Self { map: Arc::new(map) })
    }
}

fn heights_of<'py>(object: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyUntypedArray>> {
    arrays::numbers("heights", "a (rows, columns) array", object)
}

/// The road: z = 0 where nothing is said.
pub(super) fn road(ground: Option<&Bound<'_, PyAny>>) -> PyResult<Ground> {
    let Some(ground) = ground else { return Ok(Ground::default()) };
    if let Ok(plane) = ground.cast::<PyPlane>() {
        return Ok(plane.get().plane.into());
    }
    if let Ok(map) = ground.cast::<PyHeightMap>() {
        return Ok(Ground::HeightMap(Arc::clone(&map.get().map)));
    }
    let height =
        float("ground", ground).map_err(|error| match error.is_instance_of::<ArgumentTypeError>(ground.py()) {
            true => {
                let got = type_name(ground);
                let expected = "a height in metres, an ipm_rs.Plane or an ipm_rs.HeightMap";
                ArgumentTypeError::new_err(format!("ground: expected {expected}, got {got}"))
            }
            false => error,
        })?;
    Ok(Ground::height(height)?)
}

/// A road as Python has it, which [`road`] takes back: a number where it is level, else the `Plane` or the `HeightMap`.
pub(super) fn road_object<'py>(py: Python<'py>, ground: &Ground) -> PyResult<Bound<'py, PyAny>> {
    match ground {
        Ground::Plane(plane) => match plane.coefficients() {
            [height, 0.0, 0.0] => Ok(PyFloat::new(py, height).into_any()),
            _ => Ok(Bound::new(py, PyPlane { plane: *plane })?.into_any()),
        },
        Ground::HeightMap(map) => Ok(Bound::new(py, PyHeightMap { map: Arc::clone(map) })?.into_any()),
    }
}

/// The road, if one is given.
pub(super) fn given_road(ground: Option<&Bound<'_, PyAny>>) -> PyResult<Option<Ground>> {
    ground.filter(|ground| !ground.is_none()).map(|ground| road(Some(ground))).transpose()
}

/// The road under (N, 2) points; refused with points that have their own height.
pub(super) fn only_ground(given: Option<Ground>, on_ground: bool) -> PyResult<Ground> {
    if given.is_some() && !on_ground {
        return Err(ArgumentError::new_err(
            "ground: expected only with (N, 2) points, got points that have their own height; drop one of the two",
        ));
    }
    Ok(given.unwrap_or_default())
}

/// A road that has a horizon: a height or a plane.
pub(super) fn plane_of(ground: Option<&Bound<'_, PyAny>>) -> PyResult<Plane> {
    match road(ground)? {
        Ground::Plane(plane) => Ok(plane),
        Ground::HeightMap(_) => {
            let message =
                "ground: expected a height in metres or an ipm_rs.Plane, got HeightMap, which has no one horizon";
            Err(ArgumentTypeError::new_err(message))
        }
    }
}

fn heights_at<'py>(ground: &Ground, xy: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let floats = Floats::new("xy", "an (N, 2) array", xy)?;
    let rows = floats.rows::<2>("xy")?;
    each_number(xy.py(), rows, |&[x, y]| ground.height_at(x, y))
}

/// Hashes numbers as `==` compares them: 0.0 is -0.0, and NaN, a height that is not known, is NaN.
fn hash_floats<H: Hasher>(values: &[f64], state: &mut H) {
    for value in values {
        let bits = if value.is_nan() { f64::NAN.to_bits() } else { (value + 0.0).to_bits() };
        bits.hash(state);
    }
}
