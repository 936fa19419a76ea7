//! `BevGrid`.

use std::hash::{Hash, Hasher};

use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

use super::convert::{Call, Floats, Reduced, float_or_two, floats, rebuilt_by_new, type_name, word};
use super::detached;
use super::each::each_row;
use super::error::classes::{ArgumentError, ArgumentTypeError};
use crate::parallel::check_interrupt;
use crate::view::buffer;
use crate::{BevGrid, SampleAt};

#[doc = help!("BevGrid")]
#[pyclass(frozen, eq, hash, module = "ipm_rs", name = "BevGrid")]
#[derive(PartialEq)]
pub(super) struct PyBevGrid {
    pub(super) grid: BevGrid,
}

impl Hash for PyBevGrid {
    fn hash<H: Hasher>(&self, state: &mut H) {
        let grid = &self.grid;
        let (x, y, resolution) = (grid.x(), grid.y(), grid.resolution());
        for value in [x.0, x.1, y.0, y.1, resolution.0, resolution.1] {
            (value + 0.0).to_bits().hash(state); // 0.0 and -0.0 are equal
        }
        grid.sample_at().hash(state);
    }
}

#[pymethods]
impl PyBevGrid {
    #[new]
    #[pyo3(
        signature = (*positional, x = None, y = None, resolution = None, sample_at = None),
        text_signature = "(*, x, y, resolution, sample_at='center')"
    )]
    fn new(
        positional: &Bound<'_, PyTuple>,
        x: Option<&Bound<'_, PyAny>>,
        y: Option<&Bound<'_, PyAny>>,
        resolution: Option<&Bound<'_, PyAny>>,
        sample_at: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let call = Call::new("BevGrid", "BevGrid(x=(6, 40), y=(-8, 8), resolution=0.05)", positional)?;
        let (x, y, resolution) = (call.needs("x", x)?, call.needs("y", y)?, call.needs("resolution", resolution)?);
        let range =
            |name, object| floats::<2>(name, "a range (min, max) in metres", object).map(|[min, max]| (min, max));
        let [dx, dy] = float_or_two("resolution", "a cell size in metres, or (along x, along y)", resolution)?;
        let sample_at = match sample_at {
            None => SampleAt::Center,
            Some(object) => {
                let expected = "sample_at: expected \"center\" or \"corner\"";
                match word(expected, object)?.as_ref() {
                    "center" => SampleAt::Center,
                    "corner" => SampleAt::Corner,
                    other => return Err(ArgumentError::new_err(format!("{expected}, got {other:?}"))),
                }
            }
        };
        Ok(Self { grid: BevGrid::new(range("x", x)?, range("y", y)?, (dx, dy), sample_at)? })
    }

    #[doc = help!("BevGrid.shape")]
    #[getter]
    fn shape(&self) -> (usize, usize) {
        (self.grid.rows(), self.grid.columns())
    }

    #[doc = help!("BevGrid.x")]
    #[getter]
    fn x(&self) -> (f64, f64) {
        self.grid.x()
    }

    #[doc = help!("BevGrid.y")]
    #[getter]
    fn y(&self) -> (f64, f64) {
        self.grid.y()
    }

    #[doc = help!("BevGrid.resolution")]
    #[getter]
    fn resolution(&self) -> (f64, f64) {
        self.grid.resolution()
    }

    #[doc = help!("BevGrid.sample_at")]
    #[getter]
    fn sample_at(&self) -> &'static str {
        match self.grid.sample_at() {
            SampleAt::Center => "center",
            SampleAt::Corner => "corner",
        }
    }

    #[doc = help!("BevGrid.xy")]
    fn xy<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let (rows, columns) = self.shape();
        let points = detached::run(py, || {
            let mut points = buffer::reserved("xy", 2 * rows * columns)?;
            for row in 0..rows {
                check_interrupt()?;
                let x = self.grid.x_of_row(row as f64);
                points.extend((0..columns).flat_map(|column| [x, self.grid.y_of_column(column as f64)]));
            }
            Ok(points)
        })?;
        PyArray1::from_vec(py, points).reshape([rows, columns, 2])
    }

    #[doc = help!("BevGrid.cell_from_ground")]
    fn cell_from_ground<'py>(&self, xy: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let floats = Floats::new("xy", "an (N, 2) array", xy)?;
        each_row(xy.py(), None, floats.rows::<2>("xy")?, |&point| self.grid.cell_from_ground(point))
    }

    #[doc = help!("BevGrid.ground_from_cell")]
    fn ground_from_cell<'py>(&self, rc: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let floats = Floats::new("rc", "an (N, 2) array", rc)?;
        each_row(rc.py(), None, floats.rows::<2>("rc")?, |&cell| self.grid.ground_from_cell(cell))
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        let keywords = PyDict::new(py);
        keywords.set_item("x", self.x())?;
        keywords.set_item("y", self.y())?;
        keywords.set_item("resolution", self.resolution())?;
        keywords.set_item("sample_at", self.sample_at())?;
        rebuilt_by_new(py.get_type::<Self>(), PyTuple::empty(py), keywords)
    }

    fn __repr__(&self) -> String {
        let (x, y, resolution) = (self.x(), self.y(), self.resolution());
        let (rows, columns) = self.shape();
        format!(
            "BevGrid(x=({}, {}), y=({}, {}), resolution=({}, {}), sample_at=\"{}\")  # {rows} rows x {columns} columns",
            x.0,
            x.1,
            y.0,
            y.1,
            resolution.0,
            resolution.1,
            self.sample_at()
        )
    }
}

/// A grid, and not something else.
pub(super) fn bev_grid<'a>(grid: &'a Bound<'_, PyAny>) -> PyResult<&'a PyBevGrid> {
    grid.cast::<PyBevGrid>()
        .map(Bound::get)
        .map_err(|_| ArgumentTypeError::new_err(format!("grid: expected an ipm_rs.BevGrid, got {}", type_name(grid))))
}
