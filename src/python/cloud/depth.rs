//! `points_from_depth`.

use numpy::{PyArray1, PyArrayDescrMethods, PyArrayMethods, dtype};
use pyo3::prelude::*;
use pyo3::types::{PyList, PyTuple};

use super::gather;
use super::options::{self, View, depth_image, mask_image, wrong_dtype};
use crate::ImageView;
use crate::cloud::{
    DepthOptions, DepthSample, PointSample, check_points, cloud_from_depth, points_from_depth_into, points_size,
};
use crate::geometry::Pose;
use crate::python::convert::{flag, float, tuple_text, whole};
use crate::python::error::classes::{ArgumentError, ImageError};
use crate::python::image::ImageArray;
use crate::python::layout::Layout;
use crate::python::options::thread_count;

#[doc = help!("points_from_depth")]
#[pyfunction]
#[pyo3(
    signature = (
        depth, K, max_depth = None, frame = None, *, min_depth = None, kind = None, depth_scale = None,
        stride = None, mask = None, compact = None, values = None, dtype = None, out = None, threads = None
    ),
    text_signature = "(depth, K, max_depth=None, frame='camera', *, min_depth=None, kind='z', depth_scale=None, stride=1, mask=None, compact=False, values=None, dtype='float32', out=None, threads=None)"
)]
#[expect(clippy::too_many_arguments, reason = "mostly keyword-only, each with one meaning")]
#[expect(non_snake_case, reason = "K is its name in Python")]
pub(in crate::python) fn points_from_depth<'py>(
    depth: &Bound<'py, PyAny>,
    K: &Bound<'py, PyAny>,
    max_depth: Option<&Bound<'py, PyAny>>,
    frame: Option<&Bound<'py, PyAny>>,
    min_depth: Option<&Bound<'py, PyAny>>,
    kind: Option<&Bound<'py, PyAny>>,
    depth_scale: Option<&Bound<'py, PyAny>>,
    stride: Option<&Bound<'py, PyAny>>,
    mask: Option<&Bound<'py, PyAny>>,
    compact: Option<&Bound<'py, PyAny>>,
    values: Option<&Bound<'py, PyAny>>,
    dtype: Option<&Bound<'py, PyAny>>,
    out: Option<&Bound<'py, PyAny>>,
    threads: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let depth = depth_image("depth", depth)?;
    let view = View::new(K, depth.size())?;
    let frame_from_camera = options::frame(frame, &view)?;
    let (min_depth, max_depth) = options::depth_limits(min_depth, max_depth)?;
    let options = DepthOptions {
        kind: options::depth_kind(kind)?,
        scale: scale(&depth, depth_scale)?,
        min_depth,
        max_depth,
        stride: stride.map_or(Ok(1), |object| whole("stride", object))? as usize,
        threads: threads.map(|threads| thread_count("threads", threads)).transpose()?,
    };
    let mask = mask.filter(|mask| !mask.is_none()).map(mask_image).transpose()?;
    let compact = compact.map_or(Ok(false), |object| flag("compact", object))?;
    let given = |object: Option<&Bound<'py, PyAny>>| object.filter(|object| !object.is_none()).cloned();
    let call = Call { depth, view, frame_from_camera, options, mask, values: given(values), out: given(out) };
    if !compact && call.values.is_some() {
        return Err(ArgumentError::new_err(
            "values: expected only with compact=True; organised points line up with image[::stride, ::stride] already",
        ));
    }
    if compact && call.out.is_some() {
        return Err(ArgumentError::new_err(
            "out: expected only without compact=True: how many points there are is known when they have been found",
        ));
    }
    match (call.depth.dtype().kind(), call.depth.dtype().itemsize(), double(dtype)?) {
        (b'u', 2, false) => call.run::<u16, f32>(compact),
        (b'u', 2, true) => call.run::<u16, f64>(compact),
        (b'f', 4, false) => call.run::<f32, f32>(compact),
        (b'f', 4, true) => call.run::<f32, f64>(compact),
        (b'f', 8, false) => call.run::<f64, f32>(compact),
        (b'f', 8, true) => call.run::<f64, f64>(compact),
        _ => {
            let mend = match call.depth.dtype().itemsize() {
                1 => "8 bits are a picture of depth, not depth: use the file that it was made from",
                _ => "use depth.astype(numpy.float32)",
            };
            Err(wrong_dtype("depth", "uint16, float32 or float64", call.depth.dtype(), mend))
        }
    }
}

/// Metres per unit: 1 for floats; of integers nobody knows.
fn scale(depth: &ImageArray<'_>, object: Option<&Bound<'_, PyAny>>) -> PyResult<f64> {
    match object.filter(|object| !object.is_none()) {
        Some(object) => float("depth_scale", object),
        None if depth.dtype().kind() == b'u' && depth.dtype().itemsize() == 2 => Err(ArgumentError::new_err(
            "depth_scale: expected metres per unit with a uint16 depth image, got none; 0.001 for millimetres (RealSense, ScanNet), 1 / 5000 for TUM, 1 / 256 for KITTI",
        )),
        None => Ok(1.0),
    }
}

