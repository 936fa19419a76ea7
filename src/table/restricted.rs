//! A table of some of the cells of another.

use std::mem::MaybeUninit;

use super::{RowEnd, RowSpans, Span, SpanKind, Table, Tap, band_rows};
use crate::error::Result;
use crate::parallel::check_interrupt;
use crate::view::buffer;

impl Table {
    /// The table of the cells for which `keep`, row-major, is true; all others are outside.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`](crate::Error::OutOfMemory) and [`Error::Interrupted`](crate::Error::Interrupted).
    pub(crate) fn restricted(&self, keep: &[bool]) -> Result<Self> {
        let columns = self.columns;
        debug_assert_eq!(keep.len(), self.rows * columns);
        let mut table = Self::empty((self.rows, columns), self.source, self.edges)?;
        for (band, (spans, taps)) in table.bands_mut().enumerate() {
            let first = band * band_rows(columns);
            let mut next = 0;
            for (row, keep) in (first..).zip(keep[first * columns..].chunks(columns).take(band_rows(columns))) {
                check_interrupt()?;
                let mut row_of = RowWriter { spans, taps: &mut taps[next..], written: 0, kept: None };
                for span in self.row(row) {
                    row_of.add(&span, &keep[span.first..span.first + span.cells])?;
                }
                next += row_of.finish()?;
                let end = RowEnd { span: spans.spans.len() as u32, tap: next as u32 };
                buffer::push("RigLut", &mut spans.ends, end)?;
            }
        }
        Ok(table)
    }
}

/// A row that is being written; neighbouring cells of one kind become one span.
struct RowWriter<'a> {
    spans: &'a mut RowSpans,
    /// Room for a tap for each cell of the row.
    taps: &'a mut [MaybeUninit<Tap>],
    written: usize,
    /// Cells of one kind that are not in `spans` yet.
    kept: Option<(SpanKind, usize)>,
}

impl RowWriter<'_> {
    /// Adds the cells of a span that are kept, and as many outside for the others.
    fn add(&mut self, span: &Span<'_>, keep: &[bool]) -> Result<()> {
        if span.kind == SpanKind::Outside {
            return self.extend(SpanKind::Outside, span.cells);
        }
        let mut cell = 0;
        for same in keep.chunk_by(|one, next| one == next) {
            if same[0] {
                let taps = &span.taps[cell..cell + same.len()];
                for (room, &tap) in self.taps[self.written..].iter_mut().zip(taps) {
                    room.write(tap);
                }
                self.written += taps.len();
                self.extend(span.kind, same.len())?;
            } else {
                self.extend(SpanKind::Outside, same.len())?;
            }
            cell += same.len();
        }
        Ok(())
    }

    fn extend(&mut self, kind: SpanKind, cells: usize) -> Result<()> {
        match &mut self.kept {
            Some((before, count)) if *before == kind => *count += cells,
            _ => {
                if let Some((before, count)) = self.kept.replace((kind, cells)) {
                    self.spans.add_spans(before, count)?;
                }
            }
        }
        Ok(())
    }

    /// How many taps were written.
    fn finish(self) -> Result<usize> {
        if let Some((kind, count)) = self.kept {
            self.spans.add_spans(kind, count)?;
        }
        Ok(self.written)
    }
}

#[cfg(test)]
mod tests {
    use crate::Lut;

    #[test]
    fn what_is_kept_samples_as_before_and_nothing_else_does() {
        let (rows, columns) = (37, 61);
        let (x, y): (Vec<f64>, Vec<f64>) =
            (0..rows * columns).map(|k| (0.31 * (k % columns) as f64 - 2.0, 0.4 * (k / columns) as f64 - 1.5)).unzip();
        let lut = Lut::from_maps(&x, &y, columns, (15, 12)).unwrap();
        let keep: Vec<bool> = (0..rows * columns).map(|k| (k * k / 7 + k / 97) % 3 != 0).collect();
        let some = lut.restricted(&keep).unwrap();
        let (maps, kept) = (lut.maps(f32::NAN).unwrap(), some.maps(f32::NAN).unwrap());
        for (cell, &keep) in keep.iter().enumerate() {
            let expected = if keep { [maps.0[cell], maps.1[cell]] } else { [f32::NAN; 2] };
            assert_eq!([kept.0[cell], kept.1[cell]].map(f32::to_bits), expected.map(f32::to_bits), "{cell}");
        }
        assert!(some.valid_cells() > 400);
        assert_eq!(some, Lut::from_bytes(&some.to_bytes().unwrap()).unwrap());
        assert!(lut.restricted(&vec![true; rows * columns]).unwrap() == lut);
    }
}
