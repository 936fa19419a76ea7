//! Depth images to points.

use nalgebra::Matrix3;

use super::kernels::{self, PinholePoints, PinholeRays, Planar, PointsRow, Rotate, Unit};
use super::rays::{self, PixelRays, Viewpoint};
use crate::camera::Camera;
use crate::error::{CloudError, Error, Result, ViewError};
use crate::geometry::Pose;
use crate::isa::Isa;
use crate::parallel::{self, Work};
use crate::view::buffer;
use crate::view::{DepthSample, ImageView, ImageViewMut, PointSample};

/// What a depth image measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum DepthKind {
    /// z of the camera frame, as depth cameras and simulators give it.
    #[default]
    Planar,
    /// The distance from the optical centre, along the ray.
    Ray,
}

/// How a depth image is read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthOptions {
    /// What it measures.
    pub kind: DepthKind,
    /// Metres per unit.
    pub scale: f64,
    /// What is nearer is cut; metres, as the image measures.
    pub min_depth: f64,
    /// What is farther is cut; likewise. What is infinite is cut always.
    pub max_depth: f64,
    /// Every so many-th row and column, from the first.
    pub stride: usize,
    /// At most how many threads; `None` is [`num_threads`](crate::num_threads).
    pub threads: Option<usize>,
}

impl Default for DepthOptions {
    fn default() -> Self {
        let (scale, min_depth, max_depth) = (1.0, 0.0, f64::INFINITY);
        Self { kind: DepthKind::default(), scale, min_depth, max_depth, stride: 1, threads: None }
    }
}

impl DepthOptions {
    fn check(&self) -> Result<()> {
        let refuse = |what, expected, got| Err(Error::Cloud(CloudError::DepthLimit { what, expected, got }));
        if !(self.scale > 0.0 && self.scale.is_finite()) {
            return refuse("depth_scale", "a positive number of metres per unit", self.scale);
        }
        if !(self.min_depth >= 0.0 && self.min_depth.is_finite()) {
            return refuse("min_depth", "metres from 0", self.min_depth);
        }
        if self.max_depth.is_nan() || self.max_depth <= self.min_depth {
            return refuse("max_depth", "metres above min_depth", self.max_depth);
        }
        if self.stride == 0 {
            return refuse("stride", "at least 1", 0.0);
        }
        Ok(())
    }
}

/// A depth image, row by row: an [`ImageView`] of one channel, or what becomes one on the way, as
/// [`CarlaDepth`](super::CarlaDepth).
pub trait DepthRows: Sync {
    /// What it measures in.
    type Sample: DepthSample;

    /// (width, height).
    fn size(&self) -> (usize, usize);

    /// Numbers of a pixel; only one will do.
    fn channels(&self) -> usize;

    /// The numbers of row y; `room` has as many, and may be used for them. An instruction set that the CPU lacks is the
    /// plain one.
    ///
    /// # Panics
    /// Where there is no such row, or no such room.
    fn row<'r>(&'r self, isa: Isa, y: usize, room: &'r mut [Self::Sample]) -> &'r [Self::Sample];
}

impl<T: DepthSample> DepthRows for ImageView<'_, T> {
    type Sample = T;

    fn size(&self) -> (usize, usize) {
        (self.width(), self.height())
    }

    fn channels(&self) -> usize {
        ImageView::channels(self)
    }

    fn row<'r>(&'r self, _: Isa, y: usize, _: &'r mut [T]) -> &'r [T] {
        let start = self.row_start(y);
        &self.data()[start..start + self.width()]
    }
}

/// (width, height) of the points of a depth image of that size.
pub fn points_size((width, height): (usize, usize), stride: usize) -> (usize, usize) {
    (width.div_ceil(stride.max(1)), height.div_ceil(stride.max(1)))
}

/// Back-projects a depth image of one channel: `out` has a point of three numbers for each pixel, or each `stride`-th of
/// each `stride`-th row, in the frame that `frame_from_camera` leads to from the optical one. A point is NaN where its
/// depth is not positive, not finite or outside the limits, where the mask is 0, and where the lens sees nothing.
///
/// # Errors
/// [`CloudError::DepthLimit`], [`CloudError::DepthSize`], [`CloudError::DepthChannels`], [`CloudError::MaskSize`],
/// [`CloudError::TooManyPoints`], [`ViewError::OutputShape`], [`ThreadsError::Zero`](crate::error::ThreadsError::Zero),
/// [`IsaError`](crate::error::IsaError) and [`Error::OutOfMemory`], before anything is written.
pub fn points_from_depth_into<'a, D: DepthRows, O: PointSample>(
    depth: &D,
    viewpoint: impl Into<Viewpoint<'a>>,
    frame_from_camera: &Pose,
    mask: Option<&ImageView<'_, u8>>,
    options: &DepthOptions,
    out: &mut ImageViewMut<'_, O>,
) -> Result<()> {
    let job = Job::new(depth, viewpoint.into(), frame_from_camera, mask, options)?;
    let (width, height) = job.size;
    if out.shape() != (height, width, 3) {
        return Err(Error::View(ViewError::OutputShape { expected: (height, width, 3), got: out.shape() }));
    }
    let band = parallel::rows_per_band(height, width, job.threads);
    parallel::for_each(job.threads, out.bands(band), |(first, rows)| {
        let mut row = job.row()?;
        for (y, out) in (first..).zip(rows) {
            job.points(y, &mut row, out);
        }
        Ok(())
    })
}

