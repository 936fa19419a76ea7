//! `Lut`.

use std::sync::Arc;

use nalgebra::Matrix3;
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::exceptions::PyMemoryError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyTuple, PyType};

use super::adjoint::{Adjoint, Transpose};
use super::camera::PyCamera;
use super::convert::{Call, flag, float, matrix3, size, tuple_text, type_name};
use super::detached;
use super::dtype::{Samples, Taken, for_blended, for_moved};
use super::error::classes::{ArgumentError, ArgumentTypeError, ImageError};
use super::grid::{PyBevGrid, bev_grid};
use super::ground::{road, road_object};
use super::image::{ImageArray, Output};
use super::layout::Layout;
use super::maps::{MapPair, map_arrays};
use super::mend::message;
use super::options::{self, BorderValue};
use super::shared;
use super::warnings::warn;
use crate::error::ViewError;
use crate::lut::Scene;
use crate::view::PointSample;
use crate::{Bilinear, BorderMode, Error, ImageMask, ImageView, ImageViewMut, Interpolation, Lut, Sample, WarpOptions};

#[doc = help!("Lut")]
#[pyclass(frozen, eq, module = "ipm_rs", name = "Lut")]
pub(super) struct PyLut {
    pub(super) lut: Lut,
    /// That of its camera, whose hidden pixels the table's cells do not show.
    mask: Option<Arc<ImageMask>>,
}

/// Equal are those whose cells all sample alike, whatever they were built from.
impl PartialEq for PyLut {
    fn eq(&self, other: &Self) -> bool {
        self.lut == other.lut
    }
}

impl From<Lut> for PyLut {
    fn from(lut: Lut) -> Self {
        Self { lut, mask: None }
    }
}

