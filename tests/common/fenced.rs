//! Memory between two pages that may not be touched: a single byte too many ends the process.

#![allow(dead_code, reason = "each test uses its part")]

use std::ptr;

use ipm_rs::Sample;

/// On which side the samples touch a page that may not be touched.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Guard {
    Before,
    After,
}

/// Every side of a source with every side of an output.
pub(crate) const GUARDS: [(Guard, Guard); 4] = [
    (Guard::After, Guard::After),
    (Guard::After, Guard::Before),
    (Guard::Before, Guard::After),
    (Guard::Before, Guard::Before),
];

/// Pages between two that may not be touched.
pub(crate) struct Fenced {
    start: *mut libc::c_void,
    page: usize,
    pages: usize,
}

impl Fenced {
    /// Room for so many bytes.
    pub(crate) fn new(bytes: usize) -> Self {
        // SAFETY: a question.
        let page = unsafe { libc::sysconf(libc::_SC_PAGESIZE) } as usize;
        let pages = bytes.div_ceil(page).max(1);
        let (access, flags) = (libc::PROT_READ | libc::PROT_WRITE, libc::MAP_PRIVATE | libc::MAP_ANONYMOUS);
        // SAFETY: a new mapping wherever there is room.
        let start = unsafe { libc::mmap(ptr::null_mut(), (pages + 2) * page, libc::PROT_NONE, flags, -1, 0) };
        assert_ne!(start, libc::MAP_FAILED);
        let fenced = Self { start, page, pages };
        // SAFETY: the pages between the first and the last of our own mapping.
        let opened = unsafe { libc::mprotect(fenced.open().cast(), pages * page, access) };
        assert_eq!(opened, 0);
        fenced
    }

    /// The first byte that may be touched.
    fn open(&self) -> *mut u8 {
        self.start.cast::<u8>().wrapping_add(self.page)
    }

    /// So many samples, all zero bits, beside one of the fences.
    pub(crate) fn samples<T: Sample>(&mut self, samples: usize, guard: Guard) -> &mut [T] {
        let (bytes, room) = (samples * size_of::<T>(), self.pages * self.page);
        assert!(bytes <= room);
        let from = match guard {
            Guard::Before => 0,
            Guard::After => room - bytes,
        };
        // SAFETY: they lie in our own pages, which this borrow keeps; `from` is a multiple of the samples' size, which is
        // a power of two; any bits are a number.
        unsafe {
            let first = self.open().add(from);
            first.write_bytes(0, bytes);
            std::slice::from_raw_parts_mut(first.cast(), samples)
        }
    }
}

impl Drop for Fenced {
    fn drop(&mut self) {
        // SAFETY: our own mapping, and nobody borrows it any more.
        unsafe { libc::munmap(self.start, (self.pages + 2) * self.page) };
    }
}
