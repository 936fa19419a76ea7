//! Where between their four pixels cells lie: in Q15 as a table says it, or exactly.

#[cfg(target_arch = "x86_64")]
use std::ops::Range;

use super::sealed::Blend;
use super::{ExactKernel, Source, scalar, scalar_kernels, special};
use crate::isa::Isa;
use crate::kernels::{Fraction, split};
use crate::table::Tap;

/// What a kernel needs to know of neighbouring cells.
pub(super) trait Places<T: Blend>: Copy {
    /// Where their top-left pixels are.
    fn taps(&self) -> &[Tap];

    /// The weights of one cell.
    fn weights(&self, cell: usize) -> T::Weights;

    /// The fractions of `N` cells from `first` on along x and y, where they are not those of the taps. A constant to the
    /// compiler, so kernels may ask for each group of cells.
    fn floats<const N: usize>(&self, first: usize) -> Option<[&[f32; N]; 2]>;

    /// Some of the cells.
    #[cfg(target_arch = "x86_64")]
    fn part(self, cells: Range<usize>) -> Self;
}

impl<T: Blend> Places<T> for &[Tap] {
    #[inline(always)]
    fn taps(&self) -> &[Tap] {
        self
    }

    #[inline(always)]
    fn weights(&self, cell: usize) -> T::Weights {
        T::weights(self[cell].fx(), self[cell].fy())
    }

    #[inline(always)]
    fn floats<const N: usize>(&self, _first: usize) -> Option<[&[f32; N]; 2]> {
        None
    }

    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    fn part(self, cells: Range<usize>) -> Self {
        &self[cells]
    }
}

/// Taps whose own fractions are not looked at, and exact ones for as many cells.
#[derive(Clone, Copy)]
pub(crate) struct Exact<'a, F> {
    taps: &'a [Tap],
    x: &'a [F],
    y: &'a [F],
}

impl<F: Float, T: Blend<Weights = (F, F)>> Places<T> for Exact<'_, F> {
    #[inline(always)]
    fn taps(&self) -> &[Tap] {
        self.taps
    }

    #[inline(always)]
    fn weights(&self, cell: usize) -> (F, F) {
        (self.x[cell], self.y[cell])
    }

    #[inline(always)]
    fn floats<const N: usize>(&self, first: usize) -> Option<[&[f32; N]; 2]> {
        let floats = |axis| F::floats(axis)?.get(first..)?.first_chunk();
        Some([floats(self.x)?, floats(self.y)?])
    }

    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    fn part(self, cells: Range<usize>) -> Self {
        Self { taps: &self.taps[cells.clone()], x: &self.x[cells.clone()], y: &self.y[cells] }
    }
}

/// A fraction that samples are blended with.
pub(crate) trait Float: Fraction {
    /// Themselves if they are float32, for kernels of samples that are blended in it.
    fn floats(fractions: &[Self]) -> Option<&[f32]>;
}

impl Float for f32 {
    #[inline(always)]
    fn floats(fractions: &[f32]) -> Option<&[f32]> {
        Some(fractions)
    }
}

impl Float for f64 {
    #[inline(always)]
    fn floats(_: &[f64]) -> Option<&[f32]> {
        None
    }
}

/// A float that is blended by fractions of kind `F`.
pub(crate) trait ExactBlend<F: Float>: Blend<Weights = (F, F)> {
    /// As [`Blend::special`].
    fn exact(isa: Isa, channels: usize) -> Option<ExactKernel<Self, F>>;
}

impl ExactBlend<f32> for crate::view::F16 {
    fn exact(isa: Isa, channels: usize) -> Option<ExactKernel<Self, f32>> {
        special::compiled_exact(isa, channels)
    }
}

impl ExactBlend<f32> for f32 {
    fn exact(isa: Isa, channels: usize) -> Option<ExactKernel<Self, f32>> {
        special::exact_f32(isa, channels)
    }
}

impl ExactBlend<f64> for f64 {
    fn exact(isa: Isa, channels: usize) -> Option<ExactKernel<Self, f64>> {
        special::compiled_exact(isa, channels)
    }
}

/// So many cells are blended at once, and up to twice as many at the end of a run, which leaves no rest that is too short
/// for vectors. Their taps and fractions are 8 KB at most.
const BLOCK: usize = 256;

/// The kernels of a warp of floats without a table.
pub(crate) struct ExactKernels<T, F> {
    isa: Isa,
    channels: usize,
    inside: ExactKernel<T, F>,
}

impl<F: Float, T: ExactBlend<F>> ExactKernels<T, F> {
    pub(crate) fn new(isa: Isa, channels: usize, contiguous: bool) -> Self {
        let inside: ExactKernel<T, F> = match T::exact(isa, channels) {
            Some(kernel) => kernel,
            None => scalar_kernels!(T, channels, contiguous),
        };
        Self { isa, channels, inside }
    }

    /// Fills neighbouring cells at these coordinates, whose four pixels exist: not below 0, and below the last pixel.
    pub(crate) fn inside(&self, source: &Source<'_, T>, [us, vs]: [&[f64]; 2], cells: &mut [T]) {
        let mut taps = [Tap::default(); 2 * BLOCK];
        let (mut x, mut y) = ([F::default(); 2 * BLOCK], [F::default(); 2 * BLOCK]);
        let mut first = 0;
        while first < us.len() {
            let left = us.len() - first;
            let count = if left < 2 * BLOCK { left } else { BLOCK };
            let own = first..first + count;
            let (taps, x, y) = (&mut taps[..count], &mut x[..count], &mut y[..count]);
            split(self.isa, [&us[own.clone()], &vs[own.clone()]], source.image.width(), taps, [&mut *x, &mut *y]);
            let cells = &mut cells[own.start * self.channels..own.end * self.channels];
            (self.inside)(source, Exact { taps, x, y }, cells);
            first += count;
        }
    }

    /// Fills neighbouring cells on the rim and in the halo.
    pub(crate) fn edge(&self, source: &Source<'_, T>, coordinates: [&[f64]; 2], cells: &mut [T]) {
        scalar::exact_edge(source, coordinates, cells);
    }
}
