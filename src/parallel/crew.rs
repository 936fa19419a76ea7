//! The helpers of one call.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::{Arc, Condvar, Mutex, PoisonError};

use super::interrupt::INTERVAL;
use super::lock;

/// The helpers of one call, which ends when the last of them who began to help has finished.
pub(super) struct Crew<'a>(Arc<Shared>, std::marker::PhantomData<&'a ()>);

struct Shared {
    /// The call's work, borrowed by its [`Crew`] and forgotten by `close`.
    work: Work,
    state: Mutex<State>,
    /// Told when `helping` falls to 0.
    idle: Condvar,
}

struct Work(*const (dyn Fn() + Sync));

// SAFETY: a shared reference to something that is `Sync`, under another name.
unsafe impl Send for Work {}
// SAFETY: likewise.
unsafe impl Sync for Work {}

#[derive(Default)]
struct State {
    closed: bool,
    helping: usize,
    panic: Option<Box<dyn Any + Send>>,
}

impl<'a> Crew<'a> {
    pub(super) fn new(work: &'a (dyn Fn() + Sync + 'a)) -> Self {
        // SAFETY: only the lifetime changes. `help` calls it between `close` not having come and `close` having
        // returned, which the crew's drop, within 'a, does at the latest.
        let work: &'static (dyn Fn() + Sync) = unsafe { std::mem::transmute(work) };
        let (state, idle) = (Mutex::default(), Condvar::new());
        Self(Arc::new(Shared { work: Work(work), state, idle }), std::marker::PhantomData)
    }

    /// What a thread runs to help; nothing once the call has ended.
    pub(super) fn helper(&self) -> impl FnOnce() + Send + 'static {
        let shared = Arc::clone(&self.0);
        move || shared.help()
    }

    /// Waits for those who help, calling `meanwhile` now and then, and passes on a helper's panic.
    pub(super) fn dismiss(self, meanwhile: impl Fn()) {
        if let Some(panic) = self.0.close(meanwhile) {
            resume_unwind(panic);
        }
    }
}

impl Drop for Crew<'_> {
    fn drop(&mut self) {
        self.0.close(|| ());
    }
}

impl Shared {
    fn help(&self) {
        {
            let mut state = lock(&self.state);
            if state.closed {
                return;
            }
            state.helping += 1;
        }
        // SAFETY: not closed when this helper was counted, so `close` waits for it; see `Crew::new`.
        let result = catch_unwind(AssertUnwindSafe(|| unsafe { (*self.work.0)() }));
        let mut state = lock(&self.state);
        state.helping -= 1;
        if let Err(panic) = result {
            state.panic = Some(panic);
        }
        if state.helping == 0 {
            self.idle.notify_one();
        }
    }

    /// Lets nobody begin any more, waits for those who have, and returns what one of them panicked with.
    fn close(&self, meanwhile: impl Fn()) -> Option<Box<dyn Any + Send>> {
        let mut state = lock(&self.state);
        state.closed = true;
        while state.helping > 0 {
            let waited = self.idle.wait_timeout(state, INTERVAL).unwrap_or_else(PoisonError::into_inner);
            state = waited.0;
            if waited.1.timed_out() {
                drop(state); // helpers that end need it
                meanwhile();
                state = lock(&self.state);
            }
        }
        state.panic.take()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

    use super::*;

    /// A helper that comes just as the call ends: whichever is first, its work is not done once the call is over, when
    /// what it borrows may be gone. Miri finds what threads hardly do: it stops them anywhere.
    #[test]
    fn nobody_begins_to_help_once_the_call_has_ended() {
        const CALLS: usize = if cfg!(miri) { 200 } else { 500 };
        let (open, late, helped) = (AtomicBool::new(false), AtomicUsize::new(0), AtomicUsize::new(0));
        // outlives all calls here, so that one that comes too late is counted and harms nobody
        let work = || {
            helped.fetch_add(1, Ordering::Relaxed);
            late.fetch_add(usize::from(!open.load(Ordering::SeqCst)), Ordering::Relaxed);
        };
        let offered = Mutex::new(None);
        let (begun, answered) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let wait_for = |count: &AtomicUsize, call: usize| {
            while count.load(Ordering::SeqCst) < call {
                std::thread::yield_now();
            }
        };
        std::thread::scope(|scope| {
            scope.spawn(|| {
                for call in 1..=CALLS {
                    wait_for(&begun, call);
                    let help: Option<Box<dyn FnOnce() + Send>> = lock(&offered).take();
                    if let Some(help) = help {
                        help();
                    }
                    answered.store(call, Ordering::SeqCst);
                }
            });
            for call in 1..=CALLS {
                let crew = Crew::new(&work);
                *lock(&offered) = Some(Box::new(crew.helper()));
                open.store(true, Ordering::SeqCst);
                begun.store(call, Ordering::SeqCst);
                // ends at another moment of the helper's way each time; Miri goes over to the helper at a hint, and comes
                // back at any step of it
                for _ in 0..if cfg!(miri) { 1 } else { call % 256 } {
                    std::hint::spin_loop();
                }
                crew.dismiss(|| ());
                open.store(false, Ordering::SeqCst);
                wait_for(&answered, call);
            }
        });
        assert_eq!(late.into_inner(), 0, "of {CALLS}, {helped:?} were helped");
    }
}
