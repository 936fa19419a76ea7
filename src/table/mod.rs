//! The packed table: for every cell of the output, where on the source it samples.
//!
//! A row is a sequence of [spans](PackedSpan) of cells of one [kind](SpanKind); cells that see the image have a [`Tap`]. One table
//! serves every dtype, channel count and row stride, nearest and bilinear: 8 bytes for a cell, 2 for a span and 8 for a
//! row, so at most 12 bytes a cell whatever the maps are, if a row has four cells.

use std::mem::MaybeUninit;
use std::ops::Range;

mod bytes;
mod tap;

use tap::framed;
pub(crate) use tap::{ONE, SpanKind, Tap, unframed};

use crate::cpu::Isa;
use crate::error::Result;
use crate::grid::check_cells;
use crate::kernels::{Kinds, Row, Sampled, quantise_one};
use crate::lut::area::LazyPlan;
use crate::parallel;
use crate::view::buffer;

/// A span of cells of one kind: the kind in the top two bits, the number of cells in the others. Longer spans are several.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct PackedSpan(pub(super) u16);

impl PackedSpan {
    const KIND_SHIFT: u32 = 14;
    const MAX_CELLS: usize = (1 << Self::KIND_SHIFT) - 1;

    /// The spans of so many neighbouring cells of one kind.
    fn of(kind: SpanKind, cells: usize) -> impl Iterator<Item = Self> {
        (0..cells)
            .step_by(Self::MAX_CELLS)
            .map(move |first| Self((kind as u16) << Self::KIND_SHIFT | (cells - first).min(Self::MAX_CELLS) as u16))
    }

    pub(super) fn kind(self) -> SpanKind {
        SpanKind::from_byte((self.0 >> Self::KIND_SHIFT) as u8)
    }

    pub(super) fn cells(self) -> usize {
        usize::from(self.0) & Self::MAX_CELLS
    }

    /// Taps that the span has.
    pub(super) fn taps(self) -> usize {
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
}

/// The spans of consecutive rows. The spans of a row are as many cells as the row has.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct RowSpans {
    pub(super) ends: Vec<RowEnd>,
    pub(super) spans: Vec<PackedSpan>,
}

/// Where a row's spans end, and its taps: those of one row follow those of the one before.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct RowEnd {
    pub(super) span: u32,
    pub(super) tap: u32,
}

impl RowSpans {
    /// Packs one row in place of those there are: [`RowSpans::push`] for taps that are used again and again.
    pub(crate) fn repack(&mut self, isa: Isa, row: Sampled<'_>, taps: &mut [Tap], scratch: &mut Kinds) -> Result<()> {
        self.ends.clear();
        self.spans.clear();
        // SAFETY: the layout is the same, and `push` writes nothing but taps.
        let room = unsafe { &mut *(std::ptr::from_mut(taps) as *mut [MaybeUninit<Tap>]) };
        self.push(isa, row, 0..row.us.len(), room, scratch)
    }

    /// Packs a row, of which only the cells `seen` are looked at, and the others are outside: its spans go to the end of
    /// these, and the taps of all cells but those outside into `taps` behind those of the row before, where there must be
    /// room for one for each cell. What is written behind them is anything at all.
    pub(crate) fn push(
        &mut self,
        isa: Isa,
        row: Sampled<'_>,
        seen: Range<usize>,
        taps: &mut [MaybeUninit<Tap>],
        scratch: &mut Kinds,
    ) -> Result<()> {
        let begin = self.taps();
        let taps = &mut taps[begin..begin + row.us.len()];
        let seen = row.trimmed(seen);
        // cells outside that no span holds yet, and those behind the ones that are looked at
        let (mut outside, behind) = (seen.start, row.us.len() - seen.end);
        let row = Sampled { us: &row.us[seen.clone()], vs: &row.vs[seen], ..row };
        let mut kept = 0;
        for (kind, cells) in scratch.quantise(isa, row, taps)? {
            if kind == SpanKind::Outside {
                outside += cells.len();
                continue;
            }
            self.add_spans(SpanKind::Outside, std::mem::take(&mut outside))?;
            self.add_spans(kind, cells.len())?;
            let own = kept..kept + cells.len();
            match kind {
                SpanKind::Inside if cells.start == kept => {}
                SpanKind::Inside => taps.copy_within(cells, kept),
                _ => {
                    for (tap, (&u, &v)) in
                        taps[own.clone()].iter_mut().zip(row.us[cells.clone()].iter().zip(&row.vs[cells]))
                    {
                        tap.write(framed_tap(u, v, row.source.0));
                    }
                }
            }
            kept = own.end;
        }
        self.add_spans(SpanKind::Outside, outside + behind)?;
        let end = RowEnd { span: self.spans.len() as u32, tap: (begin + kept) as u32 };
        buffer::push(WHAT, &mut self.ends, end)
    }

