//! How many threads a call uses, and in what portions its work is handed to them.

use super::{check_threads, num_threads};
use crate::error::Result;

/// How much a call has to do, in the bytes that could be moved in the same time: about 0.07 ns each.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Work(usize);

impl Work {
    /// Less work than this is done by the caller's thread alone: some 20 us.
    ///
    /// A helper begins 5 to 20 us after it was called, so two threads beat one where one takes more than about 20 us.
    /// Measured at 220 kB for 8-bit bilinear with AVX-512 (0.05 ns a byte) and for nearest, at 150 kB for float32 of 3
    /// and of 16 channels in scalar code (0.1 ns).
    const INLINE: usize = 1 << 18;

    /// A portion of this much is worth being handed to a thread by itself.
    const PORTION: usize = Self::INLINE / 8;

    /// To read or write so many bytes.
    pub(crate) fn bytes(count: usize) -> Self {
        Self(count)
    }

    /// To take so many cells of so many bytes through a table: what is written, and a tap of the table. What the time goes
    /// with is these, whatever the dtype and the number of channels: the pixels come from the caches for the most part.
    pub(crate) fn warp(cells: usize, pixel_bytes: usize) -> Self {
        const TAP: usize = 8;
        Self(cells.saturating_mul(pixel_bytes + TAP))
    }

    /// To build a table or a plan of so many cells: 16384 of them take about 15 us.
    pub(crate) fn table(cells: usize) -> Self {
        Self(cells.saturating_mul(16))
    }

    /// At most how many threads to use, where the caller asked for so many, or for none in particular.
    ///
    /// # Errors
    /// [`ThreadsError::Zero`] for none at all.
    pub(crate) fn threads(self, requested: Option<usize>) -> Result<usize> {
        let threads = requested.unwrap_or_else(num_threads);
        check_threads(threads)?;
        Ok(if self.0 < Self::INLINE { 1 } else { threads })
    }

    /// At most how many threads to use in a call that takes no number of them.
    pub(crate) fn threads_unasked(self) -> usize {
        if self.0 < Self::INLINE { 1 } else { num_threads() }
    }

    /// How many pieces of this much work make a portion that is worth being handed to a thread.
    pub(crate) fn pieces_together(self) -> usize {
        Self::PORTION.div_ceil(self.0.max(1))
    }
}

/// How many rows make a band: several bands for each thread, so that they even out and the last one is short, and none
/// too small to be worth handing out (50 ns against the 2 us or more of so many cells). With 8 bands for each of two
/// threads the seed job took 0.19 ms at best, with 4 or 2 it took 0.21 to 0.23, with 32 no less; one thread: 0.32.
/// None is so large that whoever interrupts the call waits: a cell of `mode` or `area` takes up to 100 ns.
pub(crate) fn rows_per_band(rows: usize, columns: usize, threads: usize) -> usize {
    const BANDS_PER_THREAD: usize = 8;
    const FEWEST_CELLS: usize = 4096;
    const MOST_CELLS: usize = 1 << 18;
    let even = rows.div_ceil(threads.saturating_mul(BANDS_PER_THREAD));
    let (fewest, most) = (FEWEST_CELLS.div_ceil(columns.max(1)), MOST_CELLS / columns.max(1));
    even.min(most).max(fewest).min(rows.max(1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::{Error, ThreadsError};

    #[test]
    fn little_work_stays_with_the_caller() {
        for (work, threads) in [
            (Work::bytes((1 << 18) - 1), 1),
            (Work::bytes(1 << 18), 7),
            (Work::table((1 << 14) - 1), 1),
            (Work::table(1 << 14), 7),
            (Work::warp(20_000, 3), 1),
            (Work::warp(860 * 800, 3), 7),
            (Work::table(usize::MAX), 7),
        ] {
            assert_eq!(work.threads(Some(7)), Ok(threads), "{work:?}");
            assert_eq!(work.threads_unasked(), if threads == 1 { 1 } else { num_threads() }, "{work:?}");
        }
        assert_eq!(
            Work::bytes(1).threads(Some(0)),
            Err(Error::Threads(ThreadsError::Zero { got: 0 })),
            "however little there is to do"
        );
    }

    #[test]
    fn small_pieces_are_handed_out_together() {
        assert_eq!(Work::bytes(1 << 20).pieces_together(), 1);
        assert_eq!(Work::warp(64, 8).pieces_together(), 32);
        assert!(Work::bytes(0).pieces_together() > 1);
    }

    #[test]
    fn bands_cover_the_rows() {
        for (rows, columns, threads) in [(1, 1, 1), (860, 800, 2), (3, 1_000_000, 64), (1_000_000, 1, 3)] {
            let band = rows_per_band(rows, columns, threads);
            assert!((1..=rows).contains(&band));
            assert!(band == 1 || band * columns <= 1 << 18);
        }
        assert_eq!(rows_per_band(860, 800, 2), 54);
    }
}
