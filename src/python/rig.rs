//! The table behind `ipm_rs.RigLut`, which Python wraps: `ipm_rs/rig` knows names, mappings and missing images.

use std::sync::Arc;

use numpy::{PyArray1, PyArray2, PyArrayDescrMethods, PyArrayMethods};
use pyo3::prelude::*;

use super::adjoint::{Adjoint, Transpose};
use super::arrays;
use super::camera::PyCamera;
use super::convert::{Floats, float, tuple_text};
use super::detached;
use super::dtype::{Samples, Taken, for_blended, for_moved};
use super::error::classes::{ArgumentError, DtypeError, ImageError};
use super::grid::PyBevGrid;
use super::ground::road;
use super::image::{ImageArray, Output};
use super::layout::Layout;
use super::mask::mask_of;
use super::mend::message;
use super::options::{self, BorderValue};
use super::shared;
use crate::error::ViewError;
use crate::rig::{BlendMode, Mix, RigLut, RigOptions};
use crate::view::{PointSample, buffer};
use crate::{Bilinear, Camera, ImageView, ImageViewMut, Interpolation, Sample, WarpOptions};

#[pyclass(frozen, eq, module = "ipm_rs._core", name = "_RigTable")]
#[derive(PartialEq)]
pub(super) struct PyRigTable {
    lut: RigLut,
    names: Vec<String>,
}

#[pymethods]
impl PyRigTable {
    #[new]
    #[expect(clippy::too_many_arguments, reason = "called by one line of Python, by name")]
    #[pyo3(signature = (names, cameras, grid, *, ground, masks, exclude, blend, feather))]
    fn new(
        py: Python<'_>,
        names: Vec<String>,
        cameras: Vec<PyRef<'_, PyCamera>>,
        grid: PyRef<'_, PyBevGrid>,
        ground: Option<&Bound<'_, PyAny>>,
        masks: Vec<Option<Bound<'_, PyAny>>>,
        exclude: Vec<Bound<'_, PyAny>>,
        blend: &Bound<'_, PyAny>,
        feather: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let ground = road(ground)?;
        let blend = blend_mode(blend)?;
        let feather = float("feather", feather)?;
        let mut shown = Vec::with_capacity(masks.len());
        for ((mask, name), camera) in masks.iter().zip(&names).zip(&cameras) {
            let name = format!("masks[{name:?}]");
            let given = mask.as_ref().map(|mask| mask_of(&name, mask, &camera.camera)).transpose()?;
            shown.push(match (given, &camera.mask) {
                (Some(given), Some(own)) => Some(Arc::new(given.and(own))),
                (given, own) => given.map(Arc::new).or_else(|| own.clone()),
            });
        }
        let (cameras, grid): (Vec<Camera>, _) = (cameras.iter().map(|camera| camera.camera).collect(), grid.grid);
        let mut polygons = Vec::with_capacity(exclude.len());
        for (index, polygon) in exclude.iter().enumerate() {
            let name = format!("exclude[{index}]");
            let floats = Floats::new(&name, "an (M, 2) array", polygon)?;
            polygons.push(buffer::copied("exclude", floats.rows::<2>(&name)?)?);
        }
        let lut = detached::run(py, || {
            let named: Vec<_> = names.iter().map(String::as_str).zip(cameras).collect();
            let masks = shown.iter().map(Option::as_deref).collect();
            RigLut::new(&named, &grid, &ground, &RigOptions { masks, exclude: polygons, blend, feather })
        })?;
        Ok(Self { lut, names })
    }

    /// The same without some cameras, given by their places.
    fn without(&self, py: Python<'_>, missing: Vec<usize>) -> PyResult<Self> {
        let names = self.names.iter().enumerate().filter(|(index, _)| !missing.contains(index));
        let names = names.map(|(_, name)| name.clone()).collect();
        Ok(Self { lut: detached::run(py, || self.lut.without(&missing))?, names })
    }

    #[getter]
    fn nbytes(&self) -> usize {
        self.lut.nbytes()
    }

    fn mask<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<bool>>> {
        let mask = detached::run(py, || self.lut.mask())?;
        PyArray1::from_vec(py, mask).reshape(self.shape())
    }

