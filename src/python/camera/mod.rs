//! `Camera`.

mod geometry;
mod json;
mod mask;

use std::hash::{Hash, Hasher};
use std::sync::Arc;

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyTuple, PyType};

use crate::geometry::Pose;
use crate::python::arrays;
use crate::python::cloud;
use crate::python::convert::{Call, Floats, flag, float, floats, matrix_to_numpy, matrix3, matrix4, size, whole};
use crate::python::each::{each_projected, each_row_into};
use crate::python::error::classes::CalibrationError;
use crate::python::error::of_argument;
use crate::python::ground::{given_road, only_ground, road};
use crate::python::lens::{hash_lens, lens as lens_model, lens_to_python};
use crate::python::mask::mask_of;
use crate::python::options::thread_count;
use crate::python::outputs::Given;
use crate::python::points::PointsArray;
use crate::python::warnings::checked;
use crate::{Camera, ImageMask, Pinhole};

#[doc = help!("Camera")]
#[pyclass(frozen, eq, hash, module = "ipm_rs", name = "Camera")]
#[derive(PartialEq)]
pub(in crate::python) struct PyCamera {
    pub(in crate::python) camera: Camera,
    /// Which pixels show the road, if not all do.
    pub(in crate::python) mask: Option<Arc<ImageMask>>,
}

impl From<Camera> for PyCamera {
    fn from(camera: Camera) -> Self {
        Self { camera, mask: None }
    }
}

impl PyCamera {
    /// Another camera, whose images have the mask that is made of this one's.
    pub(in crate::python) fn with_image(
        &self,
        camera: Camera,
        mask: impl FnOnce(&ImageMask) -> crate::Result<ImageMask>,
    ) -> PyResult<Self> {
        Ok(Self { camera, mask: self.mask.as_deref().map(mask).transpose()?.map(Arc::new) })
    }
}

impl Hash for PyCamera {
    fn hash<H: Hasher>(&self, state: &mut H) {
        let pose = self.camera.camera_from_vehicle();
        let intrinsics = self.camera.intrinsics();
        for value in intrinsics.iter().chain(pose.rotation().iter()).chain(pose.translation().iter()) {
            (value + 0.0).to_bits().hash(state); // 0.0 and -0.0 are equal
        }
        self.camera.image_size().hash(state);
        if let Some(lens) = self.camera.lens() {
            hash_lens(lens, state);
        }
    }
}