    /// Appends the spans of so many neighbouring cells of one kind.
    #[inline]
    fn add_spans(&mut self, kind: SpanKind, cells: usize) -> Result<()> {
        PackedSpan::of(kind, cells).try_for_each(|span| buffer::push(WHAT, &mut self.spans, span))
    }

    /// How many taps these rows have.
    fn taps(&self) -> usize {
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
        let mut first = 0;
        self.spans[begin.span as usize..end.span as usize].iter().map(move |packed| {
            let own;
            (own, taps) = taps.split_at(packed.taps());
            let span = Span { kind: packed.kind(), first, cells: packed.cells(), taps: own };
            first += span.cells;
            span
        })
    }
}

/// The table. Whatever it was made from, every tap in a span of [`SpanKind::Inside`] has `x <= width - 2` and
/// `y <= height - 2`: kernels rely on it.
#[derive(Debug, Clone)]
pub(crate) struct Table {
    pub(super) rows: usize,
    pub(super) columns: usize,
    pub(super) source: (u32, u32),
    /// Room for a tap for each cell, in which the taps of a band's rows follow each other from the band's first on;
    /// anything at all beyond them. Rows with gaps between them cost a warp with cold caches 10 to 20 %, because what the
    /// CPU fetches ahead stops at each.
    ///
    /// One allocation: many small ones are given back to the system when a table is dropped, and the next build pays a
    /// page fault for every 4 KiB: 2.6 ms became 0.9 for the seed job, from 1057 faults a build to none.
    taps: Vec<MaybeUninit<Tap>>,
    /// The spans, in bands of [`band_rows`] rows.
    pub(super) bands: Vec<RowSpans>,
    /// What `area` needs beyond, once it was asked for.
    pub(super) area: LazyPlan,
}

/// How many rows a band has: 32768 cells or a row, 256 KiB of taps, which stay in a core's own cache while they are
/// packed. It depends on the shape alone, so tables of one view are equal however many threads made them.
pub(super) fn band_rows(columns: usize) -> usize {
    (1usize << 15).div_ceil(columns)
}

impl Table {
    /// Packs the coordinates that `fill` writes for a row: u and v in source pixels, NaN where there is none. It returns
    /// which cells it wrote; the others are outside.
    ///
    /// # Errors
    /// [`Error::TooManyCells`] and [`Error::OutOfMemory`].
    pub(super) fn build(
        (rows, columns): (usize, usize),
        source: (u32, u32),
        isa: Isa,
        fill: impl Fn(usize, &mut [f64], &mut [f64]) -> Result<Range<usize>> + Sync,
    ) -> Result<Self> {
        let mut table = Self::empty((rows, columns), source)?;
        let threads = if rows * columns < INLINE_CELLS { 1 } else { parallel::num_threads() };
        let band_rows = band_rows(columns);
        let jobs = table.bands_mut().enumerate();
        parallel::for_each(threads, jobs, |(band, (spans, room))| {
            // band by band, each while it is in the cache: all at once was a tenth of the time
            let (mut us, mut vs) = (Row::filled(columns, 0.0)?, Row::filled(columns, 0.0)?);
            let mut scratch = Kinds::default();
            spans.ends = buffer::reserved(WHAT, room.len() / columns)?;
            for row in band * band_rows..(band * band_rows + band_rows).min(rows) {
                let seen = fill(row, &mut us, &mut vs)?;
                spans.push(isa, Sampled { us: &us, vs: &vs, source }, seen, room, &mut scratch)?;
            }
            Ok(())
        })?;
        Ok(table)
    }

