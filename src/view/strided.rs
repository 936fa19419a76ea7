//! A borrowed table of numbers, checked once: the rows of an image, points, or the values that they carry.

use crate::error::{Error, Result, ViewError};

/// How many numbers a table reaches before its first one, and how many behind it; `None` beyond what can be addressed.
///
/// Entries lie on lines, so the corners bound all others: this is the one place that knows it, and every view, of ours
/// or of an array of Python's, rests on it.
pub fn reach((rows, columns): (usize, usize), strides: (isize, isize)) -> Option<(usize, usize)> {
    let (mut before, mut behind) = (0u128, 0u128);
    if rows > 0 && columns > 0 {
        for (count, stride) in [(rows, strides.0), (columns, strides.1)] {
            // below 2^63 * 2^63 each, so that no sum overflows
            let steps = isize::try_from(count - 1).ok()? as u128;
            let far = steps * stride.unsigned_abs() as u128;
            *(if stride < 0 { &mut before } else { &mut behind }) += far;
        }
    }
    Some((usize::try_from(before).ok()?, usize::try_from(behind).ok()?))
}

/// Whether a table whose first number is number `start` of a buffer lies within it.
pub(super) fn lies_within(length: usize, shape: (usize, usize), start: usize, strides: (isize, isize)) -> bool {
    let empty = shape.0 == 0 || shape.1 == 0;
    let inside = |(before, behind)| before <= start && start.checked_add(behind).is_some_and(|last| last < length);
    empty || reach(shape, strides).is_some_and(inside)
}

/// Numbers in rows and columns with any strides, also zero (a value that stands for many) and negative.
#[derive(Debug, Clone, Copy)]
pub struct Strided<'a, T> {
    data: &'a [T],
    rows: usize,
    columns: usize,
    /// Index of row 0, column 0.
    start: usize,
    row_stride: isize,
    column_stride: isize,
}

impl<'a, T> Strided<'a, T> {
    /// Rows of `columns` numbers, one after the other.
    ///
    /// # Errors
    /// [`ViewError::PointTable`] where the data is no whole number of rows.
    pub fn new(data: &'a [T], columns: usize) -> Result<Self> {
        let rows = data.len().checked_div(columns).unwrap_or(0);
        if rows * columns != data.len() {
            return Err(Error::View(ViewError::PointTable { rows, columns, length: data.len() }));
        }
        Self::with_strides(data, (rows, columns), 0, (columns as isize, 1))
    }

    /// Rows and columns of which number (i, j) is `data[start + i * strides.0 + j * strides.1]`.
    ///
    /// # Errors
    /// [`ViewError::PointTable`] where a number would lie outside the data.
    pub fn with_strides(
        data: &'a [T],
        (rows, columns): (usize, usize),
        start: usize,
        (row_stride, column_stride): (isize, isize),
    ) -> Result<Self> {
        if !lies_within(data.len(), (rows, columns), start, (row_stride, column_stride)) {
            return Err(Error::View(ViewError::PointTable { rows, columns, length: data.len() }));
        }
        Ok(Self { data, rows, columns, start, row_stride, column_stride })
    }

