//! The arithmetic contract, and the choice of kernels.
//!
//! A kernel fills neighbouring cells of one output row from their taps. All kernels of one dtype agree to the last bit,
//! so no machine, thread count or batch changes an answer:
//!
//! * `u8`: four Q15 weights that sum to 32768, `(sum + 2^14) >> 15`; ties round up. Within 0.52 grey level of the exact
//!   value (0.5 of rounding, the rest from the table's Q15 fractions).
//! * `f32`: `a + (b - a) fx` along the rows, then between them, nothing fused; within 2^-14 of the range of the four
//!   pixels, and a constant image stays constant. NaN or infinity in any of the four pixels gives NaN or infinity.
//! * `u16`: the same in float32, then `+ 0.5` and truncated; within 3 of 65535 of the exact value, 2 of which are the
//!   table's fractions.
//! * nearest copies pixels.

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
#[cfg(target_arch = "aarch64")]
mod neon;
mod plane;
mod scalar;
mod special;

#[cfg(target_arch = "x86_64")]
pub(crate) use avx512::boxes_u8;

use crate::cpu::Isa;
use crate::image::{ImageView, Sample, as_bytes, as_bytes_mut};
use crate::lut::area::Block;
use crate::lut::area::block::Size;
use crate::lut::table::{ONE, Tap};

/// What a kernel reads: the image and the border value of each channel.
pub(crate) struct Source<'a, T> {
    image: &'a ImageView<'a, T>,
    border: &'a [T],
    /// The byte that the border value consists of, if it is but one: that of zero, and of any grey of 8 bits.
    border_byte: Option<u8>,
}

impl<'a, T: Sample> Source<'a, T> {
    /// `border` has one value for each channel.
    pub(crate) fn new(image: &'a ImageView<'a, T>, border: &'a [T]) -> Self {
        debug_assert_eq!(border.len(), image.channels());
        let bytes = as_bytes(border);
        let border_byte = bytes.first().copied().filter(|&first| bytes.iter().all(|&byte| byte == first));
        Self { image, border, border_byte }
    }

    pub(crate) fn channels(&self) -> usize {
        self.border.len()
    }

    pub(crate) fn image(&self) -> &'a ImageView<'a, T> {
        self.image
    }

    /// A value for each channel.
    pub(crate) fn border(&self) -> &'a [T] {
        self.border
    }

    /// Writes the border value into whole cells.
    pub(crate) fn fill_border(&self, cells: &mut [T]) {
        if let Some(byte) = self.border_byte {
            // the C library's memset; 0.8 million cells of three bytes take 0.10 ms, by copying 0.17 ms
            return as_bytes_mut(cells).fill(byte);
        }
        if let [value] = *self.border {
            return cells.fill(value);
        }
        // one cell, then as many as are written already: cell by cell took longer than blending the others where few cells see the image
        let mut written = self.border.len();
        cells[..written].copy_from_slice(self.border);
        while written < cells.len() {
            let more = written.min(cells.len() - written);
            cells.copy_within(..more, written);
            written += more;
        }
    }

    /// A pixel, or the border value where there is none.
    fn pixel_or_border(&self, x: i64, y: i64) -> &'a [T] {
        let inside = |at: i64, size: usize| usize::try_from(at).ok().filter(|&at| at < size);
        match (inside(x, self.image.width()), inside(y, self.image.height())) {
            (Some(x), Some(y)) => self.image.pixel(x, y),
            _ => self.border,
        }
    }
}

/// Fills neighbouring cells from their taps; `cells` holds `taps.len() * channels` samples.
pub(crate) type RowKernel<T> = fn(&Source<'_, T>, &[Tap], &mut [T]);

/// Neighbouring footprints that are averaged alike, and where their probes lie: at centre + along a + down d, for each
/// of the offsets a along one side of the footprint and d along the other.
pub(crate) struct Probes<'a> {
    /// Where each cell samples, on a source of this width: as [`RunKind::Inside`](crate::lut::table::RunKind) says.
    pub(crate) taps: &'a [Tap],
    pub(crate) source_width: u32,
    /// What the sides of their footprints are.
    pub(crate) blocks: &'a [Block],
    pub(crate) size: Size,
    /// Half rows from their middle to the row of the footprints.
    pub(crate) half_rows: i16,
    /// So many cells of the first block come before those that are asked for.
    pub(crate) skip: usize,
    /// The offsets along each side, in 1/16384 of it.
    pub(crate) offsets: [&'a [i16]; 2],
    /// Products of sides and offsets are 1/1024 pixel after shifting right by so much.
    pub(crate) shift: u32,
    /// What the first entry of the image to look at is from pixel (0, 0), 1/1024 pixel.
    pub(crate) origin: [i32; 2],
    /// log2 of the pixels from entry to entry of the image.
    pub(crate) steps: [u32; 2],
    /// Whether the average is rounded as [`Average::finish`](crate::warp::area::Average::finish) says.
    pub(crate) lean: bool,
}

impl Probes<'_> {
    /// Probes of a footprint: at most 256.
    pub(crate) fn count(&self) -> u32 {
        (self.offsets[0].len() * self.offsets[1].len()) as u32
    }
}