#[pymethods]
impl PyLut {
    #[new]
    #[pyo3(
        signature = (camera, grid, *positional, ground = None, border_mode = None),
        text_signature = "(camera, grid, *, ground=0.0, border_mode='constant')"
    )]
    fn new(
        camera: &Bound<'_, PyAny>,
        grid: &Bound<'_, PyAny>,
        positional: &Bound<'_, PyTuple>,
        ground: Option<&Bound<'_, PyAny>>,
        border_mode: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        Call::new("Lut", "Lut(camera, grid, ground=-0.3)", positional)?;
        let wrong = |name: &str, expected: &str, got: &Bound<'_, PyAny>| {
            ArgumentTypeError::new_err(format!("{name}: expected an ipm_rs.{expected}, got {}", type_name(got)))
        };
        let camera_ref = camera.cast::<PyCamera>().map_err(|_| wrong("camera", "Camera", camera))?.get();
        let grid_ref = grid.cast::<PyBevGrid>().map_err(|_| wrong("grid", "BevGrid", grid))?.get();
        let (ground, mode) = (road(ground)?, options::border_of_table(border_mode)?);
        let (lut, findings) = detached::run(camera.py(), || {
            let mut lut = Lut::new_with(&camera_ref.camera, &grid_ref.grid, &ground, mode)?;
            if let Some(mask) = &camera_ref.mask {
                lut = lut.masked(mask)?;
            }
            let findings = lut.plausibility();
            Ok::<_, Error>((lut, findings))
        })?;
        warn(camera.py(), &findings)?;
        Ok(Self { lut, mask: camera_ref.mask.clone() })
    }

    #[doc = help!("Lut.from_maps")]
    #[classmethod]
    #[pyo3(
        signature = (map_x, map_y, *positional, source_size = None, border_mode = None, source_wraps = None),
        text_signature = "(map_x, map_y, *, source_size, border_mode='constant', source_wraps=False)"
    )]
    fn from_maps(
        _cls: &Bound<'_, PyType>,
        map_x: &Bound<'_, PyAny>,
        map_y: &Bound<'_, PyAny>,
        positional: &Bound<'_, PyTuple>,
        source_size: Option<&Bound<'_, PyAny>>,
        border_mode: Option<&Bound<'_, PyAny>>,
        source_wraps: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let call = Call::new("Lut.from_maps", "Lut.from_maps(map_x, map_y, source_size=(1920, 1080))", positional)?;
        let source_size = size("source_size", call.needs("source_size", source_size)?)?;
        let mode = options::border_of_table(border_mode)?;
        let wraps = source_wraps.map_or(Ok(false), |object| flag("source_wraps", object))?;
        let py = map_x.py();
        let maps = MapPair::new(&map_arrays(map_x, map_y)?)?;
        let (_, columns) = maps.shape();
        let lut = match &maps {
            MapPair::Fixed { maps: [xs, ys], .. } => {
                detached::run(py, || Lut::from_maps_with(xs, ys, columns, source_size, mode, wraps))?
            }
            MapPair::F32(xs, ys) => {
                let (xs, ys) = (xs.as_slice()?, ys.as_slice()?);
                detached::run(py, || Lut::from_maps_with(xs, ys, columns, source_size, mode, wraps))?
            }
            MapPair::F64(xs, ys) => {
                let (xs, ys) = (xs.as_slice()?, ys.as_slice()?);
                detached::run(py, || Lut::from_maps_with(xs, ys, columns, source_size, mode, wraps))?
            }
        };
        Ok(lut.into())
    }

    #[doc = help!("Lut.from_homography")]
    #[classmethod]
    #[pyo3(
        signature = (M, *positional, size = None, source_size = None, grid = None, border_mode = None),
        text_signature = "(M, *, size=None, source_size, grid=None, border_mode='constant')"
    )]
    #[expect(non_snake_case, reason = "the field's name for a homography")]
    fn from_homography(
        _cls: &Bound<'_, PyType>,
        M: &Bound<'_, PyAny>,
        positional: &Bound<'_, PyTuple>,
        size: Option<&Bound<'_, PyAny>>,
        source_size: Option<&Bound<'_, PyAny>>,
        grid: Option<&Bound<'_, PyAny>>,
        border_mode: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        const EXAMPLE: &str = "Lut.from_homography(M, size=(800, 600), source_size=(1920, 1080))";
        let call = Call::new("Lut.from_homography", EXAMPLE, positional)?;
        let py = M.py();
        let matrix: Matrix3<f64> = matrix3("M", M)?;
        let mode = options::border_of_table(border_mode)?;
        if let Some(grid) = grid {
            let grid = bev_grid(grid)?.grid;
            if size.is_some() {
                return Err(ArgumentError::new_err(
                    "size: expected size= or grid=, got both; the grid has its own size",
                ));
            }
            let source_size = super::convert::size("source_size", call.needs("source_size", source_size)?)?;
            return Ok(detached::run(py, || Lut::from_ground_homography(&matrix, &grid, source_size, mode))?.into());
        }
        let size = super::convert::size("size", call.needs("size", size)?)?;
        let source_size = super::convert::size("source_size", call.needs("source_size", source_size)?)?;
        Ok(detached::run(py, || Lut::from_homography_with(&matrix, size, source_size, mode))?.into())
    }

    #[doc = help!("Lut.warp")]
    #[pyo3(
        signature = (image, *, interpolation = None, border_mode = None, border_value = None, out = None, threads = None, layout = None),
        text_signature = "(self, image, *, interpolation='bilinear', border_mode=None, border_value=0, out=None, threads=None, layout='HWC')"
    )]
    #[expect(clippy::too_many_arguments, reason = "keyword-only, each with one meaning")]
    fn warp<'py>(
        &self,
        image: &Bound<'py, PyAny>,
        interpolation: Option<&Bound<'py, PyAny>>,
        border_mode: Option<&Bound<'py, PyAny>>,
        border_value: Option<&Bound<'py, PyAny>>,
        out: Option<&Bound<'py, PyAny>>,
        threads: Option<&Bound<'py, PyAny>>,
        layout: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let taken = interpolation.map_or(Ok(Taken::By(Interpolation::Bilinear)), options::interpolation)?;
        let threads = threads.map(|threads| options::thread_count("threads", threads)).transpose()?;
        let layout = layout.map_or(Ok(Layout::Hwc), options::layout)?;
        let border_mode = border_mode.filter(|mode| !mode.is_none()).map(options::border_mode).transpose()?;
        let border_value = BorderValue::new(border_value)?;
        let out = Output::new(out)?;
        let image = ImageArray::new("image", shared::array("image", image, false)?, layout)?;
        self.check_size(&image)?;
        let interpolation = match taken {
            Taken::By(interpolation) => interpolation,
            Taken::Mode => Interpolation::default(), // not looked at
        };
        let job = Job { lut: &self.lut, image: &image, interpolation, border_mode, border_value, out, threads };
        match Samples::of(image.dtype(), taken)? {
            Samples::Blended(kind) => for_blended!(kind, job.blended()),
            Samples::Moved(bytes) => for_moved!(bytes, job.nearest()),
            Samples::Ids { bytes, signed: false } => for_moved!(bytes, job.mode()),
            Samples::Ids { bytes: 1, .. } => job.mode::<i8>(),
            Samples::Ids { bytes: 2, .. } => job.mode::<i16>(),
            Samples::Ids { bytes: 4, .. } => job.mode::<i32>(),
            Samples::Ids { .. } => job.mode::<i64>(),
        }
    }

    #[doc = help!("Lut.warp_adjoint")]
    #[pyo3(
        signature = (grad, *, interpolation = None, out = None, threads = None, layout = None),
        text_signature = "(self, grad, *, interpolation='bilinear', out=None, threads=None, layout='HWC')"
    )]
    fn warp_adjoint<'py>(
        &self,
        grad: &Bound<'py, PyAny>,
        interpolation: Option<&Bound<'py, PyAny>>,
        out: Option<&Bound<'py, PyAny>>,
        threads: Option<&Bound<'py, PyAny>>,
        layout: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (rows, columns) = self.shape();
        let call = Adjoint::new(("this Lut", rows, columns), grad, interpolation, out, threads, layout)?;
        call.run(self.lut.source_size(), &self.lut)
    }

    #[doc = help!("Lut.shape")]
    #[getter]
    fn shape(&self) -> (usize, usize) {
        (self.lut.rows(), self.lut.columns())
    }

    #[doc = help!("Lut.source_size")]
    #[getter]
    fn source_size(&self) -> (u32, u32) {
        self.lut.source_size()
    }

    #[doc = help!("Lut.camera")]
    #[getter]
    fn camera(&self) -> Option<PyCamera> {
        self.lut.camera().map(|camera| PyCamera { camera: *camera, mask: self.mask.clone() })
    }

    #[doc = help!("Lut.grid")]
    #[getter]
    fn grid(&self) -> Option<PyBevGrid> {
        self.lut.grid().map(|grid| PyBevGrid { grid: *grid })
    }

    #[doc = help!("Lut.ground")]
    #[getter]
    fn ground<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        self.lut.ground().map(|ground| road_object(py, ground)).transpose()
    }

    #[doc = help!("Lut.border_mode")]
    #[getter]
    fn border_mode(&self) -> &'static str {
        self.lut.border_mode().name()
    }

    #[doc = help!("Lut.source_wraps")]
    #[getter]
    fn source_wraps(&self) -> bool {
        self.lut.source_wraps()
    }

    #[doc = help!("Lut.nbytes")]
    #[getter]
    fn nbytes(&self) -> usize {
        self.lut.nbytes()
    }

    #[doc = help!("Lut.mask")]
    #[getter]
    fn mask<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<bool>>> {
        let mask = detached::run(py, || self.lut.mask())?;
        PyArray1::from_vec(py, mask).reshape(self.shape())
    }

    #[doc = help!("Lut.sampling_density")]
    fn sampling_density<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let density = detached::run(py, || self.lut.sampling_density())?;
        let (rows, columns) = self.shape();
        PyArray1::from_vec(py, density).reshape((rows, columns, 2))
    }

    #[doc = help!("Lut.resolved_mask")]
    #[pyo3(signature = (minimum = None), text_signature = "(self, minimum=0.5)")]
    fn resolved_mask<'py>(
        &self,
        py: Python<'py>,
        minimum: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray2<bool>>> {
        let minimum = minimum.map_or(Ok(0.5), |object| float("minimum", object))?;
        let mask = detached::run(py, || self.lut.resolved_mask(minimum))?;
        PyArray1::from_vec(py, mask).reshape(self.shape())
    }

    #[doc = help!("Lut.maps")]
    #[pyo3(signature = (outside = None))]
    #[expect(clippy::type_complexity, reason = "(map_x, map_y)")]
    fn maps<'py>(
        &self,
        py: Python<'py>,
        outside: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<(Bound<'py, PyArray2<f32>>, Bound<'py, PyArray2<f32>>)> {
        let outside = outside.map_or(Ok(f64::NAN), |object| float("outside", object))?;
        let (map_x, map_y) = detached::run(py, || self.lut.maps(outside as f32))?;
        Ok((PyArray1::from_vec(py, map_x).reshape(self.shape())?, PyArray1::from_vec(py, map_y).reshape(self.shape())?))
    }

    /// Undoes a pickle; every bound is proved again.
    #[classmethod]
    #[pyo3(name = "_from_bytes", signature = (data, camera = None, grid = None, ground = None))]
    fn from_bytes(
        _cls: &Bound<'_, PyType>,
        data: &Bound<'_, PyAny>,
        camera: Option<PyRef<'_, PyCamera>>,
        grid: Option<PyRef<'_, PyBevGrid>>,
        ground: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let bytes = bytes_of("Lut", data)?;
        let lut = detached::run(data.py(), || Lut::from_bytes(bytes))?;
        Self::of_scene(lut, camera, grid, ground)
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let bytes = detached::run(py, || self.lut.to_bytes())?;
        let scene = (self.camera(), self.grid(), self.ground(py)?);
        let arguments = (new_bytes(py, &bytes)?, scene.0, scene.1, scene.2).into_pyobject(py)?;
        Ok((py.get_type::<Self>().getattr("_from_bytes")?, arguments))
    }

    fn __repr__(&self) -> String {
        let (rows, columns) = self.shape();
        let (width, height) = self.source_size();
        let coverage = 100.0 * self.lut.valid_cells() as f64 / (rows * columns) as f64;
        let megabytes = self.nbytes() as f64 / 1e6;
        format!(
            "Lut({rows} rows x {columns} columns from {width}x{height} images, {coverage:.1} % valid, {megabytes:.2} MB)"
        )
    }
}