    fn seen<'py>(&self, py: Python<'py>, camera: usize) -> PyResult<Bound<'py, PyArray2<bool>>> {
        let seen = detached::run(py, || self.lut.seen(camera))?;
        PyArray1::from_vec(py, seen).reshape(self.shape())
    }

    fn source<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<i16>>> {
        let source = detached::run(py, || self.lut.source())?;
        PyArray1::from_vec(py, source).reshape(self.shape())
    }

    fn weights<'py>(&self, py: Python<'py>, camera: usize) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let weights = detached::run(py, || self.lut.weights(camera))?;
        PyArray1::from_vec(py, weights).reshape(self.shape())
    }

    /// `images` are in the rig's order; `gains` has a row for each camera.
    #[pyo3(signature = (images, *, interpolation, gains, border_value, out, threads, layout))]
    #[expect(clippy::too_many_arguments, reason = "called by one line of Python, by name")]
    fn warp<'py>(
        &self,
        py: Python<'py>,
        images: Vec<Bound<'py, PyAny>>,
        interpolation: &Bound<'py, PyAny>,
        gains: Option<&Bound<'py, PyAny>>,
        border_value: Option<&Bound<'py, PyAny>>,
        out: Option<&Bound<'py, PyAny>>,
        threads: Option<&Bound<'py, PyAny>>,
        layout: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let taken = options::interpolation(interpolation)?;
        let threads = threads.map(|threads| options::thread_count("threads", threads)).transpose()?;
        let layout = options::layout(layout)?;
        let border_value = BorderValue::new(border_value)?;
        let gains = gains.map(|gains| self.gains_of(gains)).transpose()?;
        let out = Output::new(out)?;
        let images = self.images(&images, layout)?;
        let interpolation = match taken {
            Taken::By(interpolation) => interpolation,
            Taken::Mode => Interpolation::default(), // not looked at
        };
        let job = Job { rig: self, py, images: &images, interpolation, gains, border_value, out, threads };
        match Samples::of(images[0].dtype(), taken)? {
            Samples::Blended(kind) => for_blended!(kind, job.blended()),
            // gains change numbers, which nearest then takes as such
            Samples::Moved(_) if job.gains.is_some() => {
                match Samples::of(images[0].dtype(), Taken::By(Interpolation::Bilinear))? {
                    Samples::Blended(kind) => for_blended!(kind, job.blended()),
                    Samples::Moved(_) | Samples::Ids { .. } => unreachable!("bilinear is blended"),
                }
            }
            Samples::Ids { .. } if job.gains.is_some() => Err(ArgumentError::new_err(
                "gains: expected none for interpolation=\"mode\", whose ids are not brightened; leave them out",
            )),
            Samples::Moved(bytes) => for_moved!(bytes, job.nearest()),
            Samples::Ids { bytes, signed: false } => for_moved!(bytes, job.mode()),
            Samples::Ids { bytes: 1, .. } => job.mode::<i8>(),
            Samples::Ids { bytes: 2, .. } => job.mode::<i16>(),
            Samples::Ids { bytes: 4, .. } => job.mode::<i32>(),
            Samples::Ids { .. } => job.mode::<i64>(),
        }
    }

    /// For each camera, in the rig's order, the transpose of `warp`.
    #[pyo3(signature = (grad, *, interpolation, threads, layout))]
    fn warp_adjoint<'py>(
        &self,
        grad: &Bound<'py, PyAny>,
        interpolation: &Bound<'py, PyAny>,
        threads: Option<&Bound<'py, PyAny>>,
        layout: &Bound<'py, PyAny>,
    ) -> PyResult<Vec<Bound<'py, PyAny>>> {
        let of = ("this RigLut", self.lut.rows(), self.lut.columns());
        let call = Adjoint::new(of, grad, Some(interpolation), None, threads, Some(layout))?;
        (0..self.names.len())
            .map(|camera| call.run(self.lut.source_size(camera), &OfCamera { lut: &self.lut, camera }))
            .collect()
    }

    /// (cameras, channels) factors.
    #[pyo3(signature = (images, previous))]
    fn gains<'py>(
        &self,
        py: Python<'py>,
        images: Vec<Bound<'py, PyAny>>,
        previous: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let previous = previous.map(|gains| self.gains_of(gains)).transpose()?.unwrap_or_default();
        let images = self.images(&images, Layout::Hwc)?;
        let previous = spread("previous", previous, images.len(), images[0].channels())?;
        let Samples::Blended(kind) = Samples::of(images[0].dtype(), Taken::By(Interpolation::Bilinear))? else {
            unreachable!("bilinear is blended")
        };
        let measure = Measure { rig: self, py, images: &images, previous: &previous };
        let gains = for_blended!(kind, measure.gains())?;
        PyArray1::from_vec(py, gains).reshape([self.names.len(), images[0].channels()])
    }
}

