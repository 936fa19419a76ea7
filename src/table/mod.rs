//! The packed table: for every cell of the output, where on the source it samples.
//!
//! A row is a sequence of [spans](PackedSpan) of cells of one [kind](SpanKind); cells that see the image have a [`Tap`]. One table
//! serves every dtype, channel count and row stride, nearest and bilinear: 8 bytes for a cell, 2 for a span and 8 for a
//! row, so at most 12 bytes a cell whatever the maps are, if a row has four cells.

use std::mem::MaybeUninit;
use std::ops::Range;

pub(crate) mod block;
mod border_mode;
mod bounds;
mod bytes;
pub(crate) mod error;
pub(crate) mod pattern;
mod restricted;
mod tap;

pub use border_mode::BorderMode;
pub(crate) use border_mode::Edges;
pub use bytes::checksum;
pub(crate) use tap::{ONE, SpanKind, Tap, framed, unframed};

use crate::error::{Result, TableError};
use crate::view::{MAX_CELLS, are_too_many, buffer};

/// A span of cells of one kind: the kind in the top two bits, the number of cells in the others. Longer spans are several.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct PackedSpan(pub(crate) u16);

impl PackedSpan {
    const KIND_SHIFT: u32 = 14;
    const MAX_CELLS: usize = (1 << Self::KIND_SHIFT) - 1;

    /// The spans of so many neighbouring cells of one kind.
    fn of(kind: SpanKind, cells: usize) -> impl Iterator<Item = Self> {
        (0..cells)
            .step_by(Self::MAX_CELLS)
            .map(move |first| Self((kind as u16) << Self::KIND_SHIFT | (cells - first).min(Self::MAX_CELLS) as u16))
    }

    pub(crate) fn kind(self) -> SpanKind {
        SpanKind::from_byte((self.0 >> Self::KIND_SHIFT) as u8)
    }

    pub(crate) fn cells(self) -> usize {
        usize::from(self.0) & Self::MAX_CELLS
    }

    /// Taps that the span has.
    pub(crate) fn taps(self) -> usize {
        if self.kind() == SpanKind::Outside { 0 } else { self.cells() }
    }
}

/// A row's neighbouring cells of one kind: the first one's column, their number, and a tap for each if they are not
/// outside.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Span<'a> {
    pub(crate) kind: SpanKind,
    pub(crate) first: usize,
    pub(crate) cells: usize,
    pub(crate) taps: &'a [Tap],
    /// The number of its first tap among those of the rows it is of.
    pub(crate) first_tap: usize,
}

impl Span<'_> {
    /// The part of the span that is in these columns, which is at least a cell.
    pub(crate) fn part(&self, columns: &Range<usize>) -> Self {
        let skip = columns.start.saturating_sub(self.first);
        let cells = self.cells.min(columns.end - self.first) - skip;
        let taps = if self.taps.is_empty() { self.taps } else { &self.taps[skip..skip + cells] };
        Self { first: self.first + skip, cells, taps, first_tap: self.first_tap + skip, ..*self }
    }
}

/// The spans of consecutive rows. The spans of a row are as many cells as the row has.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct RowSpans {
    pub(crate) ends: Vec<RowEnd>,
    pub(crate) spans: Vec<PackedSpan>,
}

/// Where a row's spans end, and its taps: those of one row follow those of the one before.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct RowEnd {
    pub(crate) span: u32,
    pub(crate) tap: u32,
}

impl RowSpans {
    /// Appends the spans of so many neighbouring cells of one kind.
    #[inline]
    pub(crate) fn add_spans(&mut self, kind: SpanKind, cells: usize) -> Result<()> {
        PackedSpan::of(kind, cells).try_for_each(|span| buffer::push(WHAT, &mut self.spans, span))
    }

    /// How many taps these rows have.
    pub(crate) fn taps(&self) -> usize {
        self.begin(self.ends.len()).tap as usize
    }

    /// Where a row begins.
    fn begin(&self, row: usize) -> RowEnd {
        if row == 0 { RowEnd::default() } else { self.ends[row - 1] }
    }

    /// The spans of a row, from left to right, without a gap; `taps` are those of all these rows.
    #[inline]
    pub(crate) fn spans<'a>(&'a self, row: usize, taps: &'a [Tap]) -> impl Iterator<Item = Span<'a>> {
        let (begin, end) = (self.begin(row), self.ends[row]);
        let mut taps = &taps[begin.tap as usize..end.tap as usize];
        let (mut first, mut first_tap) = (0, begin.tap as usize);
        self.spans[begin.span as usize..end.span as usize].iter().map(move |packed| {
            let own;
            (own, taps) = taps.split_at(packed.taps());
            let span = Span { kind: packed.kind(), first, cells: packed.cells(), taps: own, first_tap };
            (first, first_tap) = (first + span.cells, first_tap + own.len());
            span
        })
    }
}

/// The table. Whatever it was made from, every tap in a span of [`SpanKind::Inside`] has `x <= width - 2` and
/// `y <= height - 2`: kernels rely on it.
#[derive(Debug, Clone)]
pub(crate) struct Table {
    pub(crate) rows: usize,
    pub(crate) columns: usize,
    pub(crate) source: (u32, u32),
    pub(crate) edges: Edges,
    /// Room for a tap for each cell, in which the taps of a band's rows follow each other from the band's first on;
    /// anything at all beyond them. Rows with gaps between them cost a warp with cold caches 10 to 20 %, because what the
    /// CPU fetches ahead stops at each.
    ///
    /// One allocation: many small ones are given back to the system when a table is dropped, and the next build pays a
    /// page fault for every 4 KiB: 2.6 ms became 0.9 for the seed job, from 1057 faults a build to none.
    taps: Vec<MaybeUninit<Tap>>,
    /// The spans, in bands of [`band_rows`] rows.
    pub(crate) bands: Vec<RowSpans>,
}