    /// A table with room for all taps, but none in it, and no spans yet.
    pub(super) fn empty((rows, columns): (usize, usize), source: (u32, u32)) -> Result<Self> {
        check_cells("Lut", rows as f64, columns as f64)?;
        let mut table = Self { rows, columns, source, taps: Vec::new(), bands: Vec::new(), area: LazyPlan::default() };
        table.taps = buffer::filled(WHAT, rows * columns, MaybeUninit::uninit())?;
        table.bands = buffer::filled(WHAT, rows.div_ceil(band_rows(columns)), RowSpans::default())?;
        Ok(table)
    }

    /// The bands, each with the room for its taps.
    pub(super) fn bands_mut(&mut self) -> impl ExactSizeIterator<Item = (&mut RowSpans, &mut [MaybeUninit<Tap>])> {
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

    pub(super) fn nbytes(&self) -> usize {
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
        // SAFETY: the layout is the same, and these were written: who adds a row to a band's spans, `RowSpans::push` and the
        // reader of bytes, writes as many taps as they say behind those of the row before, from the band's first on.
        let taps = unsafe { &*(std::ptr::from_ref(taps) as *const [Tap]) };
        Band { rows, spans, taps }
    }

    /// The spans of a row, from left to right, without a gap.
    #[inline]
    pub(crate) fn row(&self, row: usize) -> impl Iterator<Item = Span<'_>> {
        self.band(row).spans(row)
    }
}

/// Tables are equal where all cells are; what lies behind a band's taps is no part of it, and a plan follows from the rest.
impl PartialEq for Table {
    fn eq(&self, other: &Self) -> bool {
        (self.rows, self.columns, self.source) == (other.rows, other.columns, other.source)
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

    /// The spans of a row of the band, from left to right, without a gap.
    #[inline]
    pub(crate) fn spans(&self, row: usize) -> impl Iterator<Item = Span<'a>> + use<'a> {
        self.spans.spans(row - self.rows.start, self.taps)
    }
}

/// The tap of a cell on the rim or in the halo.
fn framed_tap(u: f64, v: f64, width: u32) -> Tap {
    let ((x, fx), (y, fy)) = (quantise_one(u), quantise_one(v));
    Tap { offset: framed(x, y, width), x: fx, y: fy }
}

/// Tables of fewer cells are built on the caller's thread: 16384 cells take about 15 us, and waking a helper 5 to 20.
const INLINE_CELLS: usize = 1 << 14;

/// What memory is asked for, in errors.
const WHAT: &str = "Lut";

#[cfg(test)]
mod tests {
    use super::*;

    const SOURCE: (u32, u32) = (5, 4);

    /// The kind of a single cell, by every instruction set.
    fn kind(u: f64, v: f64, source: (u32, u32)) -> SpanKind {
        let packed = |&isa: &Isa| {
            let mut spans = RowSpans::default();
            let mut taps = [Tap::default()];
            spans.repack(isa, Sampled { us: &[u], vs: &[v], source }, &mut taps, &mut Kinds::default()).unwrap();
            taps[spans.taps()..].fill(Tap::default());
            (spans, taps)
        };
        let all: Vec<_> = Isa::available().iter().map(packed).collect();
        assert!(all.iter().all(|one| *one == all[0]));
        all[0].0.spans[0].kind()
    }

    #[test]
    fn a_tap_is_eight_bytes_and_a_packed_span_two() {
        assert_eq!((size_of::<Tap>(), size_of::<PackedSpan>()), (8, 2));
    }

    #[test]
    fn kinds_follow_the_rectangle_of_pixel_centres() {
        for (u, v, kind) in [
            (0.0, 0.0, SpanKind::Inside),
            (3.999, 2.999, SpanKind::Inside),
            (4.0, 1.0, SpanKind::Rim),
            (1.0, 3.0, SpanKind::Rim),
            (4.0, 3.0, SpanKind::Rim),
            (3.9999999, 1.0, SpanKind::Rim),
            (-1e-9, 1.0, SpanKind::Halo),
            (4.0 + 1e-9, 1.0, SpanKind::Halo),
            (-0.999, -0.999, SpanKind::Halo),
            (4.999, 3.999, SpanKind::Halo),
            (-1.0, 1.0, SpanKind::Outside),
            (5.0, 1.0, SpanKind::Outside),
            (1.0, 4.0, SpanKind::Outside),
            (f64::NAN, 1.0, SpanKind::Outside),
            (1.0, f64::INFINITY, SpanKind::Outside),
            (-1e300, 1.0, SpanKind::Outside),
        ] {
            assert_eq!(self::kind(u, v, SOURCE), kind, "({u}, {v})");
        }
    }

