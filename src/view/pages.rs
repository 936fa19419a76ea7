//! Huge pages.

/// Asks the system for huge pages for a buffer's memory, before it is touched: of four megabytes in no order, each visit
/// waits for a table of pages too, which took a million points onto 500 x 500 cells from 5.7 to 12 ms. Where the system has
/// none, or always gives them, nothing happens.
pub(crate) fn ask_for_huge_pages<T>(buffer: &mut Vec<T>) {
    /// A page of the usual kind, at most: smaller ones divide it.
    const PAGE: usize = 1 << 16;
    /// Less than one huge page is not worth a call.
    const LEAST: usize = 1 << 21;
    let memory = buffer.spare_capacity_mut();
    let (start, bytes) = (memory.as_mut_ptr().cast::<u8>(), size_of_val(memory));
    let before = start.align_offset(PAGE);
    if bytes < LEAST + before {
        return;
    }
    advise(start.wrapping_add(before), bytes - before);
}

#[cfg(target_os = "linux")]
fn advise(start: *mut u8, bytes: usize) {
    use std::ffi::{c_int, c_void};

    unsafe extern "C" {
        fn madvise(start: *mut c_void, bytes: usize, advice: c_int) -> c_int;
    }
    /// The same number on every architecture of Linux.
    const MADV_HUGEPAGE: c_int = 14;
    // SAFETY: memory that the caller owns, from a page's start; the advice changes neither its contents nor who may use it,
    // and where it is not taken, that is only slower.
    unsafe { madvise(start.cast(), bytes, MADV_HUGEPAGE) };
}

#[cfg(not(target_os = "linux"))]
fn advise(_start: *mut u8, _bytes: usize) {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_stays_what_it_is() {
        for count in [0, 1, 1000, 3 << 20] {
            let mut buffer: Vec<u64> = Vec::with_capacity(count);
            ask_for_huge_pages(&mut buffer);
            buffer.resize(count, 7);
            assert!(buffer.iter().all(|&word| word == 7));
            ask_for_huge_pages(&mut buffer);
            assert_eq!(buffer.len(), count);
        }
    }
}
