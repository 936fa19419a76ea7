//! The nearest pixel of every cell as one number: half the memory that a warp reads of a table, and nothing to work out.
//!
//! Which pixel is nearest was decided when the table was built: halves go to the even one, as `np.round` rounds, and a
//! [`Tap`] holds the decision as [`Tap::step_x`] and [`Tap::step_y`]; `kernels::rounding` makes it.

use crate::error::Result;
use crate::isa::{self, Body, Isa};
use crate::lut::Derivative;
use crate::parallel;
use crate::table::{Band, Span, Table, Tap};
use crate::view::buffer;

/// What memory is asked for, in errors.
const WHAT: &str = "Lut";

/// The nearest pixels of a table's cells, as `y * width + x`: 4 bytes for each cell that has a tap, laid out as the taps are.
#[derive(Debug)]
pub(super) struct NearestPixels {
    pixels: Vec<u32>,
}

impl NearestPixels {
    /// The nearest pixels of the cells whose four pixels exist; what stands for other cells is not looked at.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`](crate::Error::OutOfMemory) and [`Error::Interrupted`](crate::Error::Interrupted).
    pub(super) fn new(isa: Isa, table: &Table, threads: usize) -> Result<Self> {
        let mut pixels = buffer::zeroed(WHAT, table.rows() * table.columns())?;
        let width = table.source().0;
        let bands = pixels.chunks_mut(table.band(0).rows.len() * table.columns());
        parallel::for_each(threads, bands.enumerate(), |(index, pixels)| {
            let band = table.band(index * table.band(0).rows.len());
            let taps = band.taps();
            isa::run(isa, Nearest { taps, width, pixels: &mut pixels[..taps.len()] });
            Ok(())
        })?;
        Ok(Self { pixels })
    }

    /// The nearest pixels of a span of a band.
    #[inline]
    pub(super) fn of(&self, table: &Table, band: &Band<'_>, span: &Span<'_>) -> &[u32] {
        let first = band.rows.start * table.columns() + span.first_tap;
        &self.pixels[first..first + span.taps.len()]
    }
}

impl Derivative for NearestPixels {
    fn nbytes(&self) -> usize {
        size_of_val(&*self.pixels)
    }
}

/// Taps to nearest pixels.
struct Nearest<'a> {
    taps: &'a [Tap],
    width: u32,
    pixels: &'a mut [u32],
}

impl Body for Nearest<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        for (tap, pixel) in self.taps.iter().zip(self.pixels) {
            // of a cell on the rim or in the halo this is anything at all
            *pixel = tap.offset.wrapping_add(tap.step_x()).wrapping_add(tap.step_y().wrapping_mul(self.width));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Lut;
    use crate::table::SpanKind;

    #[test]
    fn every_span_finds_its_own_pixels() {
        // rims, halos and outsides between, and several bands
        let columns = 5000;
        let u: Vec<f64> = (0..20 * columns).map(|i| ((i * 37) % 1000) as f64 * 0.07 - 2.0).collect();
        let v: Vec<f64> = (0..20 * columns).map(|i| (i / 700) as f64 * 0.31 - 1.0).collect();
        let lut = Lut::from_maps(&u, &v, columns, (64, 40)).unwrap();
        for &isa in Isa::available() {
            let nearest = NearestPixels::new(isa, lut.table(), 2).unwrap();
            let mut looked_at = 0;
            for row in 0..20 {
                let band = lut.table().band(row);
                for span in band.spans(row).filter(|span| span.kind == SpanKind::Inside) {
                    let pixels = nearest.of(lut.table(), &band, &span);
                    assert_eq!(pixels.len(), span.cells);
                    for (cell, pixel) in (row * columns + span.first..).zip(pixels) {
                        let expected = v[cell].round_ties_even() * 64.0 + u[cell].round_ties_even();
                        assert_eq!(f64::from(*pixel), expected, "{isa:?} {cell}");
                        looked_at += 1;
                    }
                }
            }
            assert!(looked_at > 10_000);
        }
    }
}
