//! Colour-coded depth.

use numpy::{PyArrayDescrMethods, dtype};
use pyo3::prelude::*;

use super::options::{colour_coded, depth_image, named_order, wrong_dtype};
use crate::cloud::{ChannelOrder, DepthUnit, decode_carla_depth_into, encode_carla_depth_into};
use crate::python::convert::flag;
use crate::python::detached;
use crate::python::image::{ImageArray, Output};
use crate::python::layout::Layout;
use crate::python::options::thread_count;
use crate::python::shared;
use crate::view::PointSample;

fn unit(normalized: Option<&Bound<'_, PyAny>>) -> PyResult<DepthUnit> {
    Ok(match normalized.map_or(Ok(false), |object| flag("normalized", object))? {
        true => DepthUnit::Normalized,
        false => DepthUnit::Metres,
    })
}

#[doc = help!("decode_carla_depth")]
#[pyfunction]
#[pyo3(
    signature = (image, *, order = None, normalized = None, out = None, threads = None),
    text_signature = "(image, *, order=None, normalized=False, out=None, threads=None)"
)]
pub(in crate::python) fn decode_carla_depth<'py>(
    image: &Bound<'py, PyAny>,
    order: Option<&Bound<'py, PyAny>>,
    normalized: Option<&Bound<'py, PyAny>>,
    out: Option<&Bound<'py, PyAny>>,
    threads: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let py = image.py();
    let named_order = order.map(named_order).transpose()?;
    let unit = unit(normalized)?;
    let threads = threads.map(|threads| thread_count("threads", threads)).transpose()?;
    let out = Output::new(out)?;
    let (image, order) = colour_coded("image", shared::array("image", image, false)?, named_order)?;
    let (width, height) = image.size();
    let (shape, float32) = ([height, width], dtype::<f32>(py));
    let read = image.read()?;
    let views = read.views::<u8>()?;
    let written = match out.array() {
        Some(array) => {
            let dtype = (&float32, "which depth is decoded to", "numpy.float32");
            ImageArray::output(array, &shape, dtype, Layout::Hwc, &[("image", &image)])?
        }
        None => ImageArray::allocate(&shape, float32, Layout::Hwc)?,
    };
    let mut write = written.write()?;
    let mut outs = write.views::<f32>()?;
    detached::run(py, || decode_carla_depth_into(&views[0], order, unit, &mut outs[0], threads))?;
    drop(outs);
    drop(write);
    Ok(out.given_or(written))
}

#[doc = help!("encode_carla_depth")]
#[pyfunction]
#[pyo3(
    signature = (depth, *, order = None, normalized = None, out = None, threads = None),
    text_signature = "(depth, *, order='bgra', normalized=False, out=None, threads=None)"
)]
pub(in crate::python) fn encode_carla_depth<'py>(
    depth: &Bound<'py, PyAny>,
    order: Option<&Bound<'py, PyAny>>,
    normalized: Option<&Bound<'py, PyAny>>,
    out: Option<&Bound<'py, PyAny>>,
    threads: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let order = order.map_or(Ok(ChannelOrder::Bgra), named_order)?;
    let unit = unit(normalized)?;
    let threads = threads.map(|threads| thread_count("threads", threads)).transpose()?;
    let out = Output::new(out)?;
    let image = depth_image("depth", shared::array("depth", depth, false)?)?;
    match (image.dtype().kind(), image.dtype().itemsize()) {
        (b'f', 4) => encode::<f32>(&image, order, unit, &out, threads),
        (b'f', 8) => encode::<f64>(&image, order, unit, &out, threads),
        _ => Err(wrong_dtype("depth", "float32 or float64", image.dtype(), "use depth * metres_per_unit")),
    }
}

fn encode<'py, T: PointSample>(
    depth: &ImageArray<'py>,
    order: ChannelOrder,
    unit: DepthUnit,
    out: &Output<'py>,
    threads: Option<usize>,
) -> PyResult<Bound<'py, PyAny>> {
    let py = depth.dtype().py();
    let read = depth.read()?;
    let views = read.views::<T>()?;
    let shape = [depth.shape()[0], depth.shape()[1], order.channels()];
    let uint8 = dtype::<u8>(py);
    let written = match out.array() {
        Some(array) => {
            let dtype = (&uint8, "which depth is encoded in", "numpy.uint8");
            ImageArray::output(array, &shape, dtype, Layout::Hwc, &[("depth", depth)])?
        }
        None => ImageArray::allocate(&shape, uint8, Layout::Hwc)?,
    };
    let mut write = written.write()?;
    let mut outs = write.views::<u8>()?;
    detached::run(py, || encode_carla_depth_into(&views[0], order, unit, &mut outs[0], threads))?;
    drop(outs);
    drop(write);
    Ok(out.given_or(written))
}