/// Fills neighbouring cells with the averages of their probes, all of whose pixels exist.
pub(crate) type ProbesKernel<T> = fn(&Source<'_, T>, &Probes<'_>, &mut [T]);

/// The kernels of one warp.
pub(crate) struct RowKernels<T> {
    /// For cells whose four pixels all exist.
    pub(crate) inside: RowKernel<T>,
    /// For cells on the rim and in the halo.
    pub(crate) edge: RowKernel<T>,
}

impl<T: Sample> RowKernels<T> {
    /// Nearest.
    pub(crate) fn nearest(isa: Isa, channels: usize, contiguous: bool) -> Self {
        let special = special::nearest(isa, channels * size_of::<T>());
        Self {
            inside: special.unwrap_or_else(|| Self::nearest_scalar(channels, contiguous)),
            edge: match channels {
                1 => scalar::nearest_edge::<T, 1>,
                3 => scalar::nearest_edge::<T, 3>,
                _ => scalar::nearest_edge::<T, 0>,
            },
        }
    }

    fn nearest_scalar(channels: usize, contiguous: bool) -> RowKernel<T> {
        match (channels, contiguous) {
            (1, true) => scalar::nearest::<T, 1, true>,
            (3, true) => scalar::nearest::<T, 3, true>,
            (4, true) => scalar::nearest::<T, 4, true>,
            (_, true) => scalar::nearest::<T, 0, true>,
            (_, false) => scalar::nearest::<T, 0, false>,
        }
    }
}

impl<T: Bilinear> RowKernels<T> {
    /// Bilinear.
    pub(crate) fn bilinear(isa: Isa, channels: usize, contiguous: bool) -> Self {
        let inside = T::special(isa, channels).unwrap_or_else(|| Self::bilinear_scalar(channels, contiguous));
        let edge = match channels {
            1 => scalar::bilinear_edge::<T, 1>,
            3 => scalar::bilinear_edge::<T, 3>,
            _ => scalar::bilinear_edge::<T, 0>,
        };
        Self { inside, edge }
    }

    fn bilinear_scalar(channels: usize, contiguous: bool) -> RowKernel<T> {
        match (channels, contiguous) {
            (1, true) => scalar::bilinear::<T, 1, true>,
            (3, true) => scalar::bilinear::<T, 3, true>,
            (4, true) => scalar::bilinear::<T, 4, true>,
            (_, true) => scalar::bilinear::<T, 0, true>,
            (_, false) => scalar::bilinear::<T, 0, false>,
        }
    }
}

/// A sample that can be blended: `u8`, `u16` and `f32`.
pub trait Bilinear: Sample + sealed::Blend + super::area::Average {}

impl Bilinear for u8 {}
impl Bilinear for u16 {}
impl Bilinear for f32 {}

pub(crate) mod sealed {
    use super::{Isa, ProbesKernel, RowKernel};

    /// The arithmetic of one dtype; see the module's contract.
    pub trait Blend: Sized {
        /// What is worked out once for all channels of a cell.
        type Weights: Copy;

        /// From the Q15 fractions along x and y, both below 2^15.
        fn weights(fx: u32, fy: u32) -> Self::Weights;

        /// The kernel of an instruction set for images of so many channels, if it has one.
        #[expect(private_interfaces, reason = "sealed: nobody outside can call it")]
        fn special(isa: Isa, channels: usize) -> Option<RowKernel<Self>>;

        /// The kernel that averages probes, likewise: faster than a kernel for each and a sum.
        #[expect(private_interfaces, reason = "sealed: nobody outside can call it")]
        fn probes(_isa: Isa, _channels: usize) -> Option<ProbesKernel<Self>> {
            None
        }

        /// Four samples (top left, top right, bottom left, bottom right) to one.
        fn blend(weights: Self::Weights, taps: [Self; 4]) -> Self;
    }
}

impl sealed::Blend for u8 {
    #[expect(private_interfaces, reason = "sealed: nobody outside can call it")]
    fn special(isa: Isa, channels: usize) -> Option<RowKernel<u8>> {
        special::bilinear_u8(isa, channels)
    }

    #[expect(private_interfaces, reason = "sealed: nobody outside can call it")]
    fn probes(isa: Isa, channels: usize) -> Option<ProbesKernel<u8>> {
        special::probes_u8(isa, channels)
    }

    /// Q15, they sum to 32768.
    type Weights = [u32; 4];

    #[inline(always)]
    fn weights(fx: u32, fy: u32) -> [u32; 4] {
        let both = (fx * fy + (ONE >> 1)) >> 15;
        [ONE + both - fx - fy, fx - both, fy - both, both]
    }