/// The points of a depth image, without the pixels that have none.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct DepthCloud<O> {
    /// Row by row of the image, from left to right.
    pub points: Vec<[O; 3]>,
    /// `y * width + x` of the pixel of each point.
    pub index: Vec<i64>,
}

/// Back-projects the pixels of a depth image that [`points_from_depth_into`] has a point for.
///
/// # Errors
/// Those of [`points_from_depth_into`].
pub fn cloud_from_depth<'a, D: DepthRows, O: PointSample>(
    depth: &D,
    viewpoint: impl Into<Viewpoint<'a>>,
    frame_from_camera: &Pose,
    mask: Option<&ImageView<'_, u8>>,
    options: &DepthOptions,
) -> Result<DepthCloud<O>> {
    let job = Job::new(depth, viewpoint.into(), frame_from_camera, mask, options)?;
    let (width, height) = job.size;
    let mut cloud = DepthCloud {
        points: buffer::filled("points", width * height, [O::default(); 3])?,
        index: buffer::filled("index", width * height, 0)?,
    };
    // each band has room for all of its pixels; then what they left empty is closed
    let rows = parallel::rows_per_band(height, width, job.threads);
    let mut counts = buffer::zeroed("points", height.div_ceil(rows))?;
    let bands = cloud.points.chunks_mut(rows * width).zip(cloud.index.chunks_mut(rows * width)).zip(&mut counts);
    parallel::for_each(job.threads, bands.enumerate(), |(band, ((points, index), count))| {
        *count = job.cloud(band * rows, points, index)?;
        Ok(())
    })?;
    let mut end = 0;
    for (band, count) in counts.into_iter().enumerate() {
        let (start, count) = (band * rows * width, count as usize);
        if start != end {
            cloud.points.copy_within(start..start + count, end);
            cloud.index.copy_within(start..start + count, end);
        }
        end += count;
    }
    cloud.points.truncate(end);
    cloud.index.truncate(end);
    cloud.points.shrink_to_fit();
    cloud.index.shrink_to_fit();
    Ok(cloud)
}

/// A depth image with all that turns it into points, checked.
struct Job<'a, D> {
    depth: &'a D,
    camera: &'a Camera,
    table: Option<&'a PixelRays>,
    mask: Option<&'a ImageView<'a, u8>>,
    options: &'a DepthOptions,
    limits: (f64, f64),
    /// None for the optical frame.
    rotation: Option<[[f64; 3]; 3]>,
    origin: [f64; 3],
    isa: Isa,
    threads: usize,
    /// (width, height) of the points.
    size: (usize, usize),
}

/// What a row is worked out in.
struct Row<T> {
    rays: [Vec<f64>; 3],
    /// x of the rays with z = 1, if it is the same in all rows; else empty.
    columns: Vec<f64>,
    /// Room for a row of the depth image.
    whole: Vec<T>,
    /// Every `stride`-th number of it, where that is not every one.
    depth: Vec<T>,
}

impl<'a, D: DepthRows> Job<'a, D> {
    fn new(
        depth: &'a D,
        Viewpoint { camera, rays }: Viewpoint<'a>,
        frame_from_camera: &Pose,
        mask: Option<&'a ImageView<'a, u8>>,
        options: &'a DepthOptions,
    ) -> Result<Self> {
        options.check()?;
        for channels in [Some(depth.channels()), mask.map(ImageView::channels)].into_iter().flatten() {
            if channels != 1 {
                return Err(Error::Cloud(CloudError::DepthChannels { expected: 1, got: channels }));
            }
        }
        let got = depth.size();
        let expected = (camera.image_size().0 as usize, camera.image_size().1 as usize);
        if got != expected {
            return Err(Error::Cloud(CloudError::DepthSize { expected, got }));
        }
        if let Some(mask) = mask
            && (mask.width(), mask.height()) != got
        {
            return Err(Error::Cloud(CloudError::MaskSize { expected: got, got: (mask.width(), mask.height()) }));
        }
        let size = points_size(got, options.stride);
        super::check_points("depth", size)?;
        let rotation = frame_from_camera.rotation();
        Ok(Self {
            depth,
            camera,
            table: rays,
            mask,
            options,
            limits: (options.min_depth, options.max_depth.min(f64::MAX)),
            rotation: (rotation != &Matrix3::identity()).then(|| super::rows(rotation)),
            origin: (*frame_from_camera.translation()).into(),
            isa: Isa::active()?,
            threads: Work::bytes(got.0 * got.1 * 16).threads(options.threads)?,
            size,
        })
    }

