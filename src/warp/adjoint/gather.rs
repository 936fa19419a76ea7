//! Sums over the cells that look at the entries of a row: plain loops over channels side by side, which become vectors.

use super::transposed::{LooksOfRow, Weight};
use crate::isa::Body;
use crate::view::PointSample;

/// `N` neighbouring channels of cells: sample `cell * stride + first` and those that follow.
#[derive(Clone, Copy)]
pub(super) struct Cells<'a, T> {
    pub(super) data: &'a [T],
    pub(super) stride: usize,
    pub(super) first: usize,
}

/// Takes the sums of the entries of a row.
pub(super) trait Put<const N: usize> {
    fn put(&mut self, column: usize, sums: [f64; N]);
}

/// The sums of `N` channels of all entries of a row that some cell looks at. Each channel has its own sum, in the order of the
/// cells, so no instruction set and no number of channels at once changes a bit.
pub(super) struct Gather<'a, T, W: Copy, P, const N: usize> {
    pub(super) looks: LooksOfRow<'a, W>,
    pub(super) cells: Cells<'a, T>,
    pub(super) put: P,
}

impl<T: PointSample, W: Weight, P: Put<N>, const N: usize> Body for Gather<'_, T, W, P, N> {
    type Output = ();

    #[inline(always)]
    fn run(mut self) {
        let Cells { data, stride, first } = self.cells;
        for (column, looks) in self.looks.each() {
            let mut sums = [0.0; N];
            for look in looks {
                let weight = { look.weight }.value();
                let from: &[T; N] =
                    data[look.cell as usize * stride + first..].first_chunk().expect("channels of a cell");
                for channel in 0..N {
                    sums[channel] += weight * from[channel].to_f64();
                }
            }
            self.put.put(column, sums);
        }
    }
}

/// A row of pixels of so many channels each, of which `N` from the `first` on are written.
pub(super) struct Interleaved<'a, T> {
    pub(super) row: &'a mut [T],
    pub(super) channels: usize,
    pub(super) first: usize,
}

impl<T: PointSample, const N: usize> Put<N> for Interleaved<'_, T> {
    #[inline(always)]
    fn put(&mut self, column: usize, sums: [f64; N]) {
        let to: &mut [T; N] =
            self.row[column * self.channels + self.first..].first_chunk_mut().expect("channels of a pixel");
        *to = sums.map(T::from_f64);
    }
}

/// A row of each of `N` planes.
pub(super) struct Planar<'a, T, const N: usize>(pub(super) [&'a mut [T]; N]);

impl<T: PointSample, const N: usize> Put<N> for Planar<'_, T, N> {
    #[inline(always)]
    fn put(&mut self, column: usize, sums: [f64; N]) {
        for (row, sum) in self.0.iter_mut().zip(sums) {
            row[column] = T::from_f64(sum);
        }
    }
}

/// Rows of planes side by side: sample i of plane p becomes sample `i * N + p`.
pub(super) struct Pack<'a, T, const N: usize> {
    pub(super) planes: [&'a [T]; N],
    pub(super) packed: &'a mut [T],
}

impl<T: PointSample, const N: usize> Body for Pack<'_, T, N> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let cells = self.planes[0].len();
        let planes = self.planes.map(|plane| &plane[..cells]);
        let packed = self.packed.as_chunks_mut::<N>().0;
        for (i, packed) in packed[..cells].iter_mut().enumerate() {
            for plane in 0..N {
                packed[plane] = planes[plane][i];
            }
        }
    }
}
