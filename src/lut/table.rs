//! The packed table: for every cell of the output, where on the source it samples.
//!
//! A row is a sequence of [runs](Run) of cells of one [kind](RunKind); only cells that can see the image have a
//! [`Tap`]. One table serves every dtype, channel count and row stride, nearest and bilinear: 8 bytes for a cell and
//! 4 for a run, so at most 12 bytes a cell whatever the maps are.

use crate::error::{Error, Result};
use crate::grid::check_cells;
use crate::parallel;

/// Fractions are Q15: 1/32768 of a pixel, 2^-16 at most from the true coordinate. That is 0.008 of 255 grey levels
/// over both axes, and leaves the top bit of a `u16` for [`STEP`].
pub(crate) const ONE: u32 = 1 << 15;

/// Set in a fraction where the nearest pixel is the next one. It is decided in float64, ties to even, because the
/// rounded fraction cannot tell 11.4999999 from 11.5.
const STEP: u16 = 1 << 15;

/// What the cells of a run have in common.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub(crate) enum RunKind {
    /// No image: the border value, and no tap.
    Outside = 0,
    /// Valid, and all four pixels around the coordinate exist: [`Tap::offset`] is `y * width + x` of the top-left one.
    Inside = 1,
    /// Valid, on the last column or row, so that not all four exist. The offset is that of [`framed`].
    Rim = 2,
    /// Not valid, but less than one pixel outside the rectangle of pixel centres. The offset is that of [`framed`].
    Halo = 3,
}

/// A run of cells of one kind: the kind in the top two bits, the number of cells in the others.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Run(pub(super) u32);

impl Run {
    const KIND_SHIFT: u32 = 30;

    fn new(kind: RunKind, cells: u32) -> Self {
        Self((kind as u32) << Self::KIND_SHIFT | cells)
    }

    pub(super) fn kind(self) -> RunKind {
        match self.0 >> Self::KIND_SHIFT {
            0 => RunKind::Outside,
            1 => RunKind::Inside,
            2 => RunKind::Rim,
            _ => RunKind::Halo,
        }
    }

    pub(super) fn cells(self) -> usize {
        (self.0 & ((1 << Self::KIND_SHIFT) - 1)) as usize
    }

    /// Taps that the run owns.
    pub(super) fn taps(self) -> usize {
        if self.kind() == RunKind::Outside { 0 } else { self.cells() }
    }
}

/// Where one cell samples: the top-left of the four pixels around its coordinate, and how far beyond it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(C)]
pub(crate) struct Tap {
    /// Of the top-left pixel; counted as the run's kind says.
    pub(crate) offset: u32,
    pub(super) x: u16,
    pub(super) y: u16,
}

impl Tap {
    /// Q15 fraction along x, below [`ONE`].
    #[inline]
    pub(crate) fn fx(self) -> u32 {
        u32::from(self.x & !STEP)
    }

    /// Q15 fraction along y, below [`ONE`].
    #[inline]
    pub(crate) fn fy(self) -> u32 {
        u32::from(self.y & !STEP)
    }

    /// Columns from the top-left pixel to the nearest: 0 or 1.
    #[inline]
    pub(crate) fn step_x(self) -> u32 {
        u32::from(self.x >> 15)
    }

    /// Rows from the top-left pixel to the nearest: 0 or 1.
    #[inline]
    pub(crate) fn step_y(self) -> u32 {
        u32::from(self.y >> 15)
    }
}

/// Offset of pixel (x, y) in the source with a frame of one pixel around it: x from -1 to width, y likewise.
fn framed(x: i64, y: i64, width: u32) -> u32 {
    ((y + 1) * (i64::from(width) + 2) + x + 1) as u32
}

/// (x, y) of an offset made by [`framed`].
#[inline]
pub(crate) fn unframed(offset: u32, width: u32) -> (i64, i64) {
    let stride = i64::from(width) + 2;
    (i64::from(offset) % stride - 1, i64::from(offset) / stride - 1)
}

