//! A warp turned round: for each pixel the cells that look at it.

use crate::error::{Error, Result};
use crate::table::{ONE, SpanKind, Table, Tap, unframed};
use crate::view::buffer;

/// What memory is asked for, in errors.
pub(super) const WHAT: &str = "the transposed Lut";

/// How much of an entry is in a cell.
pub(super) trait Weight: Copy + Default + Send + Sync {
    fn value(self) -> f64;
}

/// Q30: the exact product of two Q15 fractions.
impl Weight for u32 {
    #[inline(always)]
    fn value(self) -> f64 {
        f64::from(self) * (1.0 / (1u64 << 30) as f64)
    }
}

/// Of area, where a product is divided by the number of probes.
impl Weight for f64 {
    #[inline(always)]
    fn value(self) -> f64 {
        self
    }
}

/// A cell that looks at an entry. Packed: of area a look has 12 bytes instead of 16, and each pass reads all of them.
#[derive(Clone, Copy, Default)]
#[repr(C, packed(4))]
pub(super) struct Look<W: Copy> {
    /// `row * columns + column` of the cell.
    pub(super) cell: u32,
    pub(super) weight: W,
}

/// An entry that some cell looks at.
#[derive(Clone, Copy, Default)]
pub(super) struct Touched {
    pub(super) column: u32,
    /// Where its looks end; they begin where those of the one before end.
    end: u32,
}

/// For each entry the cells that look at it, in the order of the cells. Entries are the pixels of the source and, of area,
/// those of the levels: planes of rows.
pub(super) struct Transposed<W: Copy> {
    /// The number of each plane's first row among all rows.
    first_rows: Vec<usize>,
    /// Where the entries of each row end.
    ends: Vec<u32>,
    touched: Vec<Touched>,
    looks: Vec<Look<W>>,
}

/// What is found: a plane, the column and row of its entry, and a cell that looks at it.
pub(super) type Found<'a, W> = &'a mut dyn FnMut(usize, [usize; 2], Look<W>);

impl<W: Weight> Transposed<W> {
    /// `planes` are the columns and rows of each; `each` finds all looks in the order of the cells, and the same ones when it
    /// is called again.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`] and those of `each`.
    pub(super) fn new(planes: &[[usize; 2]], each: impl Fn(Found<'_, W>) -> Result<()>) -> Result<Self> {
        let (mut firsts, mut first_rows, mut entries, mut rows) = (vec![], vec![], 0, 0);
        for [columns, plane_rows] in planes {
            firsts.push(entries);
            first_rows.push(rows);
            (entries, rows) = (entries + columns * plane_rows, rows + plane_rows);
        }
        let entry = |plane: usize, [x, y]: [usize; 2]| firsts[plane] + y * planes[plane][0] + x;
        let mut ends: Vec<u32> = buffer::zeroed(WHAT, entries)?;
        let mut count = 0usize;
        each(&mut |plane, at, _| {
            // a table has fewer cells than 2^32, and a cell looks at an entry once
            ends[entry(plane, at)] += 1;
            count += 1;
        })?;
        if u32::try_from(count).is_err() {
            return Err(Error::OutOfMemory { what: WHAT, bytes: count.saturating_mul(size_of::<Look<W>>()) });
        }
        let mut begin = 0;
        for end in &mut ends {
            (*end, begin) = (begin, begin + *end); // for now where its looks begin
        }
        let mut looks = buffer::filled(WHAT, count, Look::default())?;
        each(&mut |plane, at, look| {
            let end = &mut ends[entry(plane, at)];
            looks[*end as usize] = look;
            *end += 1; // and, when all are there, where they end
        })?;
        let mut table = Self { first_rows, ends: buffer::reserved(WHAT, rows)?, touched: vec![], looks };
        let (mut rest, mut begin) = (&*ends, 0);
        for row in planes.iter().flat_map(|&[columns, rows]| std::iter::repeat_n(columns, rows)) {
            let own;
            (own, rest) = rest.split_at(row);
            for (column, &end) in (0..).zip(own) {
                if end > begin {
                    buffer::push(WHAT, &mut table.touched, Touched { column, end })?;
                    begin = end;
                }
            }
            table.ends.push(table.touched.len() as u32);
        }
        table.touched.shrink_to_fit();
        Ok(table)
    }

    pub(super) fn nbytes(&self) -> usize {
        size_of_val(&*self.first_rows)
            + size_of_val(&*self.ends)
            + size_of_val(&*self.touched)
            + size_of_val(&*self.looks)
    }

    /// The entries of a row of a plane that some cell looks at.
    pub(super) fn row(&self, plane: usize, row: usize) -> LooksOfRow<'_, W> {
        let index = self.first_rows[plane] + row;
        let begin = if index == 0 { 0 } else { self.ends[index - 1] as usize };
        let first_look = if begin == 0 { 0 } else { self.touched[begin - 1].end };
        LooksOfRow { first_look, touched: &self.touched[begin..self.ends[index] as usize], looks: &self.looks }
    }
}