    /// How many rows.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// How many columns.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// The numbers between which all of the table lie.
    #[inline(always)]
    pub(super) fn data(&self) -> &'a [T] {
        self.data
    }

    /// Index of the first number of a row.
    #[inline(always)]
    pub(super) fn row_start(&self, row: usize) -> usize {
        self.start.wrapping_add_signed((row as isize).wrapping_mul(self.row_stride))
    }

    /// Numbers from one row to the next.
    #[inline(always)]
    pub(super) fn row_stride(&self) -> isize {
        self.row_stride
    }

    /// The first `K` numbers of a row.
    ///
    /// # Panics
    /// Where there is no such row, or not so many numbers in it.
    #[inline]
    pub(crate) fn first<const K: usize>(&self, row: usize) -> [T; K]
    where
        T: Copy,
    {
        assert!(row < self.rows && K <= self.columns, "{K} numbers of row {row} of {} x {}", self.rows, self.columns);
        std::array::from_fn(|column| self.get(row, column))
    }

    /// One column of it, as a table.
    pub(crate) fn column(&self, column: usize) -> Self {
        assert!(column < self.columns);
        let start = self.start.wrapping_add_signed(column as isize * self.column_stride);
        Self { columns: 1, start, ..*self }
    }

    /// Number (row, column).
    #[inline]
    pub(crate) fn get(&self, row: usize, column: usize) -> T
    where
        T: Copy,
    {
        let offset = row as isize * self.row_stride + column as isize * self.column_stride;
        self.data[self.start.wrapping_add_signed(offset)]
    }

    /// The rows from `first` on as arrays of `K` adjacent numbers, where there are no gaps and that is what they are.
    #[inline]
    pub(crate) fn packed<const K: usize>(&self, first: usize, count: usize) -> Option<&'a [[T; K]]> {
        if self.row_stride != K as isize || self.column_stride != 1 || self.columns > K || count == 0 {
            return None;
        }
        // the last row may end before its K numbers do, so the slice is cut to what is there
        let begin = self.start + first * K;
        let (whole, _) = self.data.get(begin..)?.as_chunks::<K>();
        whole.get(..count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_strides_within_the_data() {
        let data: Vec<u16> = (0..12).collect();
        let plain = Strided::new(&data, 4).unwrap();
        assert_eq!((plain.rows(), plain.columns(), plain.get(2, 3)), (3, 4, 11));
        assert_eq!(plain.packed::<4>(1, 2), Some(&[[4, 5, 6, 7], [8, 9, 10, 11]][..]));
        assert_eq!(plain.packed::<3>(0, 1), None);
        assert_eq!(plain.column(2).get(1, 0), 6);
        assert_eq!((plain.first::<2>(1), plain.row_start(1)), ([4, 5], 4));
        let backwards = Strided::with_strides(&data, (3, 4), 11, (-4, -1)).unwrap();
        assert_eq!((backwards.get(0, 0), backwards.get(2, 3)), (11, 0));
        let repeated = Strided::with_strides(&data, (usize::MAX >> 2, 2), 3, (0, 5)).unwrap();
        assert_eq!(repeated.get(usize::MAX >> 3, 1), 8);
        // a column of a wider table, whose last row has no end
        let part = Strided::with_strides(&data, (3, 3), 1, (4, 1)).unwrap();
        assert_eq!(part.packed::<4>(0, 2), Some(&[[1, 2, 3, 4], [5, 6, 7, 8]][..]));
        assert_eq!(part.packed::<4>(0, 3), None);
        assert_eq!(Strided::<f32>::new(&[], 3).unwrap().rows(), 0);
    }

    #[test]
    fn the_reach_of_a_table() {
        assert_eq!(reach((3, 4), (4, 1)), Some((0, 11)));
        assert_eq!(reach((3, 4), (-4, 1)), Some((8, 3)));
        assert_eq!(reach((3, 4), (-4, -1)), Some((11, 0)));
        assert_eq!(reach((usize::MAX, 0), (isize::MAX, isize::MIN)), Some((0, 0)));
        let half = isize::MAX as usize + 1;
        assert_eq!(reach((half, 2), (1, isize::MAX)), Some((0, usize::MAX - 1)));
        assert_eq!(reach((half, 3), (1, isize::MAX)), None);
        assert_eq!(reach((half + 1, 1), (0, 0)), None);
        assert_eq!(reach((half, half), (isize::MIN, isize::MIN)), None);
    }

    #[test]
    fn refuses_numbers_outside_the_data() {
        let data = [0f32; 12];
        for (shape, start, strides) in [
            ((4, 4), 0, (4, 1)),
            ((3, 4), 1, (4, 1)),
            ((3, 4), 0, (-4, 1)),
            ((usize::MAX, 1), 0, (1, 1)),
            ((usize::MAX, 1), 0, (0, 0)),
            ((2, 2), 0, (isize::MAX, isize::MAX)),
            ((1, 1), 12, (0, 0)),
        ] {
            let got = Strided::with_strides(&data, shape, start, strides);
            assert!(matches!(got, Err(Error::View(ViewError::PointTable { .. }))), "{shape:?} {start} {strides:?}");
        }
        assert!(Strided::new(&data, 5).is_err() && Strided::new(&data, 0).is_err());
    }
}
