//! `Camera`.

use std::hash::{Hash, Hasher};

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple, PyType};

use super::arrays;
use super::cloud;
use super::convert::{Floats, Reduced, float, floats, matrix_to_numpy, matrix3, matrix4, rebuilt_by_new, size, whole};
use super::each::{each_projected, each_row};
use super::error::classes::CalibrationError;
use super::ground::{given_road, only_ground, road};
use super::lens::{hash_lens, lens as lens_model, lens_to_python};
use super::options::thread_count;
use super::points::PointsArray;
use crate::geometry::Pose;
use crate::{Camera, Pinhole};

#[doc = help!("Camera")]
#[pyclass(frozen, eq, hash, module = "ipm_rs", name = "Camera")]
#[derive(PartialEq)]
pub(super) struct PyCamera {
    pub(super) camera: Camera,
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
    #[pyo3(signature = (K, *, image_size, camera_from_vehicle = None, vehicle_from_camera = None, lens = None))]
    #[expect(non_snake_case, reason = "the field's name for the intrinsic matrix")]
    fn new(
        K: &Bound<'_, PyAny>,
        image_size: &Bound<'_, PyAny>,
        camera_from_vehicle: Option<&Bound<'_, PyAny>>,
        vehicle_from_camera: Option<&Bound<'_, PyAny>>,
        lens: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
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
        Ok(Self {
            camera: Camera::new(pinhole(K)?, size("image_size", image_size)?, pose)?.with_lens(lens_model(lens)?),
        })
    }

    #[doc = help!("Camera.from_euler")]
    #[classmethod]
    #[pyo3(
        signature = (K, *, image_size, position = None, roll = None, pitch = None, yaw = None, lens = None),
        text_signature = "(K, *, image_size, position=(0.0, 0.0, 0.0), roll=0.0, pitch=0.0, yaw=0.0, lens=None)"
    )]
    #[expect(non_snake_case, reason = "the field's name for the intrinsic matrix")]
    #[expect(clippy::too_many_arguments, reason = "keyword-only, each with one meaning")]
    fn from_euler(
        _cls: &Bound<'_, PyType>,
        K: &Bound<'_, PyAny>,
        image_size: &Bound<'_, PyAny>,
        position: Option<&Bound<'_, PyAny>>,
        roll: Option<&Bound<'_, PyAny>>,
        pitch: Option<&Bound<'_, PyAny>>,
        yaw: Option<&Bound<'_, PyAny>>,
        lens: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let angle = |name, object: Option<&Bound<'_, PyAny>>| object.map_or(Ok(0.0), |object| float(name, object));
        let position = position.map_or(Ok([0.0; 3]), |object| floats("position", "(x, y, z) in metres", object))?;
        let (roll, pitch, yaw) = (angle("roll", roll)?, angle("pitch", pitch)?, angle("yaw", yaw)?);
        let size = size("image_size", image_size)?;
        let camera = Camera::from_euler(pinhole(K)?, size, position, roll, pitch, yaw)?;
        Ok(Self { camera: camera.with_lens(lens_model(lens)?) })
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
    #[pyo3(signature = (points, *, ground = None, threads = None))]
    fn project<'py>(
        &self,
        points: &Bound<'py, PyAny>,
        ground: Option<&Bound<'py, PyAny>>,
        threads: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<cloud::Projected<'py>> {
        let py = points.py();
        let threads = threads.map(|threads| thread_count("threads", threads)).transpose()?;
        let road = given_road(ground)?;
        let expected = "an (N, 3), or (N, 2) on the ground,";
        let points = arrays::numbers("points", &format!("{expected} array"), points)?;
        let points = PointsArray::new("points", points, 2..=3, expected)?;
        let on_ground = points.columns() == 2;
        let ground = only_ground(road, on_ground)?;
        if !on_ground {
            return cloud::project(py, &self.camera, &points, threads);
        }
        let floats = Floats::of("points", points.array())?;
        let rows = floats.rows::<2>("points")?;
        each_projected(py, threads, rows, |&row| self.camera.project_ground(row, &ground))
    }

    #[doc = help!("Camera.unproject")]
    fn unproject<'py>(&self, uv: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let floats = Floats::new("uv", "an (N, 2) array", uv)?;
        let rows = floats.rows::<2>("uv")?;
        each_row(uv.py(), None, rows, |&pixel| self.camera.unproject(pixel).map_or([f64::NAN; 3], Into::into))
    }

    #[doc = help!("Camera.ground_from_pixels")]
    #[pyo3(
        signature = (uv, *, ground = None, threads = None),
        text_signature = "(self, uv, *, ground=0.0, threads=None)"
    )]
    fn ground_from_pixels<'py>(
        &self,
        uv: &Bound<'py, PyAny>,
        ground: Option<&Bound<'py, PyAny>>,
        threads: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let threads = threads.map(|threads| thread_count("threads", threads)).transpose()?;
        let ground = road(ground)?;
        let floats = Floats::new("uv", "an (N, 2) array", uv)?;
        let rows = floats.rows::<2>("uv")?;
        each_row(uv.py(), threads, rows, |&pixel| {
            self.camera.ground_from_pixel(pixel, &ground).map_or([f64::NAN; 3], Into::into)
        })
    }

    #[doc = help!("Camera.resized")]
    fn resized(&self, width: &Bound<'_, PyAny>, height: &Bound<'_, PyAny>) -> PyResult<Self> {
        Ok(Self { camera: self.camera.resized(whole("width", width)?, whole("height", height)?)? })
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
        Ok(Self { camera: self.camera.cropped(x, y, whole("width", width)?, whole("height", height)?)? })
    }

    #[doc = help!("Camera.with_pose")]
    #[pyo3(signature = (camera_from_vehicle))]
    fn with_pose(&self, camera_from_vehicle: &Bound<'_, PyAny>) -> PyResult<Self> {
        Ok(Self { camera: self.camera.with_pose(pose("camera_from_vehicle", camera_from_vehicle)?) })
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        let keywords = PyDict::new(py);
        keywords.set_item("image_size", self.image_size())?;
        keywords.set_item("camera_from_vehicle", self.camera_from_vehicle(py)?)?;
        if let Some(lens) = self.lens(py)? {
            keywords.set_item("lens", lens)?;
        }
        rebuilt_by_new(py.get_type::<Self>(), PyTuple::new(py, [self.intrinsics(py)?])?, keywords)
    }

    fn __repr__(&self) -> String {
        self.camera.to_string()
    }
}

fn pinhole(k: &Bound<'_, PyAny>) -> PyResult<Pinhole> {
    Ok(Pinhole::from_matrix(&matrix3("K", k)?)?)
}

fn pose(name: &'static str, object: &Bound<'_, PyAny>) -> PyResult<Pose> {
    Ok(Pose::from_matrix(name, &matrix4(name, object)?)?)
}
