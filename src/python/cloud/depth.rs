//! `points_from_depth`.

use numpy::{PyArray1, PyArrayDescrMethods, PyArrayMethods, PyUntypedArray, dtype};
use pyo3::prelude::*;
use pyo3::types::{PyList, PyTuple};

use super::gather;
use super::options::{self, View, Viewer, colour_coded, depth_image, mask_image, wrong_dtype};
use crate::ImageView;
use crate::cloud::{
    CarlaDepth, ChannelOrder, DepthOptions, DepthRows, check_points, cloud_from_depth, points_from_depth_into,
    points_size,
};
use crate::geometry::Pose;
use crate::python::convert::{flag, float, text_of, tuple_text, whole};
use crate::python::detached;
use crate::python::error::OrRefuse;
use crate::python::error::classes::{ArgumentError, ImageError};
use crate::python::image::{ImageArray, Output};
use crate::python::layout::Layout;
use crate::python::options::thread_count;
use crate::python::shared;
use crate::view::{DepthSample, PointSample};

#[doc = help!("points_from_depth")]
#[pyfunction]
#[pyo3(
    signature = (
        depth, K, max_depth = None, frame = None, *, order = None, min_depth = None, kind = None, depth_scale = None,
        stride = None, mask = None, compact = None, values = None, dtype = None, out = None, threads = None
    ),
    text_signature = "(depth, K, max_depth=None, frame='camera', *, order=None, min_depth=None, kind='z', depth_scale=None, stride=1, mask=None, compact=False, values=None, dtype='float32', out=None, threads=None)"
)]
#[expect(clippy::too_many_arguments, reason = "mostly keyword-only, each with one meaning")]
#[expect(non_snake_case, reason = "K is its name in Python")]
pub(in crate::python) fn points_from_depth<'py>(
    depth: &Bound<'py, PyAny>,
    K: &Bound<'py, PyAny>,
    max_depth: Option<&Bound<'py, PyAny>>,
    frame: Option<&Bound<'py, PyAny>>,
    order: Option<&Bound<'py, PyAny>>,
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
    let viewer = Viewer::new(K)?;
    let frame_from_camera = options::frame(frame, &viewer)?;
    let order = order.filter(|order| !order.is_none()).map(options::named_order).transpose()?;
    let (min_depth, max_depth) = options::depth_limits(min_depth, max_depth)?;
    let depth_scale = depth_scale.filter(|scale| !scale.is_none()).map(|scale| float("depth_scale", scale));
    let depth_scale = depth_scale.transpose()?;
    let options = DepthOptions {
        kind: options::depth_kind(kind)?,
        scale: depth_scale.unwrap_or(1.0),
        min_depth,
        max_depth,
        stride: stride.map_or(Ok(1), |object| whole("stride", object))? as usize,
        threads: threads.map(|threads| thread_count("threads", threads)).transpose()?,
    };
    let (compact, double) = (compact.map_or(Ok(false), |object| flag("compact", object))?, double(dtype)?);
    let mask = mask.filter(|mask| !mask.is_none()).map(|mask| shared::array("mask", mask, false)).transpose()?;
    let values = values.filter(|values| !values.is_none()).map(Attributes::new).transpose()?;
    let out = Output::new(out)?;

    let depth = shared::array("depth", depth, false)?;
    let depth = match order {
        Some(order) => colour_coded("depth", depth, Some(order))?.0,
        None => depth_image("depth", depth)?,
    };
    if depth_scale.is_none() && depth.dtype().kind() == b'u' && depth.dtype().itemsize() == 2 {
        return Err(ArgumentError::new_err(
            "depth_scale: expected metres per unit with a uint16 depth image, got none; 0.001 for millimetres (RealSense, ScanNet), 1 / 5000 for TUM, 1 / 256 for KITTI",
        ));
    }
    let view = viewer.view(depth.size())?;
    let mask = mask.map(mask_image).transpose()?;
    let call = Call { depth, view, frame_from_camera, options, mask, values, out };
    if !compact && call.values.is_some() {
        return Err(ArgumentError::new_err(
            "values: expected only with compact=True; organised points line up with image[::stride, ::stride] already",
        ));
    }
    if compact && call.out.array().is_some() {
        return Err(ArgumentError::new_err(
            "out: expected only without compact=True: how many points there are is known when they have been found",
        ));
    }
    if let Some(order) = order {
        return if double { call.run_carla::<f64>(order, compact) } else { call.run_carla::<f32>(order, compact) };
    }
    match (call.depth.dtype().kind(), call.depth.dtype().itemsize(), double) {
        (b'u', 2, false) => call.run::<u16, f32>(compact),
        (b'u', 2, true) => call.run::<u16, f64>(compact),
        (b'f', 4, false) => call.run::<f32, f32>(compact),
        (b'f', 4, true) => call.run::<f32, f64>(compact),
        (b'f', 8, false) => call.run::<f64, f32>(compact),
        (b'f', 8, true) => call.run::<f64, f64>(compact),
        _ => {
            let mend = match call.depth.dtype().itemsize() {
                1 => {
                    "8 bits are a picture of depth, not depth: use the file that it was made from, or order= if they are CARLA's code"
                }
                _ => "use depth.astype(numpy.float32)",
            };
            Err(wrong_dtype("depth", "uint16, float32 or float64", call.depth.dtype(), mend))
        }
    }
}

