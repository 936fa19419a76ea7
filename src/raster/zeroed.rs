//! Buffers of zeros that may be refused.

use std::alloc::{Layout, alloc_zeroed};

use super::number::Plain;
use crate::error::{Error, Result};

/// So many zeros, which cost nothing before they are touched: of several threads, each pays for what it fills.
pub(super) fn zeroed<T: Plain>(what: &'static str, count: usize) -> Result<Vec<T>> {
    if count == 0 {
        return Ok(Vec::new());
    }
    let refuse = Error::OutOfMemory { what, bytes: count.saturating_mul(size_of::<T>()) };
    let layout = Layout::array::<T>(count).map_err(|_| refuse.clone())?;
    // SAFETY: the layout has a size, since neither `count` nor the size of a number is zero.
    let start = unsafe { alloc_zeroed(layout) }.cast::<T>();
    if start.is_null() {
        return Err(refuse);
    }
    // SAFETY: memory of the global allocator with the layout of `count` elements, all of them zero bytes, which are a
    // number of any `Plain` type; a `Vec` frees it with the same layout.
    Ok(unsafe { Vec::from_raw_parts(start, count, count) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zeros_or_a_refusal() {
        assert_eq!(zeroed::<f64>("test", 3), Ok(vec![0.0; 3]));
        assert_eq!(zeroed::<i32>("test", 0), Ok(vec![]));
        for count in [usize::MAX, usize::MAX / 8, isize::MAX as usize / 8 - 1] {
            assert!(matches!(zeroed::<f64>("test", count), Err(Error::OutOfMemory { .. })));
        }
    }
}
