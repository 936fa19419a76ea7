//! Borrowed points: rows of coordinates, checked once.

use crate::error::{Error, Result};

/// Points as rows of at least three numbers (x, y, z, whatever else), any number of them, any stride between them.
#[derive(Debug, Clone, Copy)]
pub struct PointsView<'a, T> {
    data: &'a [T],
    count: usize,
    /// Index of the first number of point 0.
    origin: usize,
    /// Numbers from one point to the next.
    stride: isize,
    /// Numbers of a point.
    columns: usize,
}

impl<'a, T> PointsView<'a, T> {
    /// Points one after the other, `columns` numbers to each.
    ///
    /// # Errors
    /// [`Error::PointsBuffer`] where `columns` is below 3 or the data is no whole number of points.
    pub fn new(data: &'a [T], columns: usize) -> Result<Self> {
        let count = data.len().checked_div(columns).unwrap_or(0);
        if count * columns != data.len() {
            return Err(Error::PointsBuffer { count, columns, stride: columns as isize, length: data.len() });
        }
        Self::with_stride(data, count, columns, 0, columns as isize)
    }

    /// Points of which the i-th begins at `data[origin + i * stride]`.
    ///
    /// # Errors
    /// [`Error::PointsBuffer`].
    pub fn with_stride(data: &'a [T], count: usize, columns: usize, origin: usize, stride: isize) -> Result<Self> {
        let refuse = Error::PointsBuffer { count, columns, stride, length: data.len() };
        if columns < 3 {
            return Err(refuse);
        }
        if count > 0 {
            let far = (count as i128 - 1) * stride as i128;
            let first = origin as i128 + far.min(0);
            let end = origin as i128 + far.max(0) + columns as i128;
            if first < 0 || end > data.len() as i128 || count > isize::MAX as usize {
                return Err(refuse);
            }
        }
        Ok(Self { data, count, origin, stride, columns })
    }

    /// How many points.
    pub fn len(&self) -> usize {
        self.count
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Numbers of a point.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// The numbers of point i.
    ///
    /// # Panics
    /// Where there is no such point.
    #[inline]
    pub fn row(&self, i: usize) -> &'a [T] {
        assert!(i < self.count, "point {i} of {}", self.count);
        let start = self.origin.wrapping_add_signed((i as isize).wrapping_mul(self.stride));
        &self.data[start..start + self.columns]
    }

    /// Points `first..first + count` as an array of arrays, where they lie so: `S` numbers from one to the next, of the
    /// last one too.
    pub(crate) fn chunks<const S: usize>(&self, first: usize, count: usize) -> Option<&'a [[T; S]]> {
        if self.stride != S as isize || self.columns > S {
            return None;
        }
        let start = self.origin + first * S;
        Some(self.data.get(start..start + count * S)?.as_chunks().0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_may_run_backwards_repeat_or_skip() {
        let data: Vec<u16> = (0..12).collect();
        let whole = PointsView::new(&data, 4).unwrap();
        assert_eq!((whole.len(), whole.row(2)), (3, &data[8..12]));
        let backwards = PointsView::with_stride(&data, 3, 3, 8, -4).unwrap();
        assert_eq!((backwards.row(0), backwards.row(2)), (&data[8..11], &data[0..3]));
        assert_eq!(backwards.chunks::<4>(0, 2), None);
        let repeated = PointsView::with_stride(&data, 100, 3, 9, 0).unwrap();
        assert_eq!(repeated.row(99), &data[9..12]);
        assert_eq!(whole.chunks::<4>(1, 2).map(<[_]>::as_flattened), Some(&data[4..12]));
        assert_eq!(whole.chunks::<3>(0, 1), None);
        let narrow = PointsView::with_stride(&data[..11], 3, 3, 0, 4).unwrap();
        assert!(narrow.chunks::<4>(0, 2).is_some() && narrow.chunks::<4>(0, 3).is_none(), "the last lacks a number");
        assert!(PointsView::<u16>::new(&[], 3).unwrap().is_empty());
    }

    #[test]
    fn refuses_points_outside_the_buffer() {
        let data = [0f32; 12];
        for (count, columns, origin, stride) in
            [(4, 3, 1, 3), (3, 2, 0, 3), (3, 3, 1, -1), (usize::MAX, 3, 0, 1), (2, 3, 0, isize::MAX), (1, 3, 10, 3)]
        {
            let got = PointsView::with_stride(&data, count, columns, origin, stride);
            assert!(matches!(got, Err(Error::PointsBuffer { .. })), "{count} {columns} {origin} {stride}");
        }
        assert!(PointsView::new(&data, 5).is_err() && PointsView::new(&data, 0).is_err());
    }
}