/// Whether the points are float64.
fn double(object: Option<&Bound<'_, PyAny>>) -> PyResult<bool> {
    let Some(object) = object else { return Ok(false) };
    let refuse = || match text_of(object) {
        Ok(got) => ArgumentError::new_err(format!("dtype: expected \"float32\" or \"float64\", got {got}")),
        Err(error) => error,
    };
    let py = object.py();
    let dtype = py.import("numpy")?.call_method1("dtype", (object,)).or_refuse(py, refuse)?;
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
    values: Option<Attributes<'py>>,
    out: Output<'py>,
}

impl<'py> Call<'py> {
    fn run<T: DepthSample, O: PointSample + numpy::Element>(self, compact: bool) -> PyResult<Bound<'py, PyAny>> {
        let read = self.depth.read()?;
        let depth = read.views::<T>()?[0];
        self.of::<_, O>(&depth, compact)
    }

    /// Of CARLA's colour-coded image.
    fn run_carla<O: PointSample + numpy::Element>(
        self,
        order: ChannelOrder,
        compact: bool,
    ) -> PyResult<Bound<'py, PyAny>> {
        let read = self.depth.read()?;
        let image = read.views::<u8>()?[0];
        self.of::<_, O>(&CarlaDepth::new(&image, order)?, compact)
    }

    fn of<D: DepthRows, O: PointSample + numpy::Element>(
        &self,
        depth: &D,
        compact: bool,
    ) -> PyResult<Bound<'py, PyAny>> {
        let mask_read = self.mask.as_ref().map(ImageArray::read).transpose()?;
        let mask = mask_read.as_ref().map(|read| read.views::<u8>()).transpose()?.map(|views| views[0]);
        if compact {
            return self.compact::<D, O>(depth, mask.as_ref());
        }
        let written = self.organised::<D, O>(depth, mask.as_ref())?;
        Ok(self.out.given_or(written))
    }

    fn organised<D: DepthRows, O: PointSample + numpy::Element>(
        &self,
        depth: &D,
        mask: Option<&ImageView<'_, u8>>,
    ) -> PyResult<ImageArray<'py>> {
        let py = self.depth.dtype().py();
        let (width, height) = points_size(self.depth.size(), self.options.stride);
        let (shape, kind) = ([height, width, 3], dtype::<O>(py));
        check_points("depth", (width, height))?; // before it is allocated
        let out = match self.out.array() {
            Some(out) => {
                let dtype = (&kind, "that of dtype=", "dtype");
                let inputs = [("depth", Some(&self.depth)), ("mask", self.mask.as_ref())];
                let inputs: Vec<_> = inputs.into_iter().filter_map(|(name, array)| Some((name, array?))).collect();
                ImageArray::output(out, &shape, dtype, Layout::Hwc, &inputs)?
            }
            None => ImageArray::allocate(&shape, kind, Layout::Hwc)?,
        };
        let mut write = out.write()?;
        let mut outs = write.views::<O>()?;
        let (view, frame, options) = (self.view.viewpoint(), &self.frame_from_camera, &self.options);
        detached::run(py, || points_from_depth_into(depth, view, frame, mask, options, &mut outs[0]))?;
        drop(outs);
        drop(write);
        Ok(out)
    }

    fn compact<D: DepthRows, O: PointSample + numpy::Element>(
        &self,
        depth: &D,
        mask: Option<&ImageView<'_, u8>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let py = self.depth.dtype().py();
        let attributes = self.values.as_ref();
        let images = attributes.map(|attributes| attributes.images(self.depth.size())).transpose()?;
        let (view, frame, options) = (self.view.viewpoint(), &self.frame_from_camera, &self.options);
        let cloud = detached::run(py, || cloud_from_depth::<_, O>(depth, view, frame, mask, options))?;
        let values = attributes.zip(images).map(|(values, images)| values.gather(py, &images, &cloud.index));
        let values = values.transpose()?;
        let count = cloud.points.len();
        let points = PyArray1::from_vec(py, cloud.points.into_flattened()).reshape([count, 3])?.into_any();
        let index = PyArray1::from_vec(py, cloud.index).into_any();
        let arrays: Vec<_> = [Some(points), Some(index), values].into_iter().flatten().collect();
        Ok(PyTuple::new(py, arrays)?.into_any())
    }
}

