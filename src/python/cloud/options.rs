//! Arguments that several functions have in common.

use nalgebra::Vector3;
use numpy::{PyArrayDescr, PyArrayDescrMethods, PyUntypedArray};
use pyo3::prelude::*;
use pyo3::types::PyString;

use super::rays::PyPixelRays;
use crate::cloud::{ChannelOrder, DepthKind, Viewpoint};
use crate::geometry::{OPTICAL_FROM_FLU, Pose};
use crate::python::camera::PyCamera;
use crate::python::convert::{float, matrix3, matrix4, tuple_text, word};
use crate::python::error::classes::{ArgumentError, DtypeError, ImageError};
use crate::python::error::of_argument;
use crate::python::image::ImageArray;
use crate::python::layout::Layout;
use crate::{Camera, Pinhole};

/// `"bgra"`, `"rgba"`, `"bgr"` or `"rgb"`.
pub(super) fn named_order(object: &Bound<'_, PyAny>) -> PyResult<ChannelOrder> {
    let expected = "order: expected \"bgra\", \"rgba\", \"bgr\" or \"rgb\"";
    let got = word(expected, object)?;
    let found = ChannelOrder::ALL.into_iter().find(|order| order.name() == got);
    found.ok_or_else(|| ArgumentError::new_err(format!("{expected}, got {got:?}")))
}

/// The order of an image of so many channels; where nothing is said, `"bgra"` if there are four.
fn order_of_channels(named: Option<ChannelOrder>, channels: usize) -> PyResult<ChannelOrder> {
    match named {
        None if channels == 4 => Ok(ChannelOrder::Bgra),
        None => Err(ArgumentError::new_err(
            "order: expected \"bgr\" (OpenCV) or \"rgb\" (Pillow) for an image of 3 channels, got none; the two give different depths, and nothing in the image tells them apart",
        )),
        Some(order) if channels != order.channels() => Err(ArgumentError::new_err(format!(
            "order: expected one of {channels} letters for an image of {channels} channels, got {:?}",
            order.name()
        ))),
        Some(order) => Ok(order),
    }
}

/// A colour-coded depth image, (H, W, 4) or (H, W, 3) of uint8, and the order of its channels.
pub(super) fn colour_coded<'py>(
    name: &str,
    array: Bound<'py, PyUntypedArray>,
    named: Option<ChannelOrder>,
) -> PyResult<(ImageArray<'py>, ChannelOrder)> {
    let image = ImageArray::new(name, array, Layout::Hwc)?;
    if !(image.dtype().kind() == b'u' && image.dtype().itemsize() == 1) {
        return Err(wrong_dtype(name, "uint8", image.dtype(), "the code is three bytes, so read the file as 8-bit"));
    }
    let &[_, _, channels @ (3 | 4)] = image.shape() else {
        let got = tuple_text(image.shape());
        let message = format!("{name}: expected shape (H, W, 4) or (H, W, 3) of colour-coded depth, got {got}");
        return Err(ImageError::new_err(message));
    };
    let order = order_of_channels(named, channels)?;
    Ok((image, order))
}

