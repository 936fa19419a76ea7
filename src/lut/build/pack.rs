//! Coordinates packed into a table: rows of spans and taps.

use std::mem::MaybeUninit;
use std::ops::Range;

use crate::error::Result;
use crate::isa::Isa;
use crate::kernels::{Kinds, Row, Sampled, quantise_one};
use crate::parallel::{self, Work};
use crate::table::{BorderMode, Edges, RowEnd, RowSpans, SpanKind, Table, Tap, band_rows, framed};
use crate::view::buffer;

/// What memory is asked for, in errors.
const WHAT: &str = "Lut";

impl RowSpans {
    /// Packs one row in place of those there are: [`RowSpans::push`] for taps that are used again and again.
    pub(crate) fn repack(&mut self, isa: Isa, row: Sampled<'_>, taps: &mut [Tap], scratch: &mut Kinds) -> Result<()> {
        self.ends.clear();
        self.spans.clear();
        // SAFETY: the layout is the same, and `push` writes nothing but taps.
        let room = unsafe { &mut *(std::ptr::from_mut(taps) as *mut [MaybeUninit<Tap>]) };
        self.push(isa, row, 0..row.us.len(), Edges::default(), room, scratch)
    }

    /// Packs a row, of which only the cells `seen` are looked at, and the others are outside: its spans go to the end of
    /// these, and the taps of all cells but those outside into `taps` behind those of the row before, where there must be
    /// room for one for each cell. What is written behind them is anything at all.
    pub(crate) fn push(
        &mut self,
        isa: Isa,
        row: Sampled<'_>,
        seen: Range<usize>,
        edges: Edges,
        taps: &mut [MaybeUninit<Tap>],
        scratch: &mut Kinds,
    ) -> Result<()> {
        let begin = self.taps();
        let taps = &mut taps[begin..begin + row.us.len()];
        let seen = if edges.see_all() { seen } else { row.trimmed(seen) };
        // cells outside that no span holds yet, and those behind the ones that are looked at
        let (mut outside, behind) = (seen.start, row.us.len() - seen.end);
        let row = Sampled { us: &row.us[seen.clone()], vs: &row.vs[seen], ..row };
        let mut kept = 0;
        for (kind, cells) in scratch.quantise(isa, row, taps)? {
            if edges.see_all() && matches!(kind, SpanKind::Outside | SpanKind::Halo) {
                for (kind, cells) in beyond(row, cells, edges) {
                    if kind == SpanKind::Outside {
                        outside += cells.len();
                        continue;
                    }
                    self.add_spans(SpanKind::Outside, std::mem::take(&mut outside))?;
                    self.add_spans(kind, cells.len())?;
                    for cell in cells {
                        // no tap that is still needed: as many cells as taps lie before this one at most
                        taps[kept].write(folded_tap(row.us[cell], row.vs[cell], row.source, edges));
                        kept += 1;
                    }
                }
                continue;
            }
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
}

impl Table {
    /// Packs the coordinates that `fill` writes for a row: u and v in source pixels, NaN where there is none. It returns
    /// which cells it wrote; the others are outside.
    ///
    /// # Errors
    /// [`TableError::TooManyCells`](crate::error::TableError::TooManyCells) and [`Error::OutOfMemory`].
    pub(in crate::lut) fn build(
        (rows, columns): (usize, usize),
        source: (u32, u32),
        edges: Edges,
        isa: Isa,
        fill: impl Fn(usize, &mut [f64], &mut [f64]) -> Result<Range<usize>> + Sync,
    ) -> Result<Self> {
        let mut table = Self::empty((rows, columns), source, edges)?;
        let threads = Work::table(rows * columns).threads_unasked();
        let band_rows = band_rows(columns);
        let jobs = table.bands_mut().enumerate();
        parallel::for_each(threads, jobs, |(band, (spans, room))| {
            // band by band, each while it is in the cache: all at once was a tenth of the time
            let (mut us, mut vs) = (Row::filled(columns, 0.0)?, Row::filled(columns, 0.0)?);
            let mut scratch = Kinds::default();
            spans.ends = buffer::reserved(WHAT, room.len() / columns)?;
            for row in band * band_rows..(band * band_rows + band_rows).min(rows) {
                let seen = fill(row, &mut us, &mut vs)?;
                edges.wrap(&mut us[seen.clone()], source.0);
                spans.push(isa, Sampled { us: &us, vs: &vs, source }, seen, edges, room, &mut scratch)?;
            }
            Ok(())
        })?;
        Ok(table)
    }
}

/// What neighbouring cells are, none of which has four pixels of the image, of a source that does not end at its edges:
/// on the rim between its last column and its first, in the halo where the image has the same elsewhere, or outside.
fn beyond(row: Sampled<'_>, cells: Range<usize>, edges: Edges) -> impl Iterator<Item = (SpanKind, Range<usize>)> {
    let (width, last_row) = (f64::from(row.source.0), f64::from(row.source.1) - 1.0);
    let kind = move |cell: usize| {
        let (u, v) = (row.us[cell], row.vs[cell]);
        let near = u > -1.0 && u < width && v > -1.0 && v < last_row + 1.0;
        if edges.wraps && near && (0.0..=last_row).contains(&v) {
            SpanKind::Rim
        } else if near || (edges.mode.repeats() && u.is_finite() && v.is_finite()) {
            SpanKind::Halo
        } else {
            SpanKind::Outside
        }
    };
    let (mut next, end) = (cells.start, cells.end);
    std::iter::from_fn(move || {
        let first = next;
        let found = (first < end).then(|| kind(first))?;
        next += (first..end).take_while(|&cell| kind(cell) == found).count();
        Some((found, first..next))
    })
}

/// The tap of such a cell: where the image has what lies there, at most a pixel outside it.
fn folded_tap(u: f64, v: f64, (width, height): (u32, u32), edges: Edges) -> Tap {
    let (mut us, mut vs, [across, down]) = ([u], [v], edges.axes());
    across.fold(&mut us, width as usize, 1.0);
    down.fold(&mut vs, height as usize, 1.0);
    let tap = framed_tap(us[0], vs[0], width);
    Tap {
        x: step_of_halves(tap.x, (u, us[0]), across, width as usize),
        y: step_of_halves(tap.y, (v, vs[0]), down, height as usize),
        ..tap
    }
}

/// The packed fraction of a folded coordinate, where that is a half, with a step to the pixel that was nearest before: a
/// mirror, and a repeated image of an odd size, turn a half's even neighbour into its odd one.
fn step_of_halves(fraction: u16, (before, folded): (f64, f64), mode: BorderMode, size: usize) -> u16 {
    let first = folded.floor();
    // from 2^52 on there are no halves, but folding makes some
    if !mode.repeats() || folded - first != 0.5 || before.fract() == 0.0 {
        return fraction;
    }
    let nearest = mode.pixel(before.round_ties_even() as i64, size);
    Tap::with_step(fraction, mode.pixel(first as i64, size) != nearest)
}

/// The tap of a cell on the rim or in the halo.
fn framed_tap(u: f64, v: f64, width: u32) -> Tap {
    let ((x, fx), (y, fy)) = (quantise_one(u), quantise_one(v));
    Tap { offset: framed(x, y, width), x: fx, y: fy }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::{ONE, PackedSpan};

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
        let table = Table::build((rows, 100), SOURCE, Edges::default(), Isa::Scalar, fill).unwrap();
        for &isa in Isa::available() {
            assert_eq!(Table::build((rows, 100), SOURCE, Edges::default(), isa, fill).unwrap(), table);
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
            let table = Table::build((rows, columns), (3, 3), Edges::default(), Isa::Scalar, |_, us, vs| {
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
            let table = Table::build((2, columns), (3, 3), Edges::default(), Isa::Scalar, |row, us, vs| {
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

    /// Of halves the even neighbour, as without a table: before a mirror turns it into the odd one.
    #[test]
    fn halves_beyond_the_image_go_to_their_even_neighbour() {
        use crate::{ImageView, Interpolation, Lut, WarpOptions};
        let image: Vec<u8> = (0..20).collect();
        let view = ImageView::new(&image, (5, 4), 1).unwrap();
        let options = WarpOptions { interpolation: Interpolation::Nearest, ..WarpOptions::default() };
        let places: Vec<f64> = (-60..60).map(|half| f64::from(half) / 2.0).collect();
        for mode in BorderMode::ALL.into_iter().filter(|mode| mode.repeats()) {
            for other in [0.0, 1.25, -7.5] {
                let others = vec![other; places.len()];
                for (us, vs) in [(&places, &others), (&others, &places)] {
                    let lut = Lut::from_maps_with(us, vs, places.len(), SOURCE, mode, false).unwrap();
                    let got = lut.warp(&view, &options).unwrap();
                    for (cell, &value) in got.iter().enumerate() {
                        let pixel = |at: f64, size| mode.pixel(at.round_ties_even() as i64, size).unwrap();
                        let expected = pixel(vs[cell], 4) * 5 + pixel(us[cell], 5);
                        assert_eq!(usize::from(value), expected, "{mode:?} at {} {}", us[cell], vs[cell]);
                    }
                }
            }
        }
    }
}
