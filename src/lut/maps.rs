//! A table as plain arrays: the mask, and maps for `cv2.remap`.

use super::Lut;
use crate::error::Result;
use crate::parallel::check_interrupt;
use crate::table::{ONE, SpanKind, Tap, unframed};
use crate::view::buffer;

impl Lut {
    /// Which cells are valid, row-major: in front of the camera and inside the rectangle of the image's pixel centres.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`](crate::Error::OutOfMemory) and [`Error::Interrupted`](crate::Error::Interrupted).
    pub fn mask(&self) -> Result<Vec<bool>> {
        /// Filling a row takes 35 ns, asking for an interrupt nearly as long.
        const ROWS_A_CHECK: usize = 64;
        let mut mask = buffer::zeroed("mask", self.rows() * self.columns())?;
        for (row, cells) in mask.chunks_mut(self.columns()).enumerate() {
            if row % ROWS_A_CHECK == 0 {
                check_interrupt()?;
            }
            for span in self.table.row(row) {
                if span.kind.is_valid() {
                    cells[span.first..span.first + span.cells].fill(true);
                }
            }
        }
        Ok(mask)
    }

    /// How many cells are valid.
    pub fn valid_cells(&self) -> usize {
        let valid = |row| self.table.row(row).filter(|span| span.kind.is_valid()).map(|span| span.cells).sum::<usize>();
        (0..self.rows()).map(valid).sum()
    }

    /// (map_x, map_y), row-major: the source coordinates of valid and halo cells, `outside` elsewhere, for
    /// `cv2.remap` and its like. Within 2^-16 pixel and one float32 step of the exact coordinate.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`](crate::Error::OutOfMemory) and [`Error::Interrupted`](crate::Error::Interrupted).
    pub fn maps(&self, outside: f32) -> Result<(Vec<f32>, Vec<f32>)> {
        let columns = self.columns();
        let map = || buffer::filled("maps", self.rows() * columns, outside);
        let (mut map_x, mut map_y) = (map()?, map()?);
        for (row, (xs, ys)) in map_x.chunks_mut(columns).zip(map_y.chunks_mut(columns)).enumerate() {
            check_interrupt()?;
            for span in self.table.row(row).filter(|span| span.kind != SpanKind::Outside) {
                for (column, tap) in (span.first..).zip(span.taps) {
                    let (x, y) = self.top_left(span.kind, *tap);
                    xs[column] = coordinate(x, tap.fx(), tap.step_x());
                    ys[column] = coordinate(y, tap.fy(), tap.step_y());
                }
            }
        }
        Ok((map_x, map_y))
    }

    /// Column and row of the top-left of a tap's four pixels; -1 in the halo's left and upper part.
    fn top_left(&self, kind: SpanKind, tap: Tap) -> (i64, i64) {
        let (width, _) = self.source_size();
        if kind == SpanKind::Inside {
            (i64::from(tap.offset % width), i64::from(tap.offset / width))
        } else {
            unframed(tap.offset, width)
        }
    }
}

/// The float32 coordinate of a tap, on the side of the half that the table decided in float64: at column 1500 float32
/// steps by 1.2e-4 pixel, so plain rounding would send others to another nearest pixel than ours.
fn coordinate(whole: i64, fraction: u32, step: u32) -> f32 {
    let nearest = (whole + i64::from(step)) as f32;
    let mut value = (whole as f64 + f64::from(fraction) / f64::from(ONE)) as f32;
    if value.round_ties_even() != nearest {
        // a step or two from the half; a file's tap may say anything, and lie 2^30 steps of float32 from it
        value = (whole as f64 + 0.5) as f32;
    }
    while value.round_ties_even() != nearest {
        value = if value > nearest { value.next_down() } else { value.next_up() };
    }
    value
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn taps_that_contradict_themselves_take_no_time() {
        for (whole, fraction, step, expected) in
            [(0, 0, 1, 0.5f32.next_up()), (0, 32767, 0, 0.5), (-1, 0, 1, -0.5), (1 << 30, 32767, 0, 1_073_741_800.0)]
        {
            assert_eq!(coordinate(whole, fraction, step), expected, "{whole} {fraction} {step}");
        }
    }

    #[test]
    fn float32_coordinates_keep_the_nearest_pixel_and_stay_close() {
        for (u, columns) in [(1500.4999999_f64, 2048), (1501.4999999, 2048), (1500.5000001, 2048), (3.4999999, 8)] {
            let lut = Lut::from_maps(&[u, u], &[0.0, 0.0], 2, (columns, 4)).unwrap();
            let (map_x, _) = lut.maps(f32::NAN).unwrap();
            assert_eq!(map_x[0].round_ties_even(), u.round_ties_even() as f32, "{u}");
            assert!((f64::from(map_x[0]) - u).abs() < 2.5e-4);
        }
    }

    #[test]
    fn maps_and_mask_tell_valid_halo_and_outside_apart() {
        let (x, y) = ([0.0, 1.25, 2.0, -0.5, 2.75, -1.0, f64::NAN, 1.0], [0.5, 0.0, 1.0, 0.0, 1.5, 0.0, 0.0, 9.0]);
        let lut = Lut::from_maps(&x, &y, 4, (3, 2)).unwrap();
        assert_eq!(lut.mask().unwrap(), [true, true, true, false, false, false, false, false]);
        assert_eq!(lut.valid_cells(), 3);
        let (map_x, map_y) = lut.maps(-9.0).unwrap();
        assert_eq!(map_x, [0.0, 1.25, 2.0, -0.5, 2.75, -9.0, -9.0, -9.0]);
        assert_eq!(map_y, [0.5, 0.0, 1.0, 0.0, 1.5, -9.0, -9.0, -9.0]);
    }
}