    #[test]
    fn a_source_of_one_pixel_is_all_rim() {
        assert_eq!(kind(0.0, 0.0, (1, 1)), SpanKind::Rim);
        assert_eq!(kind(0.25, 0.0, (1, 1)), SpanKind::Halo);
    }

    #[test]
    fn fractions_are_within_half_a_step_and_nearest_is_np_round() {
        for step in 0..100_000 {
            let u = -0.999 + f64::from(step) * 5.9e-5;
            let (whole, packed) = quantise_one(u);
            let tap = Tap { offset: 0, x: packed, y: 0 };
            let back = whole as f64 + f64::from(tap.fx()) / f64::from(ONE);
            assert!((back - u).abs() <= 0.516 / f64::from(ONE), "{u} {back}");
            assert_eq!(whole + i64::from(tap.step_x()), u.round_ties_even() as i64, "{u}");
        }
        for (u, nearest) in [(0.5, 0), (1.5, 2), (2.5, 2), (-0.5, 0), (1.4999999999999998, 1), (2.5000000000000004, 3)]
        {
            let (whole, packed) = quantise_one(u);
            assert_eq!(whole + i64::from(packed >> 15), nearest, "{u}");
        }
    }

    #[test]
    fn rows_are_covered_without_a_gap() {
        let rows = 1000;
        let fill = |row: usize, us: &mut [f64], vs: &mut [f64]| {
            for (column, (u, v)) in us.iter_mut().zip(vs).enumerate() {
                (*u, *v) = (column as f64 * 0.1 - 2.0 + row as f64 * 0.003, row as f64 * 0.006 - 1.5);
            }
            Ok(0..us.len())
        };
        let table = Table::build((rows, 100), SOURCE, Isa::Scalar, fill).unwrap();
        for &isa in Isa::available() {
            assert_eq!(Table::build((rows, 100), SOURCE, isa, fill).unwrap(), table);
        }
        let mut kinds = [0; 4];
        for row in 0..rows {
            let mut next = 0;
            for span in table.row(row) {
                assert_eq!(span.first, next);
                assert!(span.cells > 0);
                assert_eq!(span.taps.len(), if span.kind == SpanKind::Outside { 0 } else { span.cells });
                kinds[span.kind as usize] += span.cells;
                next += span.cells;
            }
            assert_eq!(next, 100);
        }
        assert!(kinds.iter().all(|&cells| cells > 0), "{kinds:?}");
    }

    #[test]
    fn at_most_twelve_bytes_a_cell_also_where_every_cell_is_a_span_of_its_own() {
        for (rows, columns) in [(1, 200_000), (50_000, 4), (300, 301)] {
            let cells = rows * columns;
            let table = Table::build((rows, columns), (3, 3), Isa::Scalar, |_, us, vs| {
                for (column, (u, v)) in us.iter_mut().zip(vs).enumerate() {
                    [*u, *v] = [[0.5, 0.5], [2.5, 2.5]][column % 2];
                }
                Ok(0..us.len())
            })
            .unwrap();
            assert_eq!(table.row(0).count(), columns);
            assert!(table.nbytes() <= 12 * cells, "{} of {cells}", table.nbytes());
        }
    }

    #[test]
    fn spans_longer_than_their_number_are_several() {
        for columns in [16_382, 16_383, 16_384, 50_000] {
            let table = Table::build((2, columns), (3, 3), Isa::Scalar, |row, us, vs| {
                us.fill([0.5, f64::NAN][row]);
                vs.fill(0.5);
                Ok(0..us.len())
            })
            .unwrap();
            for row in 0..2 {
                let spans: Vec<_> = table.row(row).collect();
                assert_eq!(spans.len(), columns.div_ceil(16_383));
                assert_eq!(spans.iter().map(|span| span.cells).sum::<usize>(), columns);
                assert_eq!(spans.iter().map(|s| s.taps.len()).sum::<usize>(), [columns, 0][row]);
            }
        }
    }
}