/// The transpose of one camera's part, by its place.
struct OfCamera<'a> {
    lut: &'a RigLut,
    camera: usize,
}

impl Transpose for OfCamera<'_> {
    fn run<T: PointSample>(
        &self,
        grads: &[ImageView<'_, T>],
        outs: &mut [ImageViewMut<'_, T>],
        options: &WarpOptions<T>,
    ) -> crate::Result<()> {
        self.lut.warp_many_adjoint_into(self.camera, grads, outs, options)
    }
}

impl PyRigTable {
    fn shape(&self) -> [usize; 2] {
        [self.lut.rows(), self.lut.columns()]
    }

    /// The images, checked to be of one kind, and of the size of their cameras'.
    fn images<'py>(&self, images: &[Bound<'py, PyAny>], layout: Layout) -> PyResult<Vec<ImageArray<'py>>> {
        let name = |index: usize| format!("images[{:?}]", self.names[index]);
        // all of their Python code first, then no more: see `ImageArray`
        let arrays: Vec<_> = (images.iter().enumerate())
            .map(|(index, image)| shared::array(&name(index), image, false))
            .collect::<PyResult<_>>()?;
        let mut checked = Vec::with_capacity(arrays.len());
        for (index, array) in arrays.into_iter().enumerate() {
            let image = ImageArray::new(&name(index), array, layout)?;
            let (width, height) = self.lut.source_size(index);
            let expected = (width as usize, height as usize);
            if image.size() != expected {
                let problem = message(&ViewError::SizeMismatch { expected, got: image.size() }.into());
                return Err(ImageError::new_err(format!("{}: {problem}", name(index))));
            }
            let first = checked.first().unwrap_or(&image);
            if !image.dtype().is_equiv_to(first.dtype()) {
                return Err(DtypeError::new_err(format!(
                    "{}: expected {}, as {}, got {}; convert one of them",
                    name(index),
                    first.dtype(),
                    name(0),
                    image.dtype()
                )));
            }
            let leading = |image: &ImageArray<'_>| (image.shape().len(), image.channels(), image.images());
            if leading(&image) != leading(first) {
                return Err(ImageError::new_err(format!(
                    "{}: expected as many channels and images as {}, of shape {}, got shape {}",
                    name(index),
                    name(0),
                    tuple_text(first.shape()),
                    tuple_text(image.shape())
                )));
            }
            checked.push(image);
        }
        Ok(checked)
    }

    /// (cameras, channels) numbers, or (cameras,), one for all channels; as many as there are images' channels is for
    /// the table to check.
    fn gains_of(&self, gains: &Bound<'_, PyAny>) -> PyResult<Vec<f32>> {
        let gains = Floats::new("gains", "an array of cameras x channels", gains)?;
        if gains.shape().len() != 2 || gains.shape()[0] != self.names.len() {
            return Err(ArgumentError::new_err(format!(
                "gains: expected {} cameras x channels, got shape {}",
                self.names.len(),
                tuple_text(gains.shape())
            )));
        }
        Ok(buffer::collected("gains", gains.values().iter().map(|&gain| gain as f32))?)
    }
}

/// One gain for each channel of each camera, where there may be one for all channels of each.
fn spread(name: &str, gains: Vec<f32>, cameras: usize, channels: usize) -> PyResult<Vec<f32>> {
    match gains.len() {
        given if given == cameras && channels > 1 => {
            Ok(gains.into_iter().flat_map(|gain| std::iter::repeat_n(gain, channels)).collect())
        }
        given if given == 0 || given == cameras * channels => Ok(gains),
        given => Err(ArgumentError::new_err(format!(
            "{name}: expected a factor for each of the {channels} channels, or one for all, got {} for each camera",
            given / cameras
        ))),
    }
}

