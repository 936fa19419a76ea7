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
//! * `i8`, `i16`: those of `u8` and `u16` for values that are larger by half the range, so ties round up here too.
//! * `f16`: that of `f32`, rounded once to the nearest half, ties to even.
//! * `f64`: that of `f32` in float64.
//! * nearest copies pixels.
//! * cubic and Lanczos: see [`wide`].
//!
//! Warps without a table know coordinates exactly. Kernels of floats take the fractions as they are ([`Exact`]), and what
//! is left is the rounding of the arithmetic itself; those of integers take them in Q15, as a table has them.

mod aligned;
pub(crate) mod average;
#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod blend;
mod halve;
#[cfg(target_arch = "aarch64")]
mod neon;
mod places;
mod plane;
mod rounding;
mod runs;
mod scalar;
mod special;
mod split;
mod unpack;
pub(crate) mod wide;
mod widen;

pub(crate) use aligned::Row;
pub(crate) use average::Average;
pub(crate) use blend::sealed;
use blend::sealed::Blend;
pub(crate) use places::{Exact, ExactBlend, ExactKernels, Float};
pub(crate) use rounding::{Kinds, Sampled, quantise_one};
pub(crate) use runs::equal_runs;
pub(crate) use split::{Fraction, split};
pub(crate) use unpack::{FRACTION_BITS, unpack};
pub(crate) use widen::widen;

use crate::isa::Isa;
use crate::table::block::Block;
use crate::table::block::Size;
use crate::table::{BorderMode, SpanKind, Tap};
use crate::view::{ImageView, Sample, as_bytes, as_bytes_mut};

/// What a kernel reads: the image and the border value of each channel.
pub(crate) struct Source<'a, T> {
    image: &'a ImageView<'a, T>,
    border: &'a [T],
    /// What lies beyond the image along x and along y.
    edges: [BorderMode; 2],
    /// Whether cells that are not valid keep what they hold.
    keeps: bool,
    /// The byte that the border value consists of, if it is but one: that of zero, and of any grey of 8 bits.
    border_byte: Option<u8>,
}

impl<'a, T: Sample> Source<'a, T> {
    /// `border` has one value for each channel.
    pub(crate) fn new(image: &'a ImageView<'a, T>, border: &'a [T]) -> Self {
        debug_assert_eq!(border.len(), image.channels());
        let bytes = as_bytes(border);
        let border_byte = bytes.first().copied().filter(|&first| bytes.iter().all(|&byte| byte == first));
        Self { image, border, edges: [BorderMode::Constant; 2], keeps: false, border_byte }
    }

    /// The same image, with that beyond it along x and along y.
    pub(crate) fn with_edges(self, edges: [BorderMode; 2]) -> Self {
        Self { edges, ..self }
    }

    /// The same image, for cells that keep what they hold where they are not valid; the border value then has no part in
    /// those that are.
    pub(crate) fn transparent(self) -> Self {
        let edges = self.edges.map(|mode| if mode.repeats() { mode } else { BorderMode::Transparent });
        Self { edges, keeps: true, ..self }
    }

    /// Whether cells that are not valid keep what they hold.
    #[inline(always)]
    pub(crate) fn keeps(&self) -> bool {
        self.keeps
    }

    #[inline(always)]
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

    /// Writes the border value into whole cells, if it is not that they keep what they hold.
    pub(crate) fn fill_border(&self, cells: &mut [T]) {
        if self.keeps {
            return;
        }
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

    /// A pixel, or what stands for it beyond the image: another one, or the border value.
    fn pixel_or_border(&self, x: i64, y: i64) -> &'a [T] {
        let [across, down] = self.edges;
        match (across.pixel(x, self.image.width()), down.pixel(y, self.image.height())) {
            (Some(x), Some(y)) => self.image.pixel(x, y),
            _ => self.border,
        }
    }
}

