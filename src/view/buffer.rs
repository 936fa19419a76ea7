//! Memory whose size a caller decides: it may be refused, which is an error and not the end of the process.

use bytemuck::Zeroable;

use crate::error::{Error, Result};

fn refused<T>(what: &'static str, count: usize) -> Error {
    Error::OutOfMemory { what, bytes: count.saturating_mul(size_of::<T>()) }
}

/// So many zeros, which cost nothing before they are touched: of several threads, each pays for what it fills.
pub(crate) fn zeroed<T: Zeroable>(what: &'static str, count: usize) -> Result<Vec<T>> {
    bytemuck::try_zeroed_vec(count).map_err(|()| refused::<T>(what, count))
}

/// Room for exactly so many elements.
pub(crate) fn reserved<T>(what: &'static str, count: usize) -> Result<Vec<T>> {
    let mut buffer = Vec::new();
    buffer.try_reserve_exact(count).map_err(|_| refused::<T>(what, count))?;
    Ok(buffer)
}

/// So many equal elements.
pub(crate) fn filled<T: Clone>(what: &'static str, count: usize, value: T) -> Result<Vec<T>> {
    let mut buffer = reserved(what, count)?;
    buffer.resize(count, value);
    Ok(buffer)
}

/// The elements of a slice.
pub(crate) fn copied<T: Clone>(what: &'static str, elements: &[T]) -> Result<Vec<T>> {
    let mut buffer = reserved(what, elements.len())?;
    buffer.extend_from_slice(elements);
    Ok(buffer)
}

/// What an iterator of known length gives.
pub(crate) fn collected<T>(what: &'static str, items: impl ExactSizeIterator<Item = T>) -> Result<Vec<T>> {
    let mut buffer = reserved(what, items.len())?;
    buffer.extend(items);
    Ok(buffer)
}

/// Makes room for so many more elements, and for as many again as there are, so that a buffer grows in few steps.
#[inline]
pub(crate) fn room_for<T>(what: &'static str, buffer: &mut Vec<T>, more: usize) -> Result<()> {
    buffer.try_reserve(more).map_err(|_| refused::<T>(what, buffer.len().saturating_add(more)))
}

/// Adds an element to a buffer of which nobody knows how long it gets.
#[inline]
pub(crate) fn push<T>(what: &'static str, buffer: &mut Vec<T>, element: T) -> Result<()> {
    room_for(what, buffer, 1)?;
    buffer.push(element);
    Ok(())
}

/// Makes a buffer so long, with `value` where it grows.
pub(crate) fn resize<T: Clone>(what: &'static str, buffer: &mut Vec<T>, count: usize, value: T) -> Result<()> {
    room_for(what, buffer, count.saturating_sub(buffer.len()))?;
    buffer.resize(count, value);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_can_be_had_is_what_was_asked_for() {
        assert_eq!(zeroed::<f64>("test", 3), Ok(vec![0.0; 3]));
        assert_eq!(zeroed::<[i32; 2]>("test", 2), Ok(vec![[0; 2]; 2]));
        assert_eq!(zeroed::<i32>("test", 0), Ok(vec![]));
        assert_eq!(filled("test", 2, 7u8), Ok(vec![7; 2]));
        assert_eq!(copied("test", &[1, 2, 3]), Ok(vec![1, 2, 3]));
        assert_eq!(collected("test", (0..4).map(|i| i * i)), Ok(vec![0, 1, 4, 9]));
        let mut buffer = vec![1u8];
        push("test", &mut buffer, 2).unwrap();
        resize("test", &mut buffer, 4, 9).unwrap();
        assert_eq!(buffer, [1, 2, 9, 9]);
        resize("test", &mut buffer, 1, 9).unwrap();
        assert_eq!(buffer, [1]);
    }

    #[test]
    fn what_cannot_be_had_is_an_error() {
        for count in [usize::MAX, usize::MAX / 8, isize::MAX as usize / 8 - 1] {
            let refused = Error::OutOfMemory { what: "test", bytes: count.saturating_mul(8) };
            assert_eq!(zeroed::<f64>("test", count), Err(refused.clone()));
            assert_eq!(reserved::<f64>("test", count), Err(refused.clone()));
            assert_eq!(filled("test", count, 0.5), Err(refused.clone()));
            assert_eq!(resize("test", &mut vec![0.0f64], count, 0.5), Err(refused));
        }
    }
}