impl Transpose for Lut {
    fn run<T: PointSample>(
        &self,
        grads: &[ImageView<'_, T>],
        outs: &mut [ImageViewMut<'_, T>],
        options: &WarpOptions<T>,
    ) -> crate::Result<()> {
        self.warp_many_adjoint_into(grads, outs, options)
    }
}

impl PyLut {
    /// A table beside what it was built from.
    pub(super) fn of_scene(
        lut: Lut,
        camera: Option<PyRef<'_, PyCamera>>,
        grid: Option<PyRef<'_, PyBevGrid>>,
        ground: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let Some(grid) = grid else { return Ok(lut.into()) };
        let mask = camera.as_ref().and_then(|camera| camera.mask.clone());
        let view = camera.map(|camera| Ok::<_, PyErr>((camera.camera, road(ground)?))).transpose()?;
        Ok(Self { lut: lut.with_scene(Scene::new(grid.grid, view))?, mask })
    }

    /// Refuses an image of another size; the commonest reason is another layout.
    fn check_size(&self, image: &ImageArray<'_>) -> PyResult<()> {
        let (width, height) = self.lut.source_size();
        let expected = (width as usize, height as usize);
        if image.size() == expected {
            return Ok(());
        }
        let error: Error = ViewError::SizeMismatch { expected, got: image.size() }.into();
        let shape = image.shape();
        let other = Layout::ALL.into_iter().find(|layout| {
            layout.axes(shape.len()).is_some_and(|axes| (shape[axes.columns], shape[axes.rows]) == expected)
        });
        Err(match other {
            Some(other) => ImageError::new_err(format!(
                "image: expected {} for layout=\"{}\", got {}, which fits layout=\"{}\" ({})",
                image.layout().shape_text(),
                image.layout().name(),
                tuple_text(shape),
                other.name(),
                message(&error)
            )),
            None => error.into(),
        })
    }
}

/// [`Lut::warp_many_into`] or [`Lut::warp_many_nearest_into`].
type WarpFn<T> = fn(&Lut, &[ImageView<'_, T>], &mut [ImageViewMut<'_, T>], &WarpOptions<T>) -> crate::Result<()>;

/// One call of `warp`, its dtype not yet chosen.
struct Job<'a, 'py> {
    lut: &'a Lut,
    image: &'a ImageArray<'py>,
    interpolation: Interpolation,
    border_mode: Option<BorderMode>,
    border_value: BorderValue<'py>,
    out: Output<'py>,
    threads: Option<usize>,
}

impl<'py> Job<'_, 'py> {
    fn blended<T: Bilinear>(self) -> PyResult<Bound<'py, PyAny>> {
        self.run::<T>(Lut::warp_many_into)
    }