    #[inline(always)]
    fn blend(weights: [u32; 4], taps: [u8; 4]) -> u8 {
        let sum: u32 = weights.iter().zip(taps).map(|(&weight, tap)| weight * u32::from(tap)).sum();
        ((sum + (ONE >> 1)) >> 15) as u8
    }
}

impl sealed::Blend for u16 {
    #[expect(private_interfaces, reason = "sealed: nobody outside can call it")]
    fn special(isa: Isa, channels: usize) -> Option<RowKernel<u16>> {
        special::bilinear_u16(isa, channels)
    }

    type Weights = (f32, f32);

    #[inline(always)]
    fn weights(fx: u32, fy: u32) -> (f32, f32) {
        f32::weights(fx, fy)
    }

    #[inline(always)]
    fn blend(weights: (f32, f32), taps: [u16; 4]) -> u16 {
        (f32::blend(weights, taps.map(f32::from)) + 0.5) as u16
    }
}

impl sealed::Blend for f32 {
    #[expect(private_interfaces, reason = "sealed: nobody outside can call it")]
    fn special(isa: Isa, channels: usize) -> Option<RowKernel<f32>> {
        special::bilinear_f32(isa, channels)
    }

    type Weights = (f32, f32);

    #[inline(always)]
    fn weights(fx: u32, fy: u32) -> (f32, f32) {
        // exact: 15 bits and a power of two
        (fx as f32 * (1.0 / ONE as f32), fy as f32 * (1.0 / ONE as f32))
    }

    #[inline(always)]
    fn blend((fx, fy): (f32, f32), taps: [f32; 4]) -> f32 {
        let top = taps[0] + (taps[1] - taps[0]) * fx;
        let bottom = taps[2] + (taps[3] - taps[2]) * fx;
        top + (bottom - top) * fy
    }
}

#[cfg(test)]
mod tests {
    use super::sealed::Blend;
    use super::*;

    #[test]
    fn u8_weights_sum_to_one_and_ties_round_up() {
        for fx in (0..ONE).step_by(97) {
            for fy in (0..ONE).step_by(89) {
                assert_eq!(u8::weights(fx, fy).iter().sum::<u32>(), ONE);
            }
        }
        assert_eq!(u8::blend(u8::weights(ONE / 2, 0), [100, 101, 0, 0]), 101);
    }

    #[test]
    fn errors_stay_within_the_contract() {
        let exact = |taps: [f64; 4], x: f64, y: f64| {
            let top = taps[0] + (taps[1] - taps[0]) * x;
            top + (taps[2] + (taps[3] - taps[2]) * x - top) * y
        };
        // the worst a table does to a coordinate is half a Q15 step either way
        let corners8 = [[0u8, 255, 255, 0], [255, 0, 0, 255], [0, 255, 0, 255], [255, 255, 0, 0], [17, 203, 99, 4]];
        let corners16 = corners8.map(|taps| taps.map(|tap| u16::from(tap) * 257));
        let (mut worst8, mut worst16): (f64, f64) = (0.0, 0.0);
        for fx in (0..ONE).step_by(331) {
            for fy in (0..ONE).step_by(337) {
                for (dx, dy) in [(0.0, 0.0), (0.5, 0.5), (-0.5, 0.5), (0.5, -0.5), (-0.5, -0.5)] {
                    let (x, y) = ((f64::from(fx) + dx) / 32768.0, (f64::from(fy) + dy) / 32768.0);
                    for taps in corners8 {
                        let got = f64::from(u8::blend(u8::weights(fx, fy), taps));
                        worst8 = worst8.max((got - exact(taps.map(f64::from), x, y)).abs());
                    }
                    for taps in corners16 {
                        let got = f64::from(u16::blend(u16::weights(fx, fy), taps));
                        worst16 = worst16.max((got - exact(taps.map(f64::from), x, y)).abs());
                    }
                    for taps in corners16.map(|taps| taps.map(f32::from)) {
                        let got = f64::from(f32::blend(f32::weights(fx, fy), taps));
                        assert!((got - exact(taps.map(f64::from), x, y)).abs() <= 65535.0 / 16384.0);
                    }
                }
            }
        }
        assert!(worst8 < 0.52, "{worst8}");
        assert!(worst16 < 3.0, "{worst16}");
    }

    #[test]
    fn constants_stay_constant() {
        for fx in (0..ONE).step_by(251) {
            for fy in (0..ONE).step_by(257) {
                for value in [0u8, 1, 128, 255] {
                    assert_eq!(u8::blend(u8::weights(fx, fy), [value; 4]), value);
                    let wide = u16::from(value) * 257;
                    assert_eq!(u16::blend(u16::weights(fx, fy), [wide; 4]), wide);
                    let real = f32::from(value) * 1.1;
                    assert_eq!(f32::blend(f32::weights(fx, fy), [real; 4]), real);
                }
            }
        }
    }
}
