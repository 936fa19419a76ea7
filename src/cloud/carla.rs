//! CARLA's colour-coded depth: 24 bits, red the least significant byte.
//!
//! `normalized = (R + 256 G + 65536 B) / (256^3 - 1)`, `metres = 1000 normalized`: planar depth (z of the camera), in
//! steps of 0.06 mm. Source: CARLA's documentation of the depth camera.

use super::back_project::DepthRows;
use super::kernels::{self, Decode, Encode};
use crate::error::{CloudError, Error, Result, ViewError};
use crate::isa::Isa;
use crate::parallel::{self, Work};
use crate::view::{ImageView, ImageViewMut, PointSample};

/// The largest code, 256^3 - 1.
const LARGEST: f64 = 16_777_215.0;

/// Metres of the largest code: the far plane, and what the sky has.
const FAR: f64 = 1000.0;

/// The order of the channels of a colour image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ChannelOrder {
    /// CARLA's own buffers.
    Bgra,
    /// Pillow, `imageio`.
    Rgba,
    /// OpenCV.
    Bgr,
    /// Pillow, `imageio`.
    Rgb,
}

impl ChannelOrder {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Bgra, Self::Rgba, Self::Bgr, Self::Rgb];

    /// Its name, lower case.
    pub fn name(self) -> &'static str {
        match self {
            Self::Bgra => "bgra",
            Self::Rgba => "rgba",
            Self::Bgr => "bgr",
            Self::Rgb => "rgb",
        }
    }

    /// 3 or 4.
    pub fn channels(self) -> usize {
        match self {
            Self::Bgra | Self::Rgba => 4,
            Self::Bgr | Self::Rgb => 3,
        }
    }
}

/// What a decoded number means.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum DepthUnit {
    /// Metres, 0 to 1000.
    #[default]
    Metres,
    /// 0 to 1.
    Normalized,
}

impl DepthUnit {
    /// The number of the largest code.
    fn largest(self) -> f64 {
        match self {
            Self::Metres => FAR,
            Self::Normalized => 1.0,
        }
    }
}

/// Decodes an image of 3 or 4 channels into one of float32. Every value is the exact one rounded once.
///
/// # Errors
/// [`CloudError::DepthChannels`], [`ViewError::OutputShape`], [`ThreadsError::Zero`](crate::error::ThreadsError::Zero)
/// and [`IsaError`](crate::error::IsaError), before anything is written.
pub fn decode_carla_depth_into(
    image: &ImageView<'_, u8>,
    order: ChannelOrder,
    unit: DepthUnit,
    out: &mut ImageViewMut<'_, f32>,
    threads: Option<usize>,
) -> Result<()> {
    if image.channels() != order.channels() {
        return Err(Error::Cloud(CloudError::DepthChannels { expected: order.channels(), got: image.channels() }));
    }
    let expected = (image.height(), image.width(), 1);
    if out.shape() != expected {
        return Err(Error::View(ViewError::OutputShape { expected, got: out.shape() }));
    }
    let (isa, threads) = (Isa::active()?, Work::bytes(image.width() * image.height() * 8).threads(threads)?);
    let band = parallel::rows_per_band(image.height(), image.width(), threads);
    parallel::for_each(threads, out.bands(band), |(first, rows)| {
        for (y, out) in (first..).zip(rows) {
            decode_row(isa, image, order, unit, y, out);
        }
        Ok(())
    })
}

/// Decodes row y.
fn decode_row(isa: Isa, image: &ImageView<'_, u8>, order: ChannelOrder, unit: DepthUnit, y: usize, out: &mut [f32]) {
    let (scale, start) = (unit.largest() / LARGEST, image.row_start(y));
    let pixels = &image.data()[start..start + image.width() * image.channels()];
    match order {
        ChannelOrder::Bgra => kernels::run(isa, Decode::<4, false> { pixels, scale, out }),
        ChannelOrder::Rgba => kernels::run(isa, Decode::<4, true> { pixels, scale, out }),
        ChannelOrder::Bgr => kernels::run(isa, Decode::<3, false> { pixels, scale, out }),
        ChannelOrder::Rgb => kernels::run(isa, Decode::<3, true> { pixels, scale, out }),
    }
}