/// A row's neighbouring cells of one kind, with their taps (none for [`RunKind::Outside`]).
#[derive(Debug, Clone, Copy)]
pub(crate) struct Segment<'a> {
    pub(crate) kind: RunKind,
    pub(crate) first: usize,
    pub(crate) cells: usize,
    pub(crate) taps: &'a [Tap],
}

/// Where a row begins in the runs and in the taps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct RowStart {
    pub(super) run: u32,
    pub(super) tap: u32,
}

/// The table. Whatever it was made from, every [`RunKind::Inside`] tap has `x <= width - 2` and `y <= height - 2`, and
/// the runs of a row are as many cells as the table has columns: kernels rely on both.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Table {
    pub(super) columns: usize,
    pub(super) source: (u32, u32),
    /// One more than there are rows.
    pub(super) starts: Vec<RowStart>,
    pub(super) runs: Vec<Run>,
    pub(super) taps: Vec<Tap>,
}

impl Table {
    /// Packs the coordinates that `fill` writes for a row: (u, v) in source pixels, NaN where there is none.
    ///
    /// # Errors
    /// [`Error::TooManyCells`] and [`Error::OutOfMemory`].
    pub(super) fn build(
        (rows, columns): (usize, usize),
        source: (u32, u32),
        fill: impl Fn(usize, &mut [[f64; 2]]) + Sync,
    ) -> Result<Self> {
        check_cells("Lut", rows as f64, columns as f64)?;
        let threads = parallel::num_threads();
        let band_rows = parallel::rows_per_band(rows, columns, threads);
        let mut bands: Vec<Band> = (0..rows.div_ceil(band_rows)).map(|_| Band::default()).collect();
        parallel::for_each(threads, bands.iter_mut().enumerate(), |(index, band)| {
            let first = index * band_rows;
            *band = Band::pack(first..(first + band_rows).min(rows), columns, source, &fill);
        });
        let mut table = Self { columns, source, starts: Vec::new(), runs: Vec::new(), taps: Vec::new() };
        reserve(&mut table.starts, rows + 1)?;
        reserve(&mut table.runs, bands.iter().map(|band| band.runs.len()).sum())?;
        reserve(&mut table.taps, bands.iter().map(|band| band.taps.len()).sum())?;
        for band in bands {
            let before = RowStart { run: table.runs.len() as u32, tap: table.taps.len() as u32 };
            table.starts.extend(
                band.starts.iter().map(|start| RowStart { run: before.run + start.run, tap: before.tap + start.tap }),
            );
            table.runs.extend_from_slice(&band.runs);
            table.taps.extend_from_slice(&band.taps);
        }
        table.starts.push(RowStart { run: table.runs.len() as u32, tap: table.taps.len() as u32 });
        Ok(table)
    }

    pub(crate) fn rows(&self) -> usize {
        self.starts.len() - 1
    }

    pub(crate) fn columns(&self) -> usize {
        self.columns
    }

    pub(crate) fn source(&self) -> (u32, u32) {
        self.source
    }

    pub(super) fn nbytes(&self) -> usize {
        size_of_val(&*self.starts) + size_of_val(&*self.runs) + size_of_val(&*self.taps)
    }

    /// The segments of a row, from left to right, without a gap.
    #[inline]
    pub(crate) fn row(&self, row: usize) -> impl Iterator<Item = Segment<'_>> {
        let (start, end) = (self.starts[row], self.starts[row + 1]);
        let mut taps = &self.taps[start.tap as usize..end.tap as usize];
        let mut first = 0;
        self.runs[start.run as usize..end.run as usize].iter().map(move |run| {
            let own;
            (own, taps) = taps.split_at(run.taps());
            let segment = Segment { kind: run.kind(), first, cells: run.cells(), taps: own };
            first += run.cells();
            segment
        })
    }
}