/// What is gathered beside the points: one image, or several.
struct Attributes<'py> {
    arrays: Vec<(String, Bound<'py, PyUntypedArray>)>,
    several: bool,
}

impl<'py> Attributes<'py> {
    /// Takes them as arrays; their Python code runs here.
    fn new(object: &Bound<'py, PyAny>) -> PyResult<Self> {
        let array = |name: String, object| Ok::<_, PyErr>((name.clone(), shared::array(&name, object, false)?));
        let several = object.is_instance_of::<PyTuple>() || object.is_instance_of::<PyList>();
        if !several {
            return Ok(Self { arrays: vec![array("values".to_owned(), object)?], several });
        }
        let items = object.try_iter()?.collect::<PyResult<Vec<_>>>()?;
        let arrays = items.iter().enumerate().map(|(i, item)| array(format!("values[{i}]"), item));
        Ok(Self { arrays: arrays.collect::<PyResult<_>>()?, several })
    }

    /// Checks them against the size of the depth image.
    fn images(&self, (width, height): (usize, usize)) -> PyResult<Vec<(&str, ImageArray<'py>)>> {
        let mut images = Vec::with_capacity(self.arrays.len());
        for (name, array) in &self.arrays {
            let image = ImageArray::new(name, array.clone(), Layout::Hwc)?;
            if image.size() != (width, height) {
                return Err(ImageError::new_err(format!(
                    "{name}: expected shape ({height}, {width}) or ({height}, {width}, C), as depth has, got {}",
                    tuple_text(image.shape())
                )));
            }
            images.push((name.as_str(), image));
        }
        Ok(images)
    }

    fn gather(
        &self,
        py: Python<'py>,
        images: &[(&str, ImageArray<'py>)],
        index: &[i64],
    ) -> PyResult<Bound<'py, PyAny>> {
        let mut gathered = Vec::with_capacity(images.len());
        for (name, image) in images {
            gathered.push(gather::pixels(name, image, index)?);
        }
        if self.several { Ok(PyTuple::new(py, gathered)?.into_any()) } else { Ok(gathered.remove(0)) }
    }
}