/// A colour-coded image as depth in metres, decoded row by row where it is used: what [`decode_carla_depth_into`] gives, to the
/// bit, and nothing of it is stored.
#[derive(Debug, Clone, Copy)]
pub struct CarlaDepth<'a> {
    image: &'a ImageView<'a, u8>,
    order: ChannelOrder,
}

impl<'a> CarlaDepth<'a> {
    /// An image of 3 or 4 channels.
    ///
    /// # Errors
    /// [`CloudError::DepthChannels`].
    pub fn new(image: &'a ImageView<'a, u8>, order: ChannelOrder) -> Result<Self> {
        if image.channels() != order.channels() {
            return Err(Error::Cloud(CloudError::DepthChannels { expected: order.channels(), got: image.channels() }));
        }
        Ok(Self { image, order })
    }
}

impl DepthRows for CarlaDepth<'_> {
    type Sample = f32;

    fn size(&self) -> (usize, usize) {
        (self.image.width(), self.image.height())
    }

    fn channels(&self) -> usize {
        1 // once decoded
    }

    fn row<'r>(&'r self, isa: Isa, y: usize, room: &'r mut [f32]) -> &'r [f32] {
        decode_row(isa.or_scalar(), self.image, self.order, DepthUnit::Metres, y, room);
        room
    }
}

