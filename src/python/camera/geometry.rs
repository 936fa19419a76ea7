//! `Camera`: derived cameras, cells, polylines, the horizon, ranges.

use nalgebra::Vector3;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyTuple, PyType};

use super::PyCamera;
use crate::parallel::num_threads;
use crate::python::cloud::{Projected, ProjectedArrays};
use crate::python::convert::{Call, Floats, flag, float, float_or_two, floats, rows_to_numpy, size, whole, word};
use crate::python::detached;
use crate::python::each::{WHAT, each_number, each_projected, each_row, map, numbers};
use crate::python::error::classes::ArgumentError;
use crate::python::grid::bev_grid;
use crate::python::ground::{given_road, only_ground, plane_of, road};
use crate::python::lens::lens as lens_model;
use crate::python::warnings::checked;
use crate::view::buffer;
use crate::{Binning, Camera, ImageMask, Pinhole, RangeError};

/// One pixel, in degrees of pitch that are as hard to keep.
const DEFAULT_PITCH: f64 = 0.1;

#[pymethods]
impl PyCamera {
    #[doc = help!("Camera.from_vanishing_point")]
    #[classmethod]
    #[pyo3(
        signature = (vanishing_point, *positional, image_size = None, focal_length = None, height = None, principal_point = None, roll = None, x = None, y = None, lens = None),
        text_signature = "(vanishing_point, *, image_size, focal_length, height, principal_point=None, roll=0.0, x=0.0, y=0.0, lens=None)"
    )]
    #[expect(clippy::too_many_arguments, reason = "keyword-only, each with one meaning")]
    fn from_vanishing_point(
        _cls: &Bound<'_, PyType>,
        vanishing_point: &Bound<'_, PyAny>,
        positional: &Bound<'_, PyTuple>,
        image_size: Option<&Bound<'_, PyAny>>,
        focal_length: Option<&Bound<'_, PyAny>>,
        height: Option<&Bound<'_, PyAny>>,
        principal_point: Option<&Bound<'_, PyAny>>,
        roll: Option<&Bound<'_, PyAny>>,
        x: Option<&Bound<'_, PyAny>>,
        y: Option<&Bound<'_, PyAny>>,
        lens: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        const EXAMPLE: &str =
            "Camera.from_vanishing_point((640, 340), image_size=(1280, 720), focal_length=900, height=1.4)";
        let call = Call::new("Camera.from_vanishing_point", EXAMPLE, positional)?;
        let (image_size, height) = (call.needs("image_size", image_size)?, call.needs("height", height)?);
        let focal_length = call.needs("focal_length", focal_length)?;
        let number = |name, object: Option<&Bound<'_, PyAny>>| object.map_or(Ok(0.0), |object| float(name, object));
        let vanishing_point = floats::<2>("vanishing_point", "(u, v) in pixels", vanishing_point)?;
        let (width, height_px) = size("image_size", image_size)?;
        let [fx, fy] = float_or_two("focal_length", "pixels, or (fx, fy)", focal_length)?;
        let centre = |pixels: u32| (f64::from(pixels) - 1.0) / 2.0;
        let [cx, cy] = principal_point.map_or(Ok([centre(width), centre(height_px)]), |object| {
            floats("principal_point", "(cx, cy) in pixels", object)
        })?;
        let position = [number("x", x)?, number("y", y)?, float("height", height)?];
        let model = Pinhole::new(fx, fy, cx, cy, 0.0)?;
        let (lens, roll) = (lens_model(lens)?, number("roll", roll)?);
        let size = (width, height_px);
        let camera = Camera::from_vanishing_point(model, lens, size, vanishing_point, position, roll)?;
        Ok(checked(image_size.py(), camera)?.into())
    }

    #[doc = help!("Camera.binned")]
    #[pyo3(signature = (x, y = None, *, rule = None), text_signature = "(self, x, y=None, *, rule='area')")]
    fn binned(
        &self,
        x: &Bound<'_, PyAny>,
        y: Option<&Bound<'_, PyAny>>,
        rule: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let columns = whole("x", x)?;
        let rows = y.map_or(Ok(columns), |y| whole("y", y))?;
        let expected = "rule: expected \"area\" or \"first_pixel\"";
        let rule = match rule.map(|rule| word(expected, rule)).transpose()?.as_deref() {
            None | Some("area") => Binning::Area,
            Some("first_pixel") => Binning::FirstPixel,
            Some(other) => return Err(ArgumentError::new_err(format!("{expected}, got {other:?}"))),
        };
        self.with_image(self.camera.binned(columns, rows, rule)?, |mask| mask.binned(columns, rows))
    }

    #[doc = help!("Camera.rotated180")]
    fn rotated180(&self) -> PyResult<Self> {
        self.with_image(self.camera.rotated180(), ImageMask::rotated180)
    }

    #[doc = help!("Camera.mirrored")]
    fn mirrored(&self) -> PyResult<Self> {
        self.with_image(self.camera.mirrored(), ImageMask::mirrored)
    }

    #[doc = help!("Camera.pixels_from_cells")]
    #[pyo3(signature = (rc, grid, *, ground = None), text_signature = "(self, rc, grid, *, ground=0.0)")]
    fn pixels_from_cells<'py>(
        &self,
        rc: &Bound<'py, PyAny>,
        grid: &Bound<'py, PyAny>,
        ground: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Projected<'py>> {
        let (grid, ground) = (bev_grid(grid)?, road(ground)?);
        let floats = Floats::new("rc", "an (N, 2) array", rc)?;
        let rows = floats.rows::<2>("rc")?;
        let out = ProjectedArrays::new(rc.py(), rows.len(), None, &[])?;
        each_projected(rc.py(), None, rows, out, |&cell| self.camera.project_cell(cell, &grid.grid, &ground))
    }

    #[doc = help!("Camera.cells_from_pixels")]
    #[pyo3(signature = (uv, grid, *, ground = None), text_signature = "(self, uv, grid, *, ground=0.0)")]
    fn cells_from_pixels<'py>(
        &self,
        uv: &Bound<'py, PyAny>,
        grid: &Bound<'py, PyAny>,
        ground: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (grid, ground) = (bev_grid(grid)?, road(ground)?);
        let floats = Floats::new("uv", "an (N, 2) array", uv)?;
        let rows = floats.rows::<2>("uv")?;
        each_row(uv.py(), None, rows, |&pixel| {
            self.camera.cell_from_pixel(pixel, &grid.grid, &ground).unwrap_or([f64::NAN; 2])
        })
    }

    #[doc = help!("Camera.project_polyline")]
    #[pyo3(
        signature = (points, *, ground = None, closed = None, margin = None, tolerance = None),
        text_signature = "(self, points, *, ground=None, closed=False, margin=0.0, tolerance=0.25)"
    )]
    fn project_polyline<'py>(
        &self,
        points: &Bound<'py, PyAny>,
        ground: Option<&Bound<'py, PyAny>>,
        closed: Option<&Bound<'py, PyAny>>,
        margin: Option<&Bound<'py, PyAny>>,
        tolerance: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Vec<Bound<'py, PyArray2<f64>>>> {
        let py = points.py();
        let road = given_road(ground)?;
        let closed = closed.map_or(Ok(false), |closed| flag("closed", closed))?;
        let margin = margin.map_or(Ok(0.0), |margin| float("margin", margin))?;
        let tolerance = tolerance.map_or(Ok(TOLERANCE), |tolerance| float("tolerance", tolerance))?;
        let floats = Floats::new("points", "an (N, 3) array, or (N, 2) on the ground,", points)?;
        let on_ground = matches!(floats.shape(), [_, 2]);
        let ground = only_ground(road, on_ground)?;
        let pieces = if on_ground {
            let points = ring(floats.rows::<2>("points")?, closed, |point| point)?;
            detached::run(py, || self.camera.project_ground_polyline(&points, &ground, margin, tolerance))?
        } else {
            let points = ring(floats.rows::<3>("points")?, closed, Vector3::from)?;
            detached::run(py, || self.camera.project_polyline(&points, margin, tolerance))?
        };
        pieces.into_iter().map(|piece| rows_to_numpy(py, piece)).collect()
    }

    #[doc = help!("Camera.horizon")]
    #[pyo3(signature = (*, ground = None, tolerance = None), text_signature = "(self, *, ground=0.0, tolerance=0.25)")]
    fn horizon<'py>(
        &self,
        py: Python<'py>,
        ground: Option<&Bound<'py, PyAny>>,
        tolerance: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Vec<Bound<'py, PyArray2<f64>>>> {
        let plane = plane_of(ground)?;
        let tolerance = tolerance.map_or(Ok(TOLERANCE), |tolerance| float("tolerance", tolerance))?;
        let pieces = detached::run(py, || self.camera.horizon(&plane, tolerance))?;
        pieces.into_iter().map(|piece| rows_to_numpy(py, piece)).collect()
    }

    #[doc = help!("Camera.horizon_line")]
    #[pyo3(signature = (*, ground = None), text_signature = "(self, *, ground=0.0)")]
    fn horizon_line(&self, ground: Option<&Bound<'_, PyAny>>) -> PyResult<Option<(f64, f64, f64)>> {
        Ok(self.camera.horizon_line(&plane_of(ground)?)?.map(Into::into))
    }

    #[doc = help!("Camera.ground_range")]
    #[pyo3(signature = (uv, *, ground = None), text_signature = "(self, uv, *, ground=0.0)")]
    fn ground_range<'py>(
        &self,
        uv: &Bound<'py, PyAny>,
        ground: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let ground = road(ground)?;
        let floats = Floats::new("uv", "an (N, 2) array", uv)?;
        let rows = floats.rows::<2>("uv")?;
        let range = |&pixel: &_| self.camera.ground_range(pixel, &ground);
        each_number(uv.py(), rows, range)
    }

    #[doc = help!("Camera.row_ranges")]
    #[pyo3(signature = (*, column = None, ground = None), text_signature = "(self, *, column=None, ground=0.0)")]
    fn row_ranges<'py>(
        &self,
        py: Python<'py>,
        column: Option<&Bound<'py, PyAny>>,
        ground: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let ground = road(ground)?;
        let (width, height) = self.camera.image_size();
        let column = column.map_or(Ok((f64::from(width) - 1.0) / 2.0), |column| float("column", column))?;
        let rows = buffer::collected("row_ranges", (0..height as usize).map(|row| row as f64))?;
        each_number(py, &rows, |&row| self.camera.ground_range([column, row], &ground))
    }

    #[doc = help!("Camera.range_error")]
    #[pyo3(
        signature = (uv, *, ground = None, pixel = None, pitch_deg = None),
        text_signature = "(self, uv, *, ground=0.0, pixel=1.0, pitch_deg=0.1)"
    )]
    #[expect(clippy::type_complexity, reason = "(by_pixel, by_pitch)")]
    fn range_error<'py>(
        &self,
        uv: &Bound<'py, PyAny>,
        ground: Option<&Bound<'py, PyAny>>,
        pixel: Option<&Bound<'py, PyAny>>,
        pitch_deg: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<(Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>)> {
        let py = uv.py();
        let ground = road(ground)?;
        let positive = |name, object: Option<&Bound<'_, PyAny>>, default| -> PyResult<f64> {
            let value = object.map_or(Ok(default), |object| float(name, object))?;
            if value >= 0.0 && value.is_finite() {
                return Ok(value);
            }
            Err(ArgumentError::new_err(format!("{name}: expected a finite number of at least 0, got {value}")))
        };
        let pixels = positive("pixel", pixel, 1.0)?;
        let pitch = positive("pitch_deg", pitch_deg, DEFAULT_PITCH)?.to_radians();
        let floats = Floats::new("uv", "an (N, 2) array", uv)?;
        let rows = floats.rows::<2>("uv")?;
        let error = |&uv: &_| {
            let RangeError { pixel, pitch } = self.camera.range_error(uv, &ground, pixels, pitch);
            [pixel, pitch]
        };
        let errors = detached::run(py, || map(num_threads(), rows, error))?;
        let column = |column: usize| numbers(py, errors.iter().map(|error| error[column]));
        Ok((column(0)?, column(1)?))
    }
}

/// Pixels that an image of a curve may be off.
const TOLERANCE: f64 = 0.25;

/// The points, and the first again where they are closed.
fn ring<T: Copy, const K: usize>(
    points: &[[f64; K]],
    closed: bool,
    of: impl Fn([f64; K]) -> T,
) -> crate::Result<Vec<T>> {
    let mut ring = buffer::reserved(WHAT, points.len() + 1)?;
    ring.extend(points.iter().chain(points.first().filter(|_| closed)).map(|&point| of(point)));
    Ok(ring)
}