    fn mode<T: Sample + Ord>(self) -> PyResult<Bound<'py, PyAny>> {
        self.run::<T>(Lut::warp_many_mode_into)
    }

    fn nearest<T: Sample>(self) -> PyResult<Bound<'py, PyAny>> {
        self.run::<T>(Lut::warp_many_nearest_into)
    }

    fn run<T: Sample>(self, warp: WarpFn<T>) -> PyResult<Bound<'py, PyAny>> {
        let py = self.image.dtype().py();
        let border_value = self.border_value.samples::<T>(self.image.dtype())?;
        let (channels, values) = (self.image.channels(), border_value.len());
        if values != 1 && values != channels {
            return Err(ViewError::BorderChannels { expected: channels, got: values }.into());
        }
        options::check_kept(self.border_mode, &self.out)?;
        let Self { interpolation, border_mode, threads, .. } = self;
        let options = WarpOptions { interpolation, border_value, border_mode, threads, isa: None };
        let read = self.image.read()?;
        let views = read.views::<T>()?;
        self.lut.check_images(&views, &options)?; // before an output is allocated
        let (rows, columns) = (self.lut.rows(), self.lut.columns());
        let out = match self.out.array() {
            Some(array) => self.image.check_output(array, rows, columns)?,
            None => self.image.new_output(rows, columns)?,
        };
        let mut write = out.write()?;
        let mut outs = write.views::<T>()?;
        detached::run(py, || warp(self.lut, &views, &mut outs, &options))?;
        drop(outs);
        drop(write);
        Ok(self.out.given_or(out))
    }
}

/// The bytes as Python's.
///
/// # Errors
/// `OutOfMemoryError`: where there is no memory, `PyBytes::new` panics.
fn new_bytes<'py>(py: Python<'py>, bytes: &[u8]) -> PyResult<Bound<'py, PyBytes>> {
    let made = PyBytes::new_with(py, bytes.len(), |own| {
        own.copy_from_slice(bytes);
        Ok(())
    });
    made.map_err(|error| match error.is_instance_of::<PyMemoryError>(py) {
        true => Error::OutOfMemory { what: "Lut", bytes: bytes.len() }.into(),
        false => error,
    })
}

/// What a bytes object holds, which is not copied.
///
/// # Errors
/// `ArgumentTypeError`: it is no bytes object.
pub(super) fn bytes_of<'a>(name: &str, data: &'a Bound<'_, PyAny>) -> PyResult<&'a [u8]> {
    let Ok(bytes) = data.cast::<PyBytes>() else {
        let message = format!("{name}: expected the bytes of a table, got {}", type_name(data));
        return Err(ArgumentTypeError::new_err(message));
    };
    Ok(bytes.as_bytes())
}