/// Consecutive rows, packed by one thread; starts count from the band's own first run and tap.
#[derive(Default)]
struct Band {
    starts: Vec<RowStart>,
    runs: Vec<Run>,
    taps: Vec<Tap>,
}

impl Band {
    fn pack(
        rows: std::ops::Range<usize>,
        columns: usize,
        source: (u32, u32),
        fill: &impl Fn(usize, &mut [[f64; 2]]),
    ) -> Self {
        let mut band = Self::default();
        let mut coordinates = vec![[f64::NAN; 2]; columns];
        for row in rows {
            fill(row, &mut coordinates);
            band.starts.push(RowStart { run: band.runs.len() as u32, tap: band.taps.len() as u32 });
            let mut current = (RunKind::Outside, 0);
            for &coordinate in &coordinates {
                let (kind, tap) = classify(coordinate, source);
                band.taps.extend(tap);
                if kind == current.0 {
                    current.1 += 1;
                } else {
                    band.close(current);
                    current = (kind, 1);
                }
            }
            band.close(current);
        }
        band
    }

    fn close(&mut self, (kind, cells): (RunKind, u32)) {
        if cells > 0 {
            self.runs.push(Run::new(kind, cells));
        }
    }
}

/// What a cell that samples at (u, v) is, and its tap.
fn classify([u, v]: [f64; 2], (width, height): (u32, u32)) -> (RunKind, Option<Tap>) {
    let (w, h) = (f64::from(width), f64::from(height));
    if !(u > -1.0 && u < w && v > -1.0 && v < h) {
        return (RunKind::Outside, None); // NaN too
    }
    let valid = u >= 0.0 && v >= 0.0 && u <= w - 1.0 && v <= h - 1.0;
    let (x, fx) = quantise(u);
    let (y, fy) = quantise(v);
    let last = |size: u32| i64::from(size) - 1;
    let kind = match valid {
        true if x >= 0 && y >= 0 && x < last(width) && y < last(height) => RunKind::Inside,
        true => RunKind::Rim,
        false => RunKind::Halo,
    };
    let offset = if kind == RunKind::Inside { (y * i64::from(width) + x) as u32 } else { framed(x, y, width) };
    (kind, Some(Tap { offset, x: fx, y: fy }))
}

/// The whole pixel at or before a coordinate above -1, and the Q15 fraction with its [`STEP`].
fn quantise(coordinate: f64) -> (i64, u16) {
    let whole = (coordinate + 1.0) as i64 - 1; // the floor: the baseline build has no instruction for floor itself
    let fraction = coordinate - whole as f64;
    let nearest_is_next = fraction > 0.5 || (fraction == 0.5 && whole & 1 != 0); // np.round: half to even
    let q15 = (fraction * f64::from(ONE) + 0.5) as u16;
    if u32::from(q15) == ONE {
        return (whole + 1, 0); // within 2^-16 of the next pixel, which then is also the nearest
    }
    (whole, q15 | if nearest_is_next { STEP } else { 0 })
}

/// Room for exactly `count` entries, or an error instead of an abort.
pub(super) fn reserve<T>(entries: &mut Vec<T>, count: usize) -> Result<()> {
    let bytes = count.saturating_mul(size_of::<T>());
    entries.try_reserve_exact(count).map_err(|_| Error::OutOfMemory { what: "Lut", bytes })
}

#[cfg(test)]
mod tests {
    use super::*;

    const SOURCE: (u32, u32) = (5, 4);

    fn cell(u: f64, v: f64) -> (RunKind, Option<Tap>) {
        classify([u, v], SOURCE)
    }

    #[test]
    fn a_tap_is_eight_bytes_and_a_run_four() {
        assert_eq!((size_of::<Tap>(), size_of::<Run>()), (8, 4));
    }

