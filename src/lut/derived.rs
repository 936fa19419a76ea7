//! What follows from a table and is worked out when it is first asked for.

use std::fmt;
use std::sync::{Arc, OnceLock};

/// A slot of a [`Lut`](super::Lut) for what follows from its table: empty at first, filled once, shared by all clones made
/// since. It says nothing that the table does not, so all slots are equal.
pub(super) struct Derived<T>(OnceLock<Arc<T>>);

impl<T> Clone for Derived<T> {
    fn clone(&self) -> Self {
        Self(self.0.clone())
    }
}

impl<T> Default for Derived<T> {
    fn default() -> Self {
        Self(OnceLock::new())
    }
}

impl<T> Derived<T> {
    pub(super) fn get(&self) -> Option<&T> {
        self.0.get().map(|value| &**value)
    }

    /// The value that there is now: this one, or one that another thread made meanwhile.
    pub(super) fn set(&self, value: T) -> &T {
        // not `get_or_init`, which would make a child wait for ever that is forked while another thread builds
        self.0.set(Arc::new(value)).ok();
        self.get().expect("set by us or by another")
    }
}

impl<T> PartialEq for Derived<T> {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl<T> fmt::Debug for Derived<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.get().is_some() { "Derived(made)" } else { "Derived" })
    }
}
