//! Memory for the levels of an image, for one warp.

use std::mem::MaybeUninit;

use super::plan::Plan;
use crate::error::{Error, Result};
use crate::view::Sample;

/// Memory for the levels of an image, lent by a plan.
///
/// New memory is not set to 0 at once but row by row, each just before it is written: at once, it was a fifth of the time
/// that a plan of 10 cm cells takes.
pub(super) struct ScratchLease<'a> {
    plan: &'a Plan,
    /// The levels, or memory for them that was never written; it is empty then.
    words: Vec<u64>,
    count: usize,
}

impl<'a> ScratchLease<'a> {
    /// Memory for the levels of images of so many bytes a pixel.
    pub(super) fn new(plan: &'a Plan, pixel_bytes: usize) -> Result<Self> {
        let entries: usize = plan.levels.iter().map(|level| level.columns.len() * level.width as usize).sum();
        let count = (entries * pixel_bytes).div_ceil(8);
        let mut words = plan.scratch.take(count).unwrap_or_default();
        if words.len() < count {
            words.try_reserve_exact(count).map_err(|_| Error::OutOfMemory { what: "area", bytes: 8 * count })?;
            // of the last one samples may fill a part
            words.spare_capacity_mut()[count - 1].write(0);
        }
        Ok(Self { plan, words, count })
    }

    /// The samples of all levels, to be written.
    pub(super) fn samples<T: Sample>(&mut self) -> Samples<'_, T> {
        let (samples, written) = (8 * self.count / size_of::<T>(), self.words.len() >= self.count);
        // SAFETY: `words` has room for `count` of them, which are aligned for every sample; these may be unwritten.
        Samples { samples: unsafe { std::slice::from_raw_parts_mut(self.words.as_mut_ptr().cast(), samples) }, written }
    }

    /// The samples of all levels, to be read.
    ///
    /// # Safety
    /// Every one was written: of those that [`ScratchLease::samples`] gave, [`Samples::written`] was called for all of them.
    pub(super) unsafe fn written<T: Sample>(&mut self) -> &[T] {
        if self.words.len() < self.count {
            // SAFETY: there is room for them, and by the caller's word and `ScratchLease::new` all bytes were written.
            unsafe { self.words.set_len(self.count) };
        }
        // SAFETY: as in `samples`; they were written, and any bytes are samples.
        unsafe { std::slice::from_raw_parts(self.words.as_ptr().cast(), 8 * self.count / size_of::<T>()) }
    }
}

impl Drop for ScratchLease<'_> {
    fn drop(&mut self) {
        let words = std::mem::take(&mut self.words);
        // not one that has to be written first
        if !words.is_empty() {
            self.plan.scratch.give(words);
        }
    }
}

/// Samples that may not have been written yet.
pub(super) struct Samples<'a, T> {
    samples: &'a mut [MaybeUninit<T>],
    written: bool,
}

impl<'a, T: Sample> Samples<'a, T> {
    /// The first ones, so many; the others are left.
    pub(super) fn take(&mut self, count: usize) -> Self {
        let (own, others) = std::mem::take(&mut self.samples).split_at_mut(count);
        self.samples = others;
        Self { samples: own, ..*self }
    }

    /// So many at a time, and what is left at the end.
    pub(super) fn chunks(self, count: usize) -> impl ExactSizeIterator<Item = Self> + Send {
        let Self { samples, written } = self;
        samples.chunks_mut(count).map(move |samples| Self { samples, written })
    }

    /// To be written over: whatever was written before, or zeros.
    pub(super) fn written(self) -> &'a mut [T] {
        if !self.written {
            self.samples.fill(MaybeUninit::new(T::default()));
        }
        // SAFETY: they were written before or just now.
        unsafe { &mut *(std::ptr::from_mut(self.samples) as *mut [T]) }
    }
}