    #[test]
    fn kinds_follow_the_rectangle_of_pixel_centres() {
        for (u, v, kind) in [
            (0.0, 0.0, RunKind::Inside),
            (3.999, 2.999, RunKind::Inside),
            (4.0, 1.0, RunKind::Rim),
            (1.0, 3.0, RunKind::Rim),
            (4.0, 3.0, RunKind::Rim),
            (3.9999999, 1.0, RunKind::Rim),
            (-1e-9, 1.0, RunKind::Halo),
            (4.0 + 1e-9, 1.0, RunKind::Halo),
            (-0.999, -0.999, RunKind::Halo),
            (4.999, 3.999, RunKind::Halo),
            (-1.0, 1.0, RunKind::Outside),
            (5.0, 1.0, RunKind::Outside),
            (1.0, 4.0, RunKind::Outside),
            (f64::NAN, 1.0, RunKind::Outside),
            (1.0, f64::INFINITY, RunKind::Outside),
            (-1e300, 1.0, RunKind::Outside),
        ] {
            assert_eq!(cell(u, v).0, kind, "({u}, {v})");
        }
    }

    #[test]
    fn a_source_of_one_pixel_is_all_rim() {
        assert_eq!(classify([0.0, 0.0], (1, 1)).0, RunKind::Rim);
        assert_eq!(classify([0.25, 0.0], (1, 1)).0, RunKind::Halo);
    }

    #[test]
    fn fractions_are_within_half_a_step_and_nearest_is_np_round() {
        for step in 0..100_000 {
            let u = -0.999 + f64::from(step) * 5.9e-5;
            let (whole, packed) = quantise(u);
            let tap = Tap { offset: 0, x: packed, y: 0 };
            let back = whole as f64 + f64::from(tap.fx()) / f64::from(ONE);
            assert!((back - u).abs() <= 0.5 / f64::from(ONE), "{u} {back}");
            assert_eq!(whole + i64::from(tap.step_x()), u.round_ties_even() as i64, "{u}");
        }
        for (u, nearest) in [(0.5, 0), (1.5, 2), (2.5, 2), (-0.5, 0), (1.4999999999999998, 1), (2.5000000000000004, 3)]
        {
            let (whole, packed) = quantise(u);
            assert_eq!(whole + i64::from(packed >> 15), nearest, "{u}");
        }
    }

    #[test]
    fn framed_offsets_undo() {
        for y in -1..=4 {
            for x in -1..=5 {
                assert_eq!(unframed(framed(x, y, 5), 5), (x, y));
            }
        }
    }

    #[test]
    fn rows_are_covered_without_a_gap() {
        let rows = 300;
        let table = Table::build((rows, 100), SOURCE, |row, cells| {
            for (column, cell) in cells.iter_mut().enumerate() {
                *cell = [column as f64 * 0.1 - 2.0 + row as f64 * 0.01, row as f64 * 0.02 - 1.5];
            }
        })
        .unwrap();
        let mut kinds = [0; 4];
        for row in 0..rows {
            let mut next = 0;
            for segment in table.row(row) {
                assert_eq!(segment.first, next);
                assert!(segment.cells > 0);
                assert_eq!(segment.taps.len(), if segment.kind == RunKind::Outside { 0 } else { segment.cells });
                kinds[segment.kind as usize] += segment.cells;
                next += segment.cells;
            }
            assert_eq!(next, 100);
        }
        assert!(kinds.iter().all(|&cells| cells > 0), "{kinds:?}");
    }

    #[test]
    fn at_most_twelve_bytes_a_cell_also_where_every_cell_is_a_run_of_its_own() {
        let cells = 200_000;
        let table = Table::build((1, cells), (3, 3), |_, row| {
            for (column, cell) in row.iter_mut().enumerate() {
                *cell = [[0.5, 0.5], [2.5, 2.5]][column % 2];
            }
        })
        .unwrap();
        assert!(table.nbytes() <= 12 * cells + 64, "{}", table.nbytes());
    }
}
