//! Stores past the caches.

use super::Sample;
use super::number::{as_bytes, as_bytes_mut};

/// Copies samples to memory that nobody reads soon, past the caches: a line of it is then not read before it is written,
/// which is half of what goes over the memory's bus. After the last one there must be a [`settle`].
#[inline(always)]
pub(crate) fn stream<T: Sample>(from: &[T], to: &mut [T]) {
    let (from, to) = (as_bytes(from), as_bytes_mut(to));
    assert_eq!(from.len(), to.len(), "as many as there is room for");
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_mm_loadu_si128, _mm_stream_si128};
        let before = to.as_ptr().align_offset(16).min(to.len());
        let ((from_head, from), (head, to)) = (from.split_at(before), to.split_at_mut(before));
        head.copy_from_slice(from_head);
        let ((from, from_tail), (to, tail)) = (from.as_chunks::<16>(), to.as_chunks_mut::<16>());
        for (from, to) in from.iter().zip(to) {
            // SAFETY: SSE2 is part of x86-64; 16 bytes each, of which those that are written to are aligned.
            unsafe { _mm_stream_si128(to.as_mut_ptr().cast(), _mm_loadu_si128(from.as_ptr().cast())) };
        }
        tail.copy_from_slice(from_tail);
    }
    #[cfg(not(target_arch = "x86_64"))]
    to.copy_from_slice(from);
}

/// Orders what [`stream`] has written before everything that follows, for other threads.
#[inline(always)]
pub(crate) fn settle() {
    #[cfg(target_arch = "x86_64")]
    // SAFETY: SSE is part of x86-64; a fence touches no memory.
    unsafe {
        std::arch::x86_64::_mm_sfence();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn copies_all_of_it_and_nothing_else() {
        let from: Vec<u8> = (0..200).collect();
        for first in 0..20 {
            for count in (0..40).chain([64, 100, 170]) {
                let mut to = [255u8; 200];
                stream(&from[..count], &mut to[first..first + count]);
                settle();
                assert_eq!(to[first..first + count], from[..count]);
                assert!(to[..first].iter().chain(&to[first + count..]).all(|&byte| byte == 255));
            }
        }
    }
}