    fn row(&self) -> Result<Row<D::Sample>> {
        let axis = || buffer::zeroed("points", self.size.0);
        let mut row = Row {
            rays: [axis()?, axis()?, axis()?],
            columns: Vec::new(),
            whole: buffer::zeroed("points", self.depth.size().0)?,
            depth: buffer::reserved("points", self.size.0)?,
        };
        let intrinsics = super::intrinsics(self.camera);
        let plain = self.table.is_none() && self.camera.lens().is_none() && self.options.kind == DepthKind::Planar;
        if plain && intrinsics[4] == 0.0 {
            // without skew the row makes no difference to x
            self.pinhole_rays(0, &mut row.rays);
            std::mem::swap(&mut row.columns, &mut row.rays[0]);
        }
        Ok(row)
    }

    /// The rays of a pinhole with z = 1.
    fn pinhole_rays(&self, y: usize, rays: &mut [Vec<f64>; 3]) {
        let (columns, row) = ((0.0, self.options.stride as f64), y as f64);
        let intrinsics = super::intrinsics(self.camera);
        kernels::run(self.isa, PinholeRays { columns, row, intrinsics, rays: slices(rays) });
    }

    /// Fills `out` with the points of row y of the result.
    fn points<O: PointSample>(&self, y: usize, row: &mut Row<D::Sample>, out: &mut [O]) {
        let stride = self.options.stride;
        let samples = self.depth.row(self.isa, y * stride, &mut row.whole);
        let depth = if stride == 1 {
            samples
        } else {
            row.depth.clear();
            row.depth.extend(samples.iter().step_by(stride));
            &row.depth
        };
        let (scale, limits, origin) = (self.options.scale, self.limits, self.origin);
        if row.columns.is_empty() {
            self.rays(y * stride, &mut row.rays);
            let [xs, ys, zs] = &row.rays;
            kernels::run(self.isa, PointsRow { depth, scale, limits, rays: [xs, ys, zs], origin, out });
        } else {
            let [_, fy, _, cy, _] = super::intrinsics(self.camera);
            let (columns, y, rotation) = (&row.columns[..], ((y * stride) as f64 - cy) / fy, self.rotation);
            kernels::run(self.isa, PinholePoints { depth, scale, limits, columns, y, rotation, origin, out });
        }
        let Some(mask) = self.mask else { return };
        let start = mask.row_start(y * stride);
        let mask = mask.data()[start..start + mask.width()].iter().step_by(stride);
        for (point, &keep) in out.chunks_exact_mut(3).zip(mask) {
            if keep == 0 {
                point.fill(O::from_f64(f64::NAN));
            }
        }
    }

    /// The rays of the pixels of image row y in the result's frame: of length 1, or with z = 1 in the camera frame.
    fn rays(&self, y: usize, rays: &mut [Vec<f64>; 3]) {
        let stride = self.options.stride;
        match (self.table, self.camera.lens()) {
            (Some(table), _) => table.copy_row(y, stride, slices(rays)),
            (None, Some(_)) => rays::fill(self.camera, y, stride, slices(rays)),
            (None, None) => self.pinhole_rays(y, rays),
        }
        match self.options.kind {
            DepthKind::Ray => kernels::run(self.isa, Unit(slices(rays))),
            DepthKind::Planar if self.camera.lens().is_some() => kernels::run(self.isa, Planar(slices(rays))),
            DepthKind::Planar => {} // a pinhole's have z = 1
        }
        if let Some(rotation) = self.rotation {
            kernels::run(self.isa, Rotate { rays: slices(rays), rotation });
        }
    }

    /// The points of the result's rows from `first` on, as many rows as there is room for, brought together at the front.
    /// Returns how many points they are.
    fn cloud<O: PointSample>(&self, first: usize, points: &mut [[O; 3]], index: &mut [i64]) -> Result<u64> {
        let (width, stride) = (self.size.0, self.options.stride);
        let mut row = self.row()?;
        let mut organised = buffer::filled("points", width, [O::default(); 3])?;
        let mut count = 0;
        for y in first..first + points.len() / width {
            self.points(y, &mut row, organised.as_flattened_mut());
            let start = (y * stride * self.depth.size().0) as i64;
            // without a branch: which pixels have a point is hard to guess where depth is noise
            for (x, &point) in organised.iter().enumerate() {
                points[count] = point;
                index[count] = start + (x * stride) as i64;
                count += usize::from(!point[2].to_f64().is_nan());
            }
        }
        Ok(count as u64)
    }
}

fn slices([xs, ys, zs]: &mut [Vec<f64>; 3]) -> [&mut [f64]; 3] {
    [xs, ys, zs]
}