/// Encodes depth as a colour image, alpha 255: the nearest code, and the largest one for all that is farther than it
/// can say, as CARLA's sky.
///
/// # Errors
/// [`CloudError::DepthChannels`], [`ViewError::OutputShape`], [`ThreadsError::Zero`](crate::error::ThreadsError::Zero)
/// and [`IsaError`](crate::error::IsaError) before anything is written; [`CloudError::NegativeDepth`] where a number is
/// negative or NaN, after.
pub fn encode_carla_depth_into<T: PointSample>(
    depth: &ImageView<'_, T>,
    order: ChannelOrder,
    unit: DepthUnit,
    out: &mut ImageViewMut<'_, u8>,
    threads: Option<usize>,
) -> Result<()> {
    if depth.channels() != 1 {
        return Err(Error::Cloud(CloudError::DepthChannels { expected: 1, got: depth.channels() }));
    }
    let expected = (depth.height(), depth.width(), order.channels());
    if out.shape() != expected {
        return Err(Error::View(ViewError::OutputShape { expected, got: out.shape() }));
    }
    let (isa, threads) = (Isa::active()?, Work::bytes(depth.width() * depth.height() * 8).threads(threads)?);
    let scale = LARGEST / unit.largest();
    let valid = std::sync::atomic::AtomicBool::new(true);
    let band = parallel::rows_per_band(depth.height(), depth.width(), threads);
    parallel::for_each(threads, out.bands(band), |(first, rows)| {
        for (y, out) in (first..).zip(rows) {
            let start = depth.row_start(y);
            let numbers = &depth.data()[start..start + depth.width()];
            let fine = match order {
                ChannelOrder::Bgra => kernels::run(isa, Encode::<T, 4, false> { numbers, scale, out }),
                ChannelOrder::Rgba => kernels::run(isa, Encode::<T, 4, true> { numbers, scale, out }),
                ChannelOrder::Bgr => kernels::run(isa, Encode::<T, 3, false> { numbers, scale, out }),
                ChannelOrder::Rgb => kernels::run(isa, Encode::<T, 3, true> { numbers, scale, out }),
            };
            if !fine {
                valid.store(false, std::sync::atomic::Ordering::Relaxed);
            }
        }
        Ok(())
    })?;
    if valid.into_inner() {
        return Ok(());
    }
    let pixels = (0..depth.height()).flat_map(|y| (0..depth.width()).map(move |x| (x, y)));
    let wrong = |&(x, y): &(usize, usize)| {
        let number = depth.pixel(x, y)[0].to_f64();
        number.is_nan() || number < 0.0
    };
    // another thread may have mended the image meanwhile: then there is nothing to complain about but the race
    let (x, y) = pixels.clone().find(wrong).unwrap_or_default();
    Err(Error::Cloud(CloudError::NegativeDepth { got: depth.pixel(x, y)[0].to_f64(), row: y, column: x }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decoded(image: &[u8], order: ChannelOrder, unit: DepthUnit) -> Vec<f32> {
        let pixels = image.len() / order.channels();
        let mut out = vec![0.0; pixels];
        let image = ImageView::new(image, (pixels, 1), order.channels()).unwrap();
        let mut view = ImageViewMut::new(&mut out, (pixels, 1), 1).unwrap();
        decode_carla_depth_into(&image, order, unit, &mut view, Some(1)).unwrap();
        out
    }

    #[test]
    fn fifty_metres() {
        for (order, bytes) in [
            (ChannelOrder::Bgra, &[12, 204, 205, 255][..]),
            (ChannelOrder::Rgba, &[205, 204, 12, 0]),
            (ChannelOrder::Bgr, &[12, 204, 205]),
            (ChannelOrder::Rgb, &[205, 204, 12]),
        ] {
            assert_eq!(decoded(bytes, order, DepthUnit::Metres), [50.000_015]);
        }
    }

    #[test]
    fn every_code_is_the_exact_value_rounded_once() {
        let codes = 0..1u32 << 24;
        let image: Vec<u8> = codes.clone().flat_map(u32::to_le_bytes).collect();
        for unit in [DepthUnit::Metres, DepthUnit::Normalized] {
            let exact = codes.clone().map(|code| (f64::from(code) / LARGEST * unit.largest()) as f32);
            assert!(decoded(&image, ChannelOrder::Rgba, unit).into_iter().eq(exact), "{unit:?}");
        }
    }

    #[test]
    fn every_code_survives_the_way_there_and_back() {
        let image: Vec<u8> = (0..1u32 << 24).flat_map(|code| (code | 0xff00_0000).to_le_bytes()).collect();
        let size = (1 << 12, 1 << 12);
        let numbers = decoded(&image, ChannelOrder::Rgba, DepthUnit::Normalized);
        let numbers = ImageView::new(&numbers, size, 1).unwrap();
        let mut out = vec![0; image.len()];
        let mut view = ImageViewMut::new(&mut out, size, 4).unwrap();
        encode_carla_depth_into(&numbers, ChannelOrder::Rgba, DepthUnit::Normalized, &mut view, Some(2)).unwrap();
        assert!(out == image);
    }

    #[test]
    fn what_has_no_code() {
        let mut out = [0u8; 6];
        let mut encode = |depth: [f64; 2]| {
            let depth = ImageView::new(&depth, (2, 1), 1).unwrap();
            let mut view = ImageViewMut::new(&mut out, (2, 1), 3).unwrap();
            encode_carla_depth_into(&depth, ChannelOrder::Rgb, DepthUnit::Metres, &mut view, Some(1)).map(|()| out)
        };
        assert_eq!(encode([1e9, f64::INFINITY]), Ok([255; 6]));
        assert_eq!(encode([-0.0, 1000.0 / LARGEST]), Ok([0, 0, 0, 1, 0, 0]));
        assert_eq!(
            encode([1.0, -1e-9]),
            Err(Error::Cloud(CloudError::NegativeDepth { got: -1e-9, row: 0, column: 1 }))
        );
        assert!(matches!(
            encode([f64::NAN, 1.0]),
            Err(Error::Cloud(CloudError::NegativeDepth { row: 0, column: 0, .. }))
        ));
    }
}