/// How many rows a band has: 32768 cells or a row, 256 KiB of taps, which stay in a core's own cache while they are
/// packed. It depends on the shape alone, so tables of one view are equal however many threads made them.
pub(crate) fn band_rows(columns: usize) -> usize {
    (1usize << 15).div_ceil(columns)
}

/// Refuses shapes that no table may have, before any memory is asked for.
///
/// # Errors
/// [`TableError::TooManyCells`].
pub(crate) fn check_cells(rows: usize, columns: usize) -> Result<(), TableError> {
    let (rows, columns) = (rows as f64, columns as f64);
    if are_too_many(rows, columns) {
        return Err(TableError::TooManyCells { rows, columns, limit: MAX_CELLS });
    }
    Ok(())
}

impl Table {
    /// A table with room for all taps, but none in it, and no spans yet.
    pub(crate) fn empty((rows, columns): (usize, usize), source: (u32, u32), edges: Edges) -> Result<Self> {
        check_cells(rows, columns)?;
        let mut table = Self { rows, columns, source, edges, taps: Vec::new(), bands: Vec::new() };
        table.taps = buffer::filled(WHAT, rows * columns, MaybeUninit::uninit())?;
        table.bands = buffer::filled(WHAT, rows.div_ceil(band_rows(columns)), RowSpans::default())?;
        Ok(table)
    }

    /// The bands, each with the room for its taps.
    pub(crate) fn bands_mut(&mut self) -> impl ExactSizeIterator<Item = (&mut RowSpans, &mut [MaybeUninit<Tap>])> {
        self.bands.iter_mut().zip(self.taps.chunks_mut(band_rows(self.columns) * self.columns))
    }

    pub(crate) fn rows(&self) -> usize {
        self.rows
    }

    pub(crate) fn columns(&self) -> usize {
        self.columns
    }

    pub(crate) fn source(&self) -> (u32, u32) {
        self.source
    }

    pub(crate) fn edges(&self) -> Edges {
        self.edges
    }

    pub(crate) fn nbytes(&self) -> usize {
        let spans = |band: &RowSpans| size_of_val(&*band.ends) + size_of_val(&*band.spans);
        size_of_val(&*self.taps) + self.bands.iter().map(spans).sum::<usize>()
    }

    /// The band that `row` is in.
    #[inline]
    pub(crate) fn band(&self, row: usize) -> Band<'_> {
        let band_rows = band_rows(self.columns);
        let (index, first) = (row / band_rows, row / band_rows * band_rows);
        let rows = first..(first + band_rows).min(self.rows);
        let spans = &self.bands[index];
        let taps = &self.taps[first * self.columns..][..spans.taps()];
        // SAFETY: the layout is the same, and these were written: who adds a row to a band's spans, `RowSpans::push`, the reader
        // of bytes and the restricted table, writes as many taps as they say behind those of the row before, from the band's first on.
        let taps = unsafe { &*(std::ptr::from_ref(taps) as *const [Tap]) };
        Band { rows, spans, taps }
    }

    /// The spans of a row, from left to right, without a gap.
    #[inline]
    pub(crate) fn row(&self, row: usize) -> impl Iterator<Item = Span<'_>> {
        self.band(row).spans(row)
    }

    /// The same as far as these columns go, of which there is at least one.
    #[inline]
    pub(crate) fn row_part<'a>(&'a self, row: usize, columns: &'a Range<usize>) -> impl Iterator<Item = Span<'a>> {
        self.row(row)
            .skip_while(|span| span.first + span.cells <= columns.start)
            .take_while(|span| span.first < columns.end)
            .map(|span| span.part(columns))
    }
}

/// Tables are equal where all cells are; what lies behind a band's taps is no part of it.
impl PartialEq for Table {
    fn eq(&self, other: &Self) -> bool {
        (self.rows, self.columns, self.source, self.edges) == (other.rows, other.columns, other.source, other.edges)
            && self.bands == other.bands
            && (0..self.rows).step_by(band_rows(self.columns)).all(|row| self.band(row).taps == other.band(row).taps)
    }
}

/// Neighbouring rows of a table that were packed together.
pub(crate) struct Band<'a> {
    pub(crate) rows: Range<usize>,
    spans: &'a RowSpans,
    taps: &'a [Tap],
}

impl<'a> Band<'a> {
    /// How many cells of these rows of the band are not outside.
    pub(crate) fn cells_with_taps(&self, rows: Range<usize>) -> usize {
        let begin = |row| self.spans.begin(row - self.rows.start).tap;
        (begin(rows.end) - begin(rows.start)) as usize
    }

    /// The taps of all its rows, one row's behind another's.
    pub(crate) fn taps(&self) -> &'a [Tap] {
        self.taps
    }

    /// The spans of a row of the band, from left to right, without a gap.
    #[inline]
    pub(crate) fn spans(&self, row: usize) -> impl Iterator<Item = Span<'a>> + use<'a> {
        self.spans.spans(row - self.rows.start, self.taps)
    }
}

/// What memory is asked for, in errors.
const WHAT: &str = "Lut";