/// Whether the points are float64.
fn double(object: Option<&Bound<'_, PyAny>>) -> PyResult<bool> {
    let Some(object) = object else { return Ok(false) };
    let refuse = || {
        let got = object.repr().map_or_else(|_| "an object".to_owned(), |text| text.to_string());
        ArgumentError::new_err(format!("dtype: expected \"float32\" or \"float64\", got {got}"))
    };
    let dtype = object.py().import("numpy")?.call_method1("dtype", (object,)).map_err(|_| refuse())?;
    let dtype = dtype.cast_into::<numpy::PyArrayDescr>().map_err(|_| refuse())?;
    match (dtype.kind(), dtype.itemsize(), dtype.is_native_byteorder()) {
        (b'f', 4, Some(true)) => Ok(false),
        (b'f', 8, Some(true)) => Ok(true),
        _ => Err(refuse()),
    }
}

/// The arguments, checked.
struct Call<'py> {
    depth: ImageArray<'py>,
    view: View<'py>,
    frame_from_camera: Pose,
    options: DepthOptions,
    mask: Option<ImageArray<'py>>,
    values: Option<Bound<'py, PyAny>>,
    out: Option<Bound<'py, PyAny>>,
}

impl<'py> Call<'py> {
    fn run<T: DepthSample, O: PointSample + numpy::Element>(&self, compact: bool) -> PyResult<Bound<'py, PyAny>> {
        let read = self.depth.read()?;
        let depth = read.views::<T>()?[0];
        let mask_read = self.mask.as_ref().map(ImageArray::read).transpose()?;
        let mask = mask_read.as_ref().map(|read| read.views::<u8>()).transpose()?.map(|views| views[0]);
        if compact {
            self.compact::<T, O>(&depth, mask.as_ref())
        } else {
            self.organised::<T, O>(&depth, mask.as_ref())
        }
    }

    fn organised<T: DepthSample, O: PointSample + numpy::Element>(
        &self,
        depth: &ImageView<'_, T>,
        mask: Option<&ImageView<'_, u8>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let py = self.depth.dtype().py();
        let (width, height) = points_size(self.depth.size(), self.options.stride);
        let (shape, kind) = ([height, width, 3], dtype::<O>(py));
        check_points("depth", (width, height), "use stride or camera.cropped()")?; // before it is allocated
        let out = match &self.out {
            Some(out) => {
                let dtype = (&kind, "that of dtype=", "dtype");
                let inputs = [("depth", Some(&self.depth)), ("mask", self.mask.as_ref())];
                let inputs: Vec<_> = inputs.into_iter().filter_map(|(name, array)| Some((name, array?))).collect();
                ImageArray::output(out, &shape, dtype, Layout::Hwc, &inputs)?
            }
            None => ImageArray::allocate(&shape, kind, Layout::Hwc)?,
        };
        let mut write = out.write()?;
        let mut outs = write.views::<O>();
        let (view, frame, options) = (self.view.viewpoint(), &self.frame_from_camera, &self.options);
        py.detach(|| points_from_depth_into(depth, view, frame, mask, options, &mut outs[0]))?;
        drop(outs);
        drop(write);
        Ok(self.out.clone().unwrap_or_else(|| out.into_array().into_any()))
    }

    fn compact<T: DepthSample, O: PointSample + numpy::Element>(
        &self,
        depth: &ImageView<'_, T>,
        mask: Option<&ImageView<'_, u8>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let py = self.depth.dtype().py();
        let attributes = Attributes::new(self.values.as_ref(), self.depth.size())?;
        let (view, frame, options) = (self.view.viewpoint(), &self.frame_from_camera, &self.options);
        let cloud = py.detach(|| cloud_from_depth::<T, O>(depth, view, frame, mask, options))?;
        let values = attributes.map(|attributes| attributes.gather(py, &cloud.index)).transpose()?;
        let count = cloud.points.len();
        let points = PyArray1::from_vec(py, cloud.points.into_flattened()).reshape([count, 3])?.into_any();
        let index = PyArray1::from_vec(py, cloud.index).into_any();
        let arrays: Vec<_> = [Some(points), Some(index), values].into_iter().flatten().collect();
        Ok(PyTuple::new(py, arrays)?.into_any())
    }
}

/// What is gathered beside the points: one image, or several.
struct Attributes<'py> {
    images: Vec<(String, ImageArray<'py>)>,
    several: bool,
}

impl<'py> Attributes<'py> {
    fn new(object: Option<&Bound<'py, PyAny>>, (width, height): (usize, usize)) -> PyResult<Option<Self>> {
        let Some(object) = object else { return Ok(None) };
        let several = object.is_instance_of::<PyTuple>() || object.is_instance_of::<PyList>();
        let objects = if several {
            let named = |(i, item): (usize, PyResult<_>)| Ok((format!("values[{i}]"), item?));
            object.try_iter()?.enumerate().map(named).collect::<PyResult<Vec<_>>>()?
        } else {
            vec![("values".to_owned(), object.clone())]
        };
        let mut images = Vec::with_capacity(objects.len());
        for (name, object) in objects {
            let image = ImageArray::new(&name, &object, Layout::Hwc)?;
            if image.size() != (width, height) {
                return Err(ImageError::new_err(format!(
                    "{name}: expected shape ({height}, {width}) or ({height}, {width}, C), as depth has, got {}",
                    tuple_text(image.shape())
                )));
            }
            images.push((name, image));
        }
        Ok(Some(Self { images, several }))
    }

    fn gather(&self, py: Python<'py>, index: &[i64]) -> PyResult<Bound<'py, PyAny>> {
        let mut gathered = Vec::with_capacity(self.images.len());
        for (name, image) in &self.images {
            gathered.push(gather::pixels(name, image, index)?);
        }
        if self.several { Ok(PyTuple::new(py, gathered)?.into_any()) } else { Ok(gathered.remove(0)) }
    }
}
