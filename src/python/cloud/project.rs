//! Points to pixels, many at once.

use pyo3::prelude::*;

use crate::Camera;
use crate::cloud::{Projections, project_into};
use crate::python::convert::{MOST_ITEMS, items, type_name};
use crate::python::detached;
use crate::python::error::classes::ArgumentTypeError;
use crate::python::outputs::{Given, Input, Numbers};
use crate::python::points::PointsArray;
use crate::view::PointSample;

/// uv, depth and valid.
pub(in crate::python) type Projected<'py> = (Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>);

/// The `out=` of a projection: (uv, depth, valid), not yet checked.
pub(in crate::python) struct ProjectedOut<'py>([Given<'py>; 3]);

impl<'py> ProjectedOut<'py> {
    /// Takes an argument that may be missing or `None`; its Python code runs here.
    pub(in crate::python) fn optional(object: Option<&Bound<'py, PyAny>>) -> PyResult<Option<Self>> {
        let Some(object) = object.filter(|object| !object.is_none()) else { return Ok(None) };
        let refuse = |got: String| {
            ArgumentTypeError::new_err(format!("out: expected a tuple of three arrays, (uv, depth, valid), got {got}"))
        };
        let arrays = items(object, refuse)?;
        let [uv, depth, valid] = &arrays[..] else {
            let got = if arrays.len() == MOST_ITEMS { "more".to_owned() } else { arrays.len().to_string() };
            return Err(refuse(format!("{} of {got}", type_name(object))));
        };
        let (uv, depth) = (Given::new("out[0]", uv)?, Given::new("out[1]", depth)?);
        Ok(Some(Self([uv, depth, Given::new("out[2]", valid)?])))
    }
}

/// The arrays that a projection writes.
pub(in crate::python) struct ProjectedArrays<'py> {
    uv: Numbers<'py, f64>,
    depth: Numbers<'py, f64>,
    valid: Numbers<'py, bool>,
}

impl<'py> ProjectedArrays<'py> {
    /// Those that were given, checked, or new ones.
    pub(in crate::python) fn new(
        py: Python<'py>,
        count: usize,
        out: Option<ProjectedOut<'py>>,
        inputs: &[Input<'_, 'py>],
    ) -> PyResult<Self> {
        let [uv, depth, valid] = match out {
            Some(ProjectedOut([uv, depth, valid])) => {
                depth.check_apart(&uv)?;
                valid.check_apart(&uv)?;
                valid.check_apart(&depth)?;
                [Some(uv), Some(depth), Some(valid)]
            }
            None => [None, None, None],
        };
        // NumPy allocates them, because it asks for huge pages, without which a million points take half as long again
        Ok(Self {
            uv: Numbers::new(py, uv, &[count, 2], inputs)?,
            depth: Numbers::new(py, depth, &[count], inputs)?,
            valid: Numbers::new(py, valid, &[count], inputs)?,
        })
    }

    /// Borrows them while `work` writes to them, without the GIL.
    pub(in crate::python) fn write(
        self,
        py: Python<'py>,
        work: impl FnOnce(Projections<'_>) -> crate::Result<()> + Send,
    ) -> PyResult<Projected<'py>> {
        let (mut uv, mut depth) = (self.uv.write("out[0]")?, self.depth.write("out[1]")?);
        let mut valid = self.valid.write("out[2]")?;
        self.valid.clear(&mut valid);
        let out = Projections {
            uv: uv.as_slice_mut()?.as_chunks_mut().0,
            depth: depth.as_slice_mut()?,
            valid: valid.as_slice_mut()?,
        };
        detached::run(py, || work(out))?;
        drop((uv, depth, valid));
        Ok((self.uv.into_object(), self.depth.into_object(), self.valid.into_object()))
    }
}

/// Projects an (N, 3) array.
pub(in crate::python) fn project<'py>(
    py: Python<'py>,
    camera: &Camera,
    points: &PointsArray<'py>,
    out: ProjectedArrays<'py>,
    threads: Option<usize>,
) -> PyResult<Projected<'py>> {
    if points.is_f32() {
        project_as::<f32>(py, camera, points, out, threads)
    } else {
        project_as::<f64>(py, camera, points, out, threads)
    }
}

fn project_as<'py, T: PointSample>(
    py: Python<'py>,
    camera: &Camera,
    points: &PointsArray<'py>,
    out: ProjectedArrays<'py>,
    threads: Option<usize>,
) -> PyResult<Projected<'py>> {
    let read = points.read()?;
    let view = read.view::<T>()?;
    out.write(py, |out| project_into(camera, &view, out, threads))
}
