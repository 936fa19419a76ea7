//! Arguments that several functions have in common.

use nalgebra::Vector3;
use numpy::{PyArrayDescr, PyArrayDescrMethods};
use pyo3::prelude::*;
use pyo3::types::PyString;

use super::rays::PyPixelRays;
use crate::cloud::{ChannelOrder, DepthKind, Viewpoint};
use crate::geometry::{OPTICAL_FROM_FLU, Pose};
use crate::python::camera::PyCamera;
use crate::python::convert::{float, matrix3, matrix4, tuple_text, type_name};
use crate::python::error::classes::{ArgumentError, ArgumentTypeError, DtypeError, ImageError};
use crate::python::image::ImageArray;
use crate::python::layout::Layout;
use crate::{Camera, Pinhole};

/// A word of a few, by name.
fn word<'a>(expected: &str, object: &'a Bound<'_, PyAny>) -> PyResult<&'a str> {
    match object.cast::<PyString>() {
        Ok(text) => text.to_str(),
        Err(_) => Err(ArgumentTypeError::new_err(format!("{expected}, got {}", type_name(object)))),
    }
}

/// `"bgra"`, `"rgba"`, `"bgr"` or `"rgb"`; where nothing is said, `"bgra"` if there are four channels.
pub(super) fn channel_order(object: Option<&Bound<'_, PyAny>>, channels: Option<usize>) -> PyResult<ChannelOrder> {
    let expected = "order: expected \"bgra\", \"rgba\", \"bgr\" or \"rgb\"";
    let Some(object) = object else {
        return match channels {
            None | Some(4) => Ok(ChannelOrder::Bgra),
            Some(_) => Err(ArgumentError::new_err(
                "order: expected \"bgr\" (OpenCV) or \"rgb\" (Pillow) for an image of 3 channels, got none; the two give different depths, and nothing in the image tells them apart",
            )),
        };
    };
    let got = word(expected, object)?;
    let found = ChannelOrder::ALL.into_iter().find(|order| order.name() == got);
    let order = found.ok_or_else(|| ArgumentError::new_err(format!("{expected}, got {got:?}")))?;
    match channels {
        Some(channels) if channels != order.channels() => Err(ArgumentError::new_err(format!(
            "order: expected one of {channels} letters for an image of {channels} channels, got {got:?}"
        ))),
        _ => Ok(order),
    }
}

/// `"z"` or `"ray"`.
pub(super) fn depth_kind(object: Option<&Bound<'_, PyAny>>) -> PyResult<DepthKind> {
    let expected = "kind: expected \"z\" (planar depth) or \"ray\" (distance along the ray)";
    match object.map(|object| word(expected, object)).transpose()? {
        None | Some("z") => Ok(DepthKind::Planar),
        Some("ray") => Ok(DepthKind::Ray),
        Some(other) => Err(ArgumentError::new_err(format!("{expected}, got {other:?}"))),
    }
}

/// min_depth and max_depth.
pub(super) fn depth_limits(
    min_depth: Option<&Bound<'_, PyAny>>,
    max_depth: Option<&Bound<'_, PyAny>>,
) -> PyResult<(f64, f64)> {
    let min_depth = min_depth.map_or(Ok(0.0), |object| float("min_depth", object))?;
    let max_depth = max_depth.map_or(Ok(f64::INFINITY), |object| float("max_depth", object))?;
    Ok((min_depth, max_depth))
}

/// What looks at a depth image.
pub(super) struct View<'py> {
    pub(super) camera: Camera,
    /// Whether the camera knows where it stands.
    posed: bool,
    rays: Option<Bound<'py, PyPixelRays>>,
}

impl<'py> View<'py> {
    /// Of a `Camera`, of `PixelRays`, or the pinhole of an intrinsic matrix and an image of that size.
    pub(super) fn new(object: &Bound<'py, PyAny>, (width, height): (usize, usize)) -> PyResult<Self> {
        if let Ok(camera) = object.cast::<PyCamera>() {
            return Ok(Self { camera: camera.get().camera, posed: true, rays: None });
        }
        if let Ok(rays) = object.cast::<PyPixelRays>() {
            return Ok(Self { camera: *rays.get().rays.camera(), posed: true, rays: Some(rays.clone()) });
        }
        let model = Pinhole::from_matrix(&matrix3("K", object)?)?;
        let size = |length| u32::try_from(length).unwrap_or(u32::MAX);
        let camera = Camera::new(model, (size(width), size(height)), Camera::forward_pose())?;
        Ok(Self { camera, posed: false, rays: None })
    }

    pub(super) fn viewpoint(&self) -> Viewpoint<'_> {
        self.rays.as_ref().map_or_else(|| Viewpoint::from(&self.camera), |rays| Viewpoint::from(&rays.get().rays))
    }
}

/// `frame_from_camera` of `"camera"`, `"flu"`, `"vehicle"` or a (4, 4) pose.
pub(super) fn frame(object: Option<&Bound<'_, PyAny>>, view: &View<'_>) -> PyResult<Pose> {
    let expected = "frame: expected \"camera\", \"flu\", \"vehicle\" or a (4, 4) pose dst_from_camera";
    let rotated = |rotation| Pose::new("frame", rotation, Vector3::zeros());
    let Some(object) = object else { return Ok(rotated(nalgebra::Matrix3::identity())?) };
    let Ok(name) = object.cast::<PyString>() else {
        return Ok(Pose::from_matrix("frame", &matrix4("frame", object)?)?);
    };
    match name.to_str()? {
        "camera" => Ok(rotated(nalgebra::Matrix3::identity())?),
        "flu" => Ok(rotated(OPTICAL_FROM_FLU.transpose())?),
        "vehicle" if view.posed => Ok(*view.camera.vehicle_from_camera()),
        "vehicle" => Err(ArgumentError::new_err(
            "frame: \"vehicle\" needs a Camera, which has a pose, got a bare K; use ipm_rs.Camera(K, image_size=..., vehicle_from_camera=...) or frame=\"flu\"",
        )),
        other => Err(ArgumentError::new_err(format!("{expected}, got {other:?}"))),
    }
}

/// A depth image: (H, W).
pub(super) fn depth_image<'py>(name: &str, object: &Bound<'py, PyAny>) -> PyResult<ImageArray<'py>> {
    let image = ImageArray::new(name, object, Layout::Hwc)?;
    match image.shape() {
        [_, _] => Ok(image),
        shape => Err(ImageError::new_err(format!(
            "{name}: expected shape (H, W), got {}{}",
            tuple_text(shape),
            match shape {
                [_, _, 1] => format!("; use {name}[..., 0]"),
                _ => "; colour-coded depth is decoded first, as by decode_carla_depth".to_owned(),
            }
        ))),
    }
}

/// A mask of a depth image: (H, W) of bool or uint8.
pub(super) fn mask_image<'py>(object: &Bound<'py, PyAny>) -> PyResult<ImageArray<'py>> {
    let mask = depth_image("mask", object)?;
    match (mask.dtype().kind(), mask.dtype().itemsize()) {
        (b'b' | b'u', 1) => Ok(mask),
        _ => Err(wrong_dtype("mask", "bool or uint8", mask.dtype(), "use mask != 0")),
    }
}

/// An array of a dtype that is not taken.
pub(super) fn wrong_dtype(name: &str, expected: &str, got: &Bound<'_, PyArrayDescr>, mend: &str) -> PyErr {
    DtypeError::new_err(format!("{name}: expected {expected}, got {got}; {mend}"))
}