/// Fills neighbouring cells from their taps; `cells` holds `taps.len() * channels` samples.
pub(crate) type RowKernel<T> = fn(&Source<'_, T>, &[Tap], &mut [T]);

/// Fills neighbouring cells from their nearest pixels, counted as `y * width + x`, of an image whose rows are back to back.
pub(crate) type CopyKernel<T> = fn(&Source<'_, T>, &[u32], &mut [T]);

/// Fills neighbouring cells of as many outputs as there are images, all of one channel and of rows that are back to back.
pub(crate) type PlanesKernel<T> = fn(&[Source<'_, T>; 4], &[Tap], [&mut [T]; 4]);

/// Fills neighbouring cells from exact coordinates, whose fractions are of kind `F`.
pub(crate) type ExactKernel<T, F> = fn(&Source<'_, T>, Exact<'_, F>, &mut [T]);

/// Neighbouring footprints that are averaged alike, and where their probes lie: at centre + along a + down d, for each
/// of the offsets a along one side of the footprint and d along the other.
pub(crate) struct Probes<'a> {
    /// Where each cell samples, on a source of this width: as [`SpanKind::Inside`](crate::table::SpanKind) says.
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
    /// Whether the average is rounded as [`Average::finish`] says.
    pub(crate) round_bias: bool,
}

impl Probes<'_> {
    /// Probes of a footprint: at most 256.
    pub(crate) fn count(&self) -> u32 {
        (self.offsets[0].len() * self.offsets[1].len()) as u32
    }
}

/// Fills neighbouring cells with the averages of their probes, all of whose pixels exist.
pub(crate) type ProbesKernel<T> = fn(&Source<'_, T>, &Probes<'_>, &mut [T]);

/// The scalar kernel of bilinear for images of so many channels, for taps of either kind.
macro_rules! scalar_kernels {
    ($type:ty, $channels:expr, $contiguous:expr) => {
        match ($channels, $contiguous) {
            (1, true) => |source, places, cells| scalar::bilinear::<$type, _, 1, true>(source, places, cells),
            (3, true) => |source, places, cells| scalar::bilinear::<$type, _, 3, true>(source, places, cells),
            (4, true) => |source, places, cells| scalar::bilinear::<$type, _, 4, true>(source, places, cells),
            (_, true) => |source, places, cells| scalar::bilinear::<$type, _, 0, true>(source, places, cells),
            (_, false) => |source, places, cells| scalar::bilinear::<$type, _, 0, false>(source, places, cells),
        }
    };
}
use scalar_kernels;

/// The kernels of one warp.
pub(crate) struct RowKernels<T> {
    /// For cells whose four pixels all exist.
    pub(crate) inside: RowKernel<T>,
    /// For cells on the rim and in the halo.
    pub(crate) edge: RowKernel<T>,
    /// Instead of `inside` where a table has the nearest pixels as numbers; none where that is no gain.
    pub(crate) copy: Option<CopyKernel<T>>,
    /// Instead of `inside` for several images at once; none where that is no gain.
    pub(crate) planes: Option<PlanesKernel<T>>,
}

impl<T: Sample> RowKernels<T> {
    /// Fills neighbouring cells of one kind, those outside with the border value.
    #[inline]
    pub(crate) fn fill(&self, kind: SpanKind, source: &Source<'_, T>, taps: &[Tap], cells: &mut [T]) {
        match kind {
            SpanKind::Outside => source.fill_border(cells),
            SpanKind::Inside => (self.inside)(source, taps, cells),
            SpanKind::Halo if source.keeps() => {}
            SpanKind::Rim | SpanKind::Halo => (self.edge)(source, taps, cells),
        }
    }

    /// Nearest.
    pub(crate) fn nearest(isa: Isa, channels: usize, contiguous: bool) -> Self {
        let special = special::nearest(isa, channels * size_of::<T>());
        Self {
            inside: special.unwrap_or_else(|| Self::nearest_scalar(channels, contiguous)),
            planes: None,
            copy: if contiguous { special::copy(isa, channels * size_of::<T>()) } else { None },
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

impl<T: Blend> RowKernels<T> {
    /// Bilinear.
    pub(crate) fn bilinear(isa: Isa, channels: usize, contiguous: bool) -> Self {
        let inside: RowKernel<T> = match T::special(isa, channels) {
            Some(kernel) => kernel,
            None => scalar_kernels!(T, channels, contiguous),
        };
        let edge = match channels {
            1 => scalar::bilinear_edge::<T, 1>,
            3 => scalar::bilinear_edge::<T, 3>,
            _ => scalar::bilinear_edge::<T, 0>,
        };
        let planes = if channels == 1 && contiguous { T::planes(isa) } else { None };
        Self { inside, edge, copy: None, planes }
    }
}

impl<T: wide::Wide> RowKernels<T> {
    /// Weighted sums of `N x N` pixels: [`wide::CUBIC`] or [`wide::LANCZOS4`].
    pub(crate) fn wide<const N: usize>(isa: Isa, channels: usize) -> Self {
        Self { inside: wide::inside::<T, N>(isa, channels), edge: wide::edge::<T, N>, copy: None, planes: None }
    }
}
