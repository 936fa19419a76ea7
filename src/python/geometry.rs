//! Euler angles and handedness.

use nalgebra::Vector3;
use numpy::PyArray2;
use pyo3::prelude::*;

use super::convert::{Floats, float, matrix_to_numpy, matrix3, matrix4};
use super::each::each_row;
use super::error::of_argument;
use crate::error::{finite, radians};
use crate::geometry::{self, Pose};

#[doc = help!("rotation_from_euler")]
#[pyfunction]
pub(super) fn rotation_from_euler<'py>(
    roll: &Bound<'py, PyAny>,
    pitch: &Bound<'py, PyAny>,
    yaw: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let [r, p, y] = angles(roll, pitch, yaw)?;
    for (what, angle) in [("roll", r), ("pitch", p), ("yaw", y)] {
        radians(what, angle)?;
    }
    matrix_to_numpy(roll.py(), &geometry::rotation_from_euler(r, p, y))
}

#[doc = help!("flip_handedness")]
#[pyfunction]
pub(super) fn flip_handedness<'py>(points: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let floats = Floats::new("points", "an (N, 3) array", points)?;
    let rows = floats.rows::<3>("points")?;
    each_row(points.py(), None, rows, |&row| geometry::flip_handedness_point(Vector3::from(row)).into())
}

#[doc = help!("flip_handedness_euler")]
#[pyfunction]
pub(super) fn flip_handedness_euler(
    roll: &Bound<'_, PyAny>,
    pitch: &Bound<'_, PyAny>,
    yaw: &Bound<'_, PyAny>,
) -> PyResult<(f64, f64, f64)> {
    let [r, p, y] = angles(roll, pitch, yaw)?;
    Ok(geometry::flip_handedness_euler(r, p, y))
}

#[doc = help!("flip_handedness_rotation")]
#[pyfunction]
#[pyo3(name = "flip_handedness_rotation", signature = (R))]
#[expect(non_snake_case, reason = "the field's name for a rotation")]
pub(super) fn flip_handedness_rotation<'py>(R: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let rotation = matrix3("R", R)?;
    geometry::check_rotation(&rotation).map_err(|error| of_argument("R", error))?;
    matrix_to_numpy(R.py(), &geometry::flip_handedness_rotation(&rotation))
}

#[doc = help!("flip_handedness_pose")]
#[pyfunction]
#[pyo3(name = "flip_handedness_pose", signature = (T))]
#[expect(non_snake_case, reason = "the field's name for a transform")]
pub(super) fn flip_handedness_pose<'py>(T: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let pose = Pose::from_matrix(&matrix4("T", T)?).map_err(|error| of_argument("T", error))?;
    matrix_to_numpy(T.py(), &geometry::flip_handedness_pose(&pose).matrix())
}

fn angles(roll: &Bound<'_, PyAny>, pitch: &Bound<'_, PyAny>, yaw: &Bound<'_, PyAny>) -> PyResult<[f64; 3]> {
    let angle = |name, object| -> PyResult<f64> { Ok(finite(name, float(name, object)?)?) };
    Ok([angle("roll", roll)?, angle("pitch", pitch)?, angle("yaw", yaw)?])
}
