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