#[pymethods]
impl PyCamera {
    #[new]
    #[pyo3(
        signature = (K, *positional, image_size = None, camera_from_vehicle = None, vehicle_from_camera = None, lens = None, nearest_rotation = None),
        text_signature = "(K, *, image_size, camera_from_vehicle=None, vehicle_from_camera=None, lens=None, nearest_rotation=False)"
    )]
    #[expect(non_snake_case, reason = "the field's name for the intrinsic matrix")]
    fn new(
        K: &Bound<'_, PyAny>,
        positional: &Bound<'_, PyTuple>,
        image_size: Option<&Bound<'_, PyAny>>,
        camera_from_vehicle: Option<&Bound<'_, PyAny>>,
        vehicle_from_camera: Option<&Bound<'_, PyAny>>,
        lens: Option<&Bound<'_, PyAny>>,
        nearest_rotation: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let call = Call::new("Camera", "Camera(K, image_size=(1920, 1080), camera_from_vehicle=T)", positional)?;
        let image_size = call.needs("image_size", image_size)?;
        let pose = |name, matrix| pose(name, matrix, nearest_rotation);
        let pose = match (camera_from_vehicle, vehicle_from_camera) {
            (None, None) => Camera::forward_pose(),
            (Some(matrix), None) => pose("camera_from_vehicle", matrix)?,
            (None, Some(matrix)) => pose("vehicle_from_camera", matrix)?.inverse(),
            (Some(_), Some(_)) => {
                return Err(CalibrationError::new_err(
                    "expected camera_from_vehicle or vehicle_from_camera, got both; give the one that you have",
                ));
            }
        };
        let camera = Camera::new(pinhole(K)?, size("image_size", image_size)?, pose)?.with_lens(lens_model(lens)?);
        Ok(checked(K.py(), camera)?.into())
    }

    #[doc = help!("Camera.from_euler")]
    #[classmethod]
    #[pyo3(
        signature = (K, *positional, image_size = None, position = None, roll = None, pitch = None, yaw = None, lens = None),
        text_signature = "(K, *, image_size, position=(0.0, 0.0, 0.0), roll=0.0, pitch=0.0, yaw=0.0, lens=None)"
    )]
    #[expect(non_snake_case, reason = "the field's name for the intrinsic matrix")]
    #[expect(clippy::too_many_arguments, reason = "keyword-only, each with one meaning")]
    fn from_euler(
        _cls: &Bound<'_, PyType>,
        K: &Bound<'_, PyAny>,
        positional: &Bound<'_, PyTuple>,
        image_size: Option<&Bound<'_, PyAny>>,
        position: Option<&Bound<'_, PyAny>>,
        roll: Option<&Bound<'_, PyAny>>,
        pitch: Option<&Bound<'_, PyAny>>,
        yaw: Option<&Bound<'_, PyAny>>,
        lens: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        const EXAMPLE: &str = "Camera.from_euler(K, image_size=(1920, 1080), position=(1.7, 0, 1.4), pitch=0.05)";
        let call = Call::new("Camera.from_euler", EXAMPLE, positional)?;
        let image_size = call.needs("image_size", image_size)?;
        let angle = |name, object: Option<&Bound<'_, PyAny>>| object.map_or(Ok(0.0), |object| float(name, object));
        let position = position.map_or(Ok([0.0; 3]), |object| floats("position", "(x, y, z) in metres", object))?;
        let (roll, pitch, yaw) = (angle("roll", roll)?, angle("pitch", pitch)?, angle("yaw", yaw)?);
        let size = size("image_size", image_size)?;
        let camera = Camera::from_euler(pinhole(K)?, size, position, roll, pitch, yaw)?.with_lens(lens_model(lens)?);
        Ok(checked(K.py(), camera)?.into())
    }

    #[doc = help!("Camera.intrinsics")]
    #[getter]
    fn intrinsics<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        matrix_to_numpy(py, &self.camera.intrinsics())
    }

    #[doc = help!("Camera.lens")]
    #[getter]
    fn lens<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        self.camera.lens().map(|lens| lens_to_python(py, lens)).transpose()
    }

    #[doc = help!("Camera.image_size")]
    #[getter]
    fn image_size(&self) -> (u32, u32) {
        self.camera.image_size()
    }

    #[doc = help!("Camera.is_panorama")]
    #[getter]
    fn is_panorama(&self) -> bool {
        self.camera.is_panorama()
    }

    #[doc = help!("Camera.camera_from_vehicle")]
    #[getter]
    fn camera_from_vehicle<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        matrix_to_numpy(py, &self.camera.camera_from_vehicle().matrix())
    }

    #[doc = help!("Camera.vehicle_from_camera")]
    #[getter]
    fn vehicle_from_camera<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        matrix_to_numpy(py, &self.camera.vehicle_from_camera().matrix())
    }

    #[doc = help!("Camera.position")]
    #[getter]
    fn position<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.camera.position().as_slice())
    }

    #[doc = help!("Camera.project")]
    #[pyo3(signature = (points, *, ground = None, out = None, threads = None))]
    fn project<'py>(
        &self,
        points: &Bound<'py, PyAny>,
        ground: Option<&Bound<'py, PyAny>>,
        out: Option<&Bound<'py, PyAny>>,
        threads: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<cloud::Projected<'py>> {
        let py = points.py();
        let threads = threads.map(|threads| thread_count("threads", threads)).transpose()?;
        let road = given_road(ground)?;
        let out = cloud::ProjectedOut::optional(out)?;
        let expected = "an (N, 3), or (N, 2) on the ground,";
        let points = arrays::numbers("points", &format!("{expected} array"), points)?;
        let points = PointsArray::new("points", points, 2..=3, expected)?;
        let on_ground = points.columns() == 2;
        let ground = only_ground(road, on_ground)?;
        let out = cloud::ProjectedArrays::new(py, points.len(), out, &[("points", points.array())])?;
        if !on_ground {
            return cloud::project(py, &self.camera, &points, out, threads);
        }
        let floats = Floats::of("points", points.array())?;
        let rows = floats.rows::<2>("points")?;
        each_projected(py, threads, rows, out, |&row| self.camera.project_ground(row, &ground))
    }

    #[doc = help!("Camera.unproject")]
    #[pyo3(signature = (uv, *, out = None, threads = None))]
    fn unproject<'py>(
        &self,
        uv: &Bound<'py, PyAny>,
        out: Option<&Bound<'py, PyAny>>,
        threads: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let threads = threads.map(|threads| thread_count("threads", threads)).transpose()?;
        let out = Given::optional("out", out)?;
        let floats = Floats::new("uv", "an (N, 2) array", uv)?;
        let rows = floats.rows::<2>("uv")?;
        each_row_into(uv.py(), threads, rows, ("uv", floats.array()), out, |&pixel| {
            self.camera.unproject(pixel).map_or([f64::NAN; 3], Into::into)
        })
    }

    #[doc = help!("Camera.ground_from_pixels")]
    #[pyo3(
        signature = (uv, *, ground = None, out = None, threads = None),
        text_signature = "(self, uv, *, ground=0.0, out=None, threads=None)"
    )]
    fn ground_from_pixels<'py>(
        &self,
        uv: &Bound<'py, PyAny>,
        ground: Option<&Bound<'py, PyAny>>,
        out: Option<&Bound<'py, PyAny>>,
        threads: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let threads = threads.map(|threads| thread_count("threads", threads)).transpose()?;
        let ground = road(ground)?;
        let out = Given::optional("out", out)?;
        let floats = Floats::new("uv", "an (N, 2) array", uv)?;
        let rows = floats.rows::<2>("uv")?;
        each_row_into(uv.py(), threads, rows, ("uv", floats.array()), out, |&pixel| {
            self.camera.ground_from_pixel(pixel, &ground).map_or([f64::NAN; 3], Into::into)
        })
    }

    #[doc = help!("Camera.resized")]
    fn resized(&self, width: &Bound<'_, PyAny>, height: &Bound<'_, PyAny>) -> PyResult<Self> {
        let (width, height) = (whole("width", width)?, whole("height", height)?);
        self.with_image(self.camera.resized(width, height)?, |mask| mask.resized(width, height))
    }

    #[doc = help!("Camera.cropped")]
    fn cropped(
        &self,
        x: &Bound<'_, PyAny>,
        y: &Bound<'_, PyAny>,
        width: &Bound<'_, PyAny>,
        height: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let (x, y) = (whole("x", x)?, whole("y", y)?);
        let (width, height) = (whole("width", width)?, whole("height", height)?);
        self.with_image(self.camera.cropped(x, y, width, height)?, |mask| mask.cropped(x, y, width, height))
    }

    #[doc = help!("Camera.with_pose")]
    #[pyo3(
        signature = (camera_from_vehicle, *, nearest_rotation = None),
        text_signature = "(self, camera_from_vehicle, *, nearest_rotation=False)"
    )]
    fn with_pose(
        &self,
        camera_from_vehicle: &Bound<'_, PyAny>,
        nearest_rotation: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let pose = pose("camera_from_vehicle", camera_from_vehicle, nearest_rotation)?;
        Ok(Self { camera: self.camera.with_pose(pose), mask: self.mask.clone() })
    }

    /// A camera out of a pickle: nothing is said of it again, for what is odd about it was said when it was made, or
    /// comes of a crop.
    #[classmethod]
    #[pyo3(signature = (k, image_size, camera_from_vehicle, lens, mask = None))]
    fn _unpickled(
        _cls: &Bound<'_, PyType>,
        k: &Bound<'_, PyAny>,
        image_size: &Bound<'_, PyAny>,
        camera_from_vehicle: &Bound<'_, PyAny>,
        lens: Option<&Bound<'_, PyAny>>,
        mask: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let pose = pose("camera_from_vehicle", camera_from_vehicle, None)?;
        let camera = Camera::new(pinhole(k)?, size("image_size", image_size)?, pose)?;
        let camera = camera.with_lens(lens_model(lens)?);
        let mask = mask.map(|mask| mask_of("mask", mask, &camera)).transpose()?;
        Ok(Self { camera, mask: mask.map(Arc::new) })
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Parts<'py>)> {
        let rebuild = py.get_type::<Self>().getattr("_unpickled")?;
        let mask = self.mask(py)?;
        Ok((rebuild, (self.intrinsics(py)?, self.image_size(), self.camera_from_vehicle(py)?, self.lens(py)?, mask)))
    }

    fn __repr__(&self) -> String {
        let Some(mask) = &self.mask else { return self.camera.to_string() };
        let hidden = mask.shown().iter().filter(|&&shown| !shown).count() as f64 / mask.shown().len() as f64;
        format!("{}, {:.1} % of it hidden by its mask)", self.camera.to_string().trim_end_matches(')'), 100.0 * hidden)
    }
}

/// K, image size, pose, lens and mask, of which a pickle is made.
type Parts<'py> = (
    Bound<'py, PyArray2<f64>>,
    (u32, u32),
    Bound<'py, PyArray2<f64>>,
    Option<Bound<'py, PyAny>>,
    Option<Bound<'py, PyArray2<bool>>>,
);

fn pinhole(k: &Bound<'_, PyAny>) -> PyResult<Pinhole> {
    Ok(Pinhole::from_matrix(&matrix3("K", k)?)?)
}

/// A pose as given, or with the nearest rotation if asked for.
fn pose(name: &'static str, object: &Bound<'_, PyAny>, nearest: Option<&Bound<'_, PyAny>>) -> PyResult<Pose> {
    let nearest = nearest.map_or(Ok(false), |object| flag("nearest_rotation", object))?;
    let matrix = matrix4(name, object)?;
    let pose = if nearest { Pose::nearest(&matrix) } else { Pose::from_matrix(&matrix) };
    pose.map_err(|error| of_argument(name, error))
}
