//! What follows from a table and is worked out when it is first asked for.

use std::any::Any;
use std::fmt;
use std::sync::{Arc, OnceLock};

use crate::error::Result;
use crate::table::Table;

/// What a [`Lut`](super::Lut) keeps for those who work it out from its table: the plan of area, for one. The table itself
/// does not know what these are.
pub(crate) trait Derivative: Any + Send + Sync {
    /// Bytes that it holds.
    fn nbytes(&self) -> usize;
}

/// Kinds of derivatives that a table may have at once.
const KINDS: usize = 6;

/// Slots of a [`Lut`](super::Lut) for derivatives, one of each kind: empty at first, filled once, shared by all clones made
/// since. They say nothing that the table does not, and so have no part in equality or in pickles.
#[derive(Clone, Default)]
pub(super) struct Derived([OnceLock<Arc<dyn Derivative>>; KINDS]);

impl Derived {
    /// The derivative of this kind; made from the table where there is none yet.
    ///
    /// # Errors
    /// Those of `make`.
    pub(super) fn get_or_make<T: Derivative>(
        &self,
        table: &Table,
        make: impl FnOnce(&Table) -> Result<T>,
    ) -> Result<&T> {
        if let Some(found) = self.find() {
            return Ok(found);
        }
        // not `get_or_init`, which would make a child wait for ever that is forked while another thread builds
        let mut made: Arc<dyn Derivative> = Arc::new(make(table)?);
        for slot in &self.0 {
            match slot.set(made) {
                Ok(()) => break,
                Err(back) => made = back,
            }
            // another thread may have made the same meanwhile
            if slot.get().is_some_and(|there| is::<T>(&**there)) {
                break;
            }
        }
        Ok(self.find().expect("there is a slot for every kind"))
    }

    /// Bytes that all of them hold.
    pub(super) fn nbytes(&self) -> usize {
        self.0.iter().filter_map(OnceLock::get).map(|made| made.nbytes()).sum()
    }

    fn find<T: Derivative>(&self) -> Option<&T> {
        self.0.iter().filter_map(OnceLock::get).find_map(|made| (&**made as &dyn Any).downcast_ref())
    }
}

fn is<T: Derivative>(made: &dyn Derivative) -> bool {
    (made as &dyn Any).is::<T>()
}

impl fmt::Debug for Derived {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let count = self.0.iter().filter_map(OnceLock::get).count();
        write!(f, "Derived({count} made)")
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Barrier;
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;
    use crate::table::Edges;

    struct Plan(usize);

    impl Derivative for Plan {
        fn nbytes(&self) -> usize {
            100
        }
    }

    struct Weights(usize);

    impl Derivative for Weights {
        fn nbytes(&self) -> usize {
            10
        }
    }

    #[test]
    fn threads_that_make_the_same_at_once_share_what_came_first() {
        const THREADS: usize = 3;
        let (derived, table) = (Derived::default(), Table::empty((1, 1), (2, 2), Edges::default()).unwrap());
        let (together, made) = (Barrier::new(THREADS), AtomicUsize::new(0));
        let plan = |_: &Table| {
            together.wait(); // none is there until all of them make one
            Ok(Plan(made.fetch_add(1, Ordering::Relaxed)))
        };
        let found: Vec<usize> = std::thread::scope(|scope| {
            let threads: Vec<_> =
                (0..THREADS).map(|_| scope.spawn(|| derived.get_or_make(&table, plan).unwrap().0)).collect();
            threads.into_iter().map(|thread| thread.join().unwrap()).collect()
        });
        assert_eq!(made.into_inner(), THREADS);
        assert!(found.iter().all(|plan| *plan == found[0]), "{found:?}");
        assert_eq!(derived.nbytes(), 100, "one is kept");
        assert_eq!(derived.get_or_make(&table, |_| Ok(Weights(7))).unwrap().0, 7);
        assert_eq!(derived.get_or_make(&table, |_| Ok(Weights(8))).unwrap().0, 7, "made once");
        assert_eq!(derived.nbytes(), 110);
    }
}
