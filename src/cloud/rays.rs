//! The rays of a camera's pixels, worked out once.

use crate::camera::Camera;
use crate::error::Result;
use crate::parallel::{self, Work};
use crate::view::buffer;

/// Where each pixel of a camera looks, for many depth images behind one lens: 24 bytes a pixel. A pinhole's rays need no
/// table, they are as quickly computed as read.
#[derive(Debug, Clone, PartialEq)]
pub struct PixelRays {
    camera: Camera,
    /// x, y, z of each pixel in the optical frame, any length; NaN where the lens sees nothing.
    rays: [Vec<f64>; 3],
}

impl PixelRays {
    /// The rays of every pixel.
    ///
    /// # Errors
    /// [`CloudError::TooManyPoints`](crate::error::CloudError::TooManyPoints),
    /// [`ThreadsError::Zero`](crate::error::ThreadsError::Zero) and [`Error::OutOfMemory`](crate::Error::OutOfMemory).
    pub fn new(camera: &Camera, threads: Option<usize>) -> Result<Self> {
        let (width, height) = (camera.image_size().0 as usize, camera.image_size().1 as usize);
        super::check_points("camera", (width, height))?;
        let threads = Work::bytes(width * height * 256).threads(threads)?;
        let column = || buffer::zeroed("rays", width * height);
        let mut rays = [column()?, column()?, column()?];
        let [xs, ys, zs] = &mut rays;
        let rows = xs.chunks_mut(width).zip(ys.chunks_mut(width)).zip(zs.chunks_mut(width));
        parallel::for_each(threads, rows.enumerate(), |(y, ((xs, ys), zs))| {
            fill(camera, y, 1, [xs, ys, zs]);
            Ok(())
        })?;
        Ok(Self { camera: *camera, rays })
    }

    /// The camera that they are the rays of.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Bytes of the table.
    pub fn nbytes(&self) -> usize {
        self.rays.iter().map(|column| size_of_val(&column[..])).sum()
    }

    /// Every `stride`-th ray of row y.
    pub(super) fn copy_row(&self, y: usize, stride: usize, out: [&mut [f64]; 3]) {
        let width = self.camera.image_size().0 as usize;
        for (column, out) in self.rays.iter().zip(out) {
            let row = &column[y * width..(y + 1) * width];
            if stride == 1 {
                out.copy_from_slice(row);
            } else {
                out.iter_mut().zip(row.iter().step_by(stride)).for_each(|(out, &ray)| *out = ray);
            }
        }
    }
}

/// Fills in the rays of every `stride`-th pixel of row y.
pub(super) fn fill(camera: &Camera, y: usize, stride: usize, [xs, ys, zs]: [&mut [f64]; 3]) {
    for (i, x) in (0..camera.image_size().0 as usize).step_by(stride).enumerate() {
        let ray = camera.ray([x as f64, y as f64]);
        [xs[i], ys[i], zs[i]] = ray.map_or([f64::NAN; 3], Into::into);
    }
}

/// What looks at a depth image: a camera, or one whose rays are known.
#[derive(Debug, Clone, Copy)]
pub struct Viewpoint<'a> {
    pub(super) camera: &'a Camera,
    pub(super) rays: Option<&'a PixelRays>,
}

impl<'a> From<&'a Camera> for Viewpoint<'a> {
    fn from(camera: &'a Camera) -> Self {
        Self { camera, rays: None }
    }
}

impl<'a> From<&'a PixelRays> for Viewpoint<'a> {
    fn from(rays: &'a PixelRays) -> Self {
        Self { camera: rays.camera(), rays: Some(rays) }
    }
}