/// `"z"` or `"ray"`.
pub(super) fn depth_kind(object: Option<&Bound<'_, PyAny>>) -> PyResult<DepthKind> {
    let expected = "kind: expected \"z\" (planar depth) or \"ray\" (distance along the ray)";
    match object.map(|object| word(expected, object)).transpose()?.as_deref() {
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

/// What `K=` says: a `Camera`, `PixelRays`, or the pinhole of an intrinsic matrix.
pub(super) enum Viewer<'py> {
    Camera(Bound<'py, PyCamera>),
    Rays(Bound<'py, PyPixelRays>),
    Pinhole(Pinhole),
}

impl<'py> Viewer<'py> {
    pub(super) fn new(object: &Bound<'py, PyAny>) -> PyResult<Self> {
        if let Ok(camera) = object.cast::<PyCamera>() {
            return Ok(Self::Camera(camera.clone()));
        }
        if let Ok(rays) = object.cast::<PyPixelRays>() {
            return Ok(Self::Rays(rays.clone()));
        }
        Ok(Self::Pinhole(Pinhole::from_matrix(&matrix3("K", object)?)?))
    }

    /// Where it stands, if it knows.
    fn vehicle_from_camera(&self) -> Option<&Pose> {
        match self {
            Self::Camera(camera) => Some(camera.get().camera.vehicle_from_camera()),
            Self::Rays(rays) => Some(rays.get().rays.camera().vehicle_from_camera()),
            Self::Pinhole(_) => None,
        }
    }

    /// Looking at a depth image of that size.
    pub(super) fn view(self, (width, height): (usize, usize)) -> PyResult<View<'py>> {
        match self {
            Self::Camera(camera) => Ok(View { camera: camera.get().camera, rays: None }),
            Self::Rays(rays) => Ok(View { camera: *rays.get().rays.camera(), rays: Some(rays) }),
            Self::Pinhole(model) => {
                let size = |length| u32::try_from(length).unwrap_or(u32::MAX);
                let camera = Camera::new(model, (size(width), size(height)), Camera::forward_pose())?;
                Ok(View { camera, rays: None })
            }
        }
    }
}

/// What looks at a depth image.
pub(super) struct View<'py> {
    camera: Camera,
    rays: Option<Bound<'py, PyPixelRays>>,
}

impl View<'_> {
    pub(super) fn viewpoint(&self) -> Viewpoint<'_> {
        self.rays.as_ref().map_or_else(|| Viewpoint::from(&self.camera), |rays| Viewpoint::from(&rays.get().rays))
    }
}

/// `frame_from_camera` of `"camera"`, `"flu"`, `"vehicle"` or a (4, 4) pose.
pub(super) fn frame(object: Option<&Bound<'_, PyAny>>, viewer: &Viewer<'_>) -> PyResult<Pose> {
    let expected = "frame: expected \"camera\", \"flu\", \"vehicle\" or a (4, 4) pose dst_from_camera";
    let rotated = |rotation| Pose::new(rotation, Vector3::zeros());
    let Some(object) = object else { return Ok(rotated(nalgebra::Matrix3::identity())?) };
    if !object.is_instance_of::<PyString>() {
        return Pose::from_matrix(&matrix4("frame", object)?).map_err(|error| of_argument("frame", error));
    }
    match word(expected, object)?.as_ref() {
        "camera" => Ok(rotated(nalgebra::Matrix3::identity())?),
        "flu" => Ok(rotated(OPTICAL_FROM_FLU.transpose())?),
        "vehicle" => viewer.vehicle_from_camera().copied().ok_or_else(|| ArgumentError::new_err(
            "frame: \"vehicle\" needs a Camera, which has a pose, got a bare K; use ipm_rs.Camera(K, image_size=..., vehicle_from_camera=...) or frame=\"flu\"",
        )),
        other => Err(ArgumentError::new_err(format!("{expected}, got {other:?}"))),
    }
}

/// A depth image: (H, W).
pub(super) fn depth_image<'py>(name: &str, array: Bound<'py, PyUntypedArray>) -> PyResult<ImageArray<'py>> {
    let image = ImageArray::new(name, array, Layout::Hwc)?;
    match image.shape() {
        [_, _] => Ok(image),
        shape => Err(ImageError::new_err(format!(
            "{name}: expected shape (H, W), got {}{}",
            tuple_text(shape),
            match shape {
                [_, _, 1] => format!("; use {name}[..., 0]"),
                _ => "; use order= for CARLA's colour-coded depth, or decode it first, as by decode_carla_depth"
                    .to_owned(),
            }
        ))),
    }
}

/// A mask of a depth image: (H, W) of bool or uint8.
pub(super) fn mask_image<'py>(array: Bound<'py, PyUntypedArray>) -> PyResult<ImageArray<'py>> {
    let mask = depth_image("mask", array)?;
    match (mask.dtype().kind(), mask.dtype().itemsize()) {
        (b'b' | b'u', 1) => Ok(mask),
        _ => Err(wrong_dtype("mask", "bool or uint8", mask.dtype(), "use mask != 0")),
    }
}

/// An array of a dtype that is not taken.
pub(super) fn wrong_dtype(name: &str, expected: &str, got: &Bound<'_, PyArrayDescr>, mend: &str) -> PyErr {
    DtypeError::new_err(format!("{name}: expected {expected}, got {got}; {mend}"))
}