fn blend_mode(object: &Bound<'_, PyAny>) -> PyResult<BlendMode> {
    match object.extract::<String>().as_deref() {
        Ok("best") => Ok(BlendMode::Best),
        Ok("feather") => Ok(BlendMode::Feather),
        Ok("priority") => Ok(BlendMode::Priority),
        _ => Err(ArgumentError::new_err(format!(
            "blend: expected \"best\", \"feather\" or \"priority\", got {}",
            arrays::described(object)?
        ))),
    }
}

/// One call of `warp`, its dtype not yet chosen.
struct Job<'a, 'py> {
    rig: &'a PyRigTable,
    py: Python<'py>,
    images: &'a [ImageArray<'py>],
    interpolation: Interpolation,
    gains: Option<Vec<f32>>,
    border_value: BorderValue<'py>,
    out: Output<'py>,
    threads: Option<usize>,
}

impl<'py> Job<'_, 'py> {
    fn blended<T: Bilinear + Mix>(self) -> PyResult<Bound<'py, PyAny>> {
        self.run::<T>(RigLut::warp_into)
    }

    fn nearest<T: Sample>(self) -> PyResult<Bound<'py, PyAny>> {
        self.run::<T>(|lut, images, out, options, _| lut.warp_nearest_into(images, out, options))
    }

    fn mode<T: Sample + Ord>(self) -> PyResult<Bound<'py, PyAny>> {
        self.run::<T>(|lut, images, out, options, _| lut.warp_mode_into(images, out, options))
    }

    fn run<T: Sample>(
        self,
        warp: impl Fn(&RigLut, &[ImageView<'_, T>], &mut ImageViewMut<'_, T>, &WarpOptions<T>, &[f32]) -> crate::Result<()>
        + Sync,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (lut, first) = (&self.rig.lut, &self.images[0]);
        let (rows, columns, channels) = (lut.rows(), lut.columns(), first.channels());
        let border = self.border_value.samples::<T>(first.dtype())?;
        if border.len() != 1 && border.len() != channels {
            return Err(ViewError::BorderChannels { expected: channels, got: border.len() }.into());
        }
        let gains = &spread("gains", self.gains.unwrap_or_default(), self.images.len(), channels)?;
        let reads = self.images.iter().map(ImageArray::read).collect::<PyResult<Vec<_>>>()?;
        let views = reads.iter().map(|read| Ok(read.views::<T>()?)).collect::<PyResult<Vec<_>>>()?;
        let out = match self.out.array() {
            Some(array) => {
                let checks = self.images.iter().map(|image| image.check_output(array.clone(), rows, columns));
                checks.collect::<PyResult<Vec<_>>>()?.swap_remove(0)
            }
            None => first.new_output(rows, columns)?,
        };
        let mut write = out.write()?;
        let mut outs = write.views::<T>()?;
        // planes and batches: the images of each in turn; a plane has one channel's border value and gain
        let is_planar = views[0][0].channels() < channels;
        detached::run(self.py, || {
            for (index, out) in outs.iter_mut().enumerate() {
                let images: Vec<ImageView<'_, T>> = views.iter().map(|views| views[index]).collect();
                let channel = index % channels;
                let of_plane =
                    |values: &[f32]| values.iter().skip(channel).step_by(channels).copied().collect::<Vec<_>>();
                let (border_value, gains) = match is_planar {
                    true => (vec![border[channel % border.len()]], of_plane(gains)),
                    false => (border.clone(), gains.to_vec()),
                };
                let options = WarpOptions {
                    interpolation: self.interpolation,
                    border_value,
                    threads: self.threads,
                    ..WarpOptions::default()
                };
                warp(lut, &images, out, &options, &gains)?;
            }
            Ok(())
        })?;
        drop(outs);
        drop(write);
        Ok(self.out.given_or(out))
    }
}

/// One call of `gains`.
struct Measure<'a, 'py> {
    rig: &'a PyRigTable,
    py: Python<'py>,
    images: &'a [ImageArray<'py>],
    previous: &'a [f32],
}

impl Measure<'_, '_> {
    fn gains<T: Bilinear + Mix>(self) -> PyResult<Vec<f32>> {
        let reads = self.images.iter().map(ImageArray::read).collect::<PyResult<Vec<_>>>()?;
        let views = reads.iter().map(|read| Ok(read.views::<T>()?.swap_remove(0))).collect::<PyResult<Vec<_>>>()?;
        detached::run(self.py, || self.rig.lut.gains(&views, self.previous))
    }
}
