//! Memory for the levels of an image, between warps.

use std::sync::Mutex;

/// Memory that was written.
pub(crate) type Words = Vec<u64>;

/// The memory that warps of a plan have given back. A plan that is dropped leaves it to the next ones of the process: who
/// makes a table for each frame, because the camera pitches, would else pay for new memory in each. It was a tenth of the
/// time that table and plan of 10 cm cells take, a fifth of that of 20 cm cells.
#[derive(Debug, Default)]
pub(crate) struct ScratchPool(Mutex<Vec<Words>>);

/// A plan and the process keep no more of them than this.
const KEPT: usize = 2;

/// Of dropped plans no larger ones are kept than this many words: 16 MB. Levels of 3840 x 2160 pixels of 3 bytes are 3 MB
/// (20 cm cells) to 15 MB (5 x 2.5 cm).
const MOST_LEFT: usize = 1 << 21;

/// What dropped plans have left.
static LEFT: Mutex<Vec<Words>> = Mutex::new(Vec::new());

impl ScratchPool {
    /// Memory of so many words or more, if there is some.
    pub(crate) fn take(&self, words: usize) -> Option<Words> {
        take(&self.0, |room| room.len() >= words)
            .or_else(|| take(&LEFT, |room| (words..=words + words / 4).contains(&room.len())))
    }

    /// Takes memory back.
    pub(crate) fn give(&self, room: Words) {
        give(&self.0, room);
    }

    /// Bytes that it holds.
    pub(crate) fn nbytes(&self) -> usize {
        self.0.try_lock().map_or(0, |scratch| scratch.iter().map(|room| 8 * room.capacity()).sum())
    }
}

impl Drop for ScratchPool {
    fn drop(&mut self) {
        let own = self.0.get_mut().map(std::mem::take).unwrap_or_default();
        own.into_iter().filter(|room| room.len() <= MOST_LEFT).for_each(|room| give(&LEFT, room));
    }
}

/// One that will do. A list that is in use elsewhere is not waited for: a child may have been forked meanwhile.
fn take(scratch: &Mutex<Vec<Words>>, will_do: impl Fn(&Words) -> bool) -> Option<Words> {
    let mut scratch = scratch.try_lock().ok()?;
    let found = scratch.iter().rposition(will_do)?;
    Some(scratch.remove(found))
}

/// Keeps one in place of the oldest, if there are enough.
fn give(scratch: &Mutex<Vec<Words>>, room: Words) {
    let Ok(mut scratch) = scratch.try_lock() else { return };
    if scratch.len() >= KEPT {
        scratch.remove(0);
    }
    scratch.push(room);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_ones_are_kept_and_taken_first() {
        let scratch = ScratchPool::default();
        (1..=3).for_each(|words| scratch.give(vec![words; 100 * words as usize]));
        assert_eq!(scratch.nbytes(), 8 * (200 + 300));
        assert_eq!(take(&scratch.0, |room| room.len() >= 301), None);
        assert_eq!(scratch.take(150), Some(vec![3; 300]));
        assert_eq!(scratch.take(150), Some(vec![2; 200]));
        assert_eq!(scratch.nbytes(), 0);
    }

    #[test]
    fn nobody_waits_for_a_list_in_use() {
        let scratch = ScratchPool::default();
        scratch.give(vec![0; 10]);
        let held = scratch.0.lock().expect("nobody panicked");
        assert_eq!(take(&scratch.0, |_| true), None);
        give(&scratch.0, vec![0; 10]);
        assert_eq!(scratch.nbytes(), 0);
        drop(held);
        assert_eq!(scratch.nbytes(), 80);
    }

    #[test]
    fn dropped_plans_leave_what_is_not_too_large() {
        let too_large = ScratchPool::default();
        too_large.give(vec![0; MOST_LEFT + 1]);
        drop(too_large);
        let is_left = |words| LEFT.lock().expect("nobody panicked").iter().any(|room| room.len() == words);
        assert!(!is_left(MOST_LEFT + 1));
        // other tests leave theirs meanwhile
        let left = (0..1000).any(|_| {
            let scratch = ScratchPool::default();
            scratch.give(vec![0; 4321]);
            drop(scratch);
            is_left(4321)
        });
        assert!(left);
        // nobody takes one that is a quarter larger than needed
        assert_eq!(ScratchPool::default().take(3000).filter(|room| room.len() == 4321), None);
    }
}
