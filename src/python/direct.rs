//! `remap` and `warp_perspective`: warps without a table.

use pyo3::prelude::*;

use super::convert::{flag, matrix3, size};
use super::detached;
use super::dtype::{Samples, Taken, for_blended, for_moved};
use super::image::{ImageArray, Output};
use super::layout::Layout;
use super::maps::{MapPair, map_arrays};
use super::options::{self, BorderValue};
use super::shared;
use crate::error::WarpError;
use crate::table::check_cells;
use crate::view::check_image_size;
use crate::{
    Bilinear, BorderMode, ImageView, ImageViewMut, Interpolation, Mapping, Sample, WarpOptions, inverse_homography,
    warp_direct_into, warp_direct_nearest_into,
};

#[doc = help!("remap")]
#[pyfunction]
#[pyo3(
    signature = (image, map_x, map_y, *, interpolation = None, border_mode = None, border_value = None, out = None, threads = None),
    text_signature = "(image, map_x, map_y, *, interpolation='bilinear', border_mode='constant', border_value=0, out=None, threads=None)"
)]
#[expect(clippy::too_many_arguments, reason = "keyword-only, each with one meaning")]
pub(super) fn remap<'py>(
    image: &Bound<'py, PyAny>,
    map_x: &Bound<'py, PyAny>,
    map_y: &Bound<'py, PyAny>,
    interpolation: Option<&Bound<'py, PyAny>>,
    border_mode: Option<&Bound<'py, PyAny>>,
    border_value: Option<&Bound<'py, PyAny>>,
    out: Option<&Bound<'py, PyAny>>,
    threads: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let arrays = map_arrays(map_x, map_y)?;
    let call = Call::new(image, interpolation, border_mode, border_value, out, threads)?;
    let maps = MapPair::new(&arrays)?;
    match &maps {
        MapPair::Fixed { maps: [xs, ys], shape } => call.run(&Mapping::MapsF32(xs, ys), *shape),
        MapPair::F32(xs, ys) => call.run(&Mapping::MapsF32(xs.as_slice()?, ys.as_slice()?), maps.shape()),
        MapPair::F64(xs, ys) => call.run(&Mapping::MapsF64(xs.as_slice()?, ys.as_slice()?), maps.shape()),
    }
}

#[doc = help!("warp_perspective")]
#[pyfunction]
#[pyo3(
    signature = (image, M, dsize, *, interpolation = None, inverse_map = None, border_mode = None, border_value = None, out = None, threads = None),
    text_signature = "(image, M, dsize, *, interpolation='bilinear', inverse_map=False, border_mode='constant', border_value=0, out=None, threads=None)"
)]
#[expect(non_snake_case, reason = "the field's name for a homography")]
#[expect(clippy::too_many_arguments, reason = "keyword-only, each with one meaning")]
pub(super) fn warp_perspective<'py>(
    image: &Bound<'py, PyAny>,
    M: &Bound<'py, PyAny>,
    dsize: &Bound<'py, PyAny>,
    interpolation: Option<&Bound<'py, PyAny>>,
    inverse_map: Option<&Bound<'py, PyAny>>,
    border_mode: Option<&Bound<'py, PyAny>>,
    border_value: Option<&Bound<'py, PyAny>>,
    out: Option<&Bound<'py, PyAny>>,
    threads: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let matrix = matrix3("M", M)?;
    let inverse_map = inverse_map.map_or(Ok(false), |object| flag("inverse_map", object))?;
    let source_from_output = if inverse_map { matrix } else { inverse_homography(&matrix)? };
    let (width, height) = size("dsize", dsize)?;
    check_image_size("dsize", width.into(), height.into())?;
    let call = Call::new(image, interpolation, border_mode, border_value, out, threads)?;
    call.run(&Mapping::Homography(source_from_output), (height as usize, width as usize))
}

/// The arguments that both have in common, checked.
struct Call<'py> {
    image: ImageArray<'py>,
    interpolation: Interpolation,
    border_mode: Option<BorderMode>,
    border_value: BorderValue<'py>,
    out: Output<'py>,
    threads: Option<usize>,
}

/// [`warp_direct_into`] or [`warp_direct_nearest_into`].
type DirectFn<T> = fn(&ImageView<'_, T>, &Mapping<'_>, &mut ImageViewMut<'_, T>, &WarpOptions<T>) -> crate::Result<()>;

impl<'py> Call<'py> {
    /// Runs the Python code of all of them, and checks the image after it.
    fn new(
        image: &Bound<'py, PyAny>,
        interpolation: Option<&Bound<'py, PyAny>>,
        border_mode: Option<&Bound<'py, PyAny>>,
        border_value: Option<&Bound<'py, PyAny>>,
        out: Option<&Bound<'py, PyAny>>,
        threads: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Self> {
        Ok(Self {
            interpolation: match interpolation.map_or(Ok(Taken::By(Interpolation::Bilinear)), options::interpolation)? {
                Taken::By(interpolation) => interpolation.without_table()?,
                Taken::Mode => return Err(WarpError::NeedsTable { got: "mode" }.into()),
            },
            border_mode: border_mode.map(options::border_mode).transpose()?,
            threads: threads.map(|threads| options::thread_count("threads", threads)).transpose()?,
            border_value: BorderValue::new(border_value)?,
            out: Output::new(out)?,
            image: ImageArray::new("image", shared::array("image", image, false)?, Layout::Hwc)?,
        })
    }

    /// Warps to an output of (rows, columns).
    fn run(self, mapping: &Mapping<'_>, shape: (usize, usize)) -> PyResult<Bound<'py, PyAny>> {
        match Samples::of(self.image.dtype(), Taken::By(self.interpolation))? {
            Samples::Blended(kind) => for_blended!(kind, self.blended(mapping, shape)),
            Samples::Moved(bytes) | Samples::Ids { bytes, .. } => for_moved!(bytes, self.nearest(mapping, shape)),
        }
    }

    fn blended<T: Bilinear>(self, mapping: &Mapping<'_>, shape: (usize, usize)) -> PyResult<Bound<'py, PyAny>> {
        self.run_as::<T>(warp_direct_into, mapping, shape)
    }

    fn nearest<T: Sample>(self, mapping: &Mapping<'_>, shape: (usize, usize)) -> PyResult<Bound<'py, PyAny>> {
        self.run_as::<T>(warp_direct_nearest_into, mapping, shape)
    }

    fn run_as<T: Sample>(
        self,
        warp: DirectFn<T>,
        mapping: &Mapping<'_>,
        (rows, columns): (usize, usize),
    ) -> PyResult<Bound<'py, PyAny>> {
        let py = self.image.dtype().py();
        check_cells(rows, columns)?; // before it is allocated
        options::check_kept(self.border_mode, &self.out)?;
        let border_value = self.border_value.samples::<T>(self.image.dtype())?;
        let Self { interpolation, border_mode, threads, .. } = self;
        let options = WarpOptions { interpolation, border_value, border_mode, threads, isa: None };
        let read = self.image.read()?;
        let views = read.views::<T>()?;
        let out = match self.out.array() {
            Some(array) => self.image.check_output(array, rows, columns)?,
            None => self.image.new_output(rows, columns)?,
        };
        let mut write = out.write()?;
        let mut outs = write.views::<T>()?;
        detached::run(py, || warp(&views[0], mapping, &mut outs[0], &options))?;
        drop(outs);
        drop(write);
        Ok(self.out.given_or(out))
    }
}