/// The entries of a row that some cell looks at.
#[derive(Clone, Copy)]
pub(super) struct LooksOfRow<'a, W: Copy> {
    first_look: u32,
    touched: &'a [Touched],
    looks: &'a [Look<W>],
}

impl<'a, W: Weight> LooksOfRow<'a, W> {
    /// Each with its looks, from left to right.
    #[inline(always)]
    pub(super) fn each(self) -> impl Iterator<Item = (usize, &'a [Look<W>])> {
        let mut begin = self.first_look;
        self.touched.iter().map(move |&Touched { column, end }| {
            let looks = &self.looks[begin as usize..end as usize];
            begin = end;
            (column as usize, looks)
        })
    }
}

/// The pixels that a cell takes its value from, with their weights, in Q30; none outside the image.
pub(super) type PixelsOf = fn(Tap, [i64; 2]) -> [([i64; 2], u32); 4];

/// The four pixels and their weights, as the kernels of floats have them.
pub(in crate::warp) fn bilinear(tap: Tap, [x, y]: [i64; 2]) -> [([i64; 2], u32); 4] {
    let (fx, fy) = (tap.fx(), tap.fy());
    [
        ([x, y], (ONE - fx) * (ONE - fy)),
        ([x + 1, y], fx * (ONE - fy)),
        ([x, y + 1], (ONE - fx) * fy),
        ([x + 1, y + 1], fx * fy),
    ]
}

/// The nearest pixel, and three without weight.
pub(super) fn nearest(tap: Tap, [x, y]: [i64; 2]) -> [([i64; 2], u32); 4] {
    let near = [x + i64::from(tap.step_x()), y + i64::from(tap.step_y())];
    [(near, ONE * ONE), (near, 0), (near, 0), (near, 0)]
}

/// Column and row of a tap's top-left pixel, in a span of a kind of a source of this width.
pub(in crate::warp) fn top_left(kind: SpanKind, tap: Tap, width: u32) -> [i64; 2] {
    match kind {
        SpanKind::Inside => [(tap.offset % width).into(), (tap.offset / width).into()],
        SpanKind::Rim | SpanKind::Halo | SpanKind::Outside => unframed(tap.offset, width).into(),
    }
}

/// Those of the pixels of a cell that count: they exist, and have a part in it.
pub(in crate::warp) fn existing(
    pixels: [([i64; 2], u32); 4],
    (width, height): (u32, u32),
) -> impl Iterator<Item = ([usize; 2], u32)> {
    pixels.into_iter().filter_map(move |([x, y], weight)| {
        let exists = (0..width.into()).contains(&x) && (0..height.into()).contains(&y);
        (exists && weight != 0).then_some(([x as usize, y as usize], weight))
    })
}

/// The transpose of a table whose cells take their values from these pixels.
///
/// # Errors
/// [`Error::OutOfMemory`] and [`Error::Interrupted`].
pub(super) fn of_table(table: &Table, pixels_of: PixelsOf) -> Result<Transposed<u32>> {
    let source = table.source();
    Transposed::new(&[[source.0 as usize, source.1 as usize]], |found| {
        for row in 0..table.rows() {
            crate::parallel::check_interrupt()?;
            for span in table.row(row) {
                for (column, &tap) in (span.first..).zip(span.taps) {
                    let cell = (row * table.columns() + column) as u32;
                    let pixels = pixels_of(tap, top_left(span.kind, tap, source.0));
                    existing(pixels, source).for_each(|(at, weight)| found(0, at, Look { cell, weight }));
                }
            }
        }
        Ok(())
    })
}
