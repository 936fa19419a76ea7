//! Stopping work that takes long, from outside.

use std::cell::RefCell;
use std::rc::Rc;
use std::time::{Duration, Instant};

use crate::error::{Error, Result};

/// How often work asks whether it is to stop. Whoever asks may have to wait for a lock of the interpreter's, so not
/// more often than it takes to be quick in a person's eyes.
pub(super) const INTERVAL: Duration = Duration::from_millis(50);

thread_local! {
    static WATCH: RefCell<Option<Watch>> = const { RefCell::new(None) };
}

struct Watch {
    check: Rc<dyn Fn() -> bool>,
    /// When to ask next.
    due: Instant,
}

/// Runs `work`, which asks `check` every 50 ms or so whether it is to stop, on this thread, and so never in a call that
/// is shorter. Where `check` says yes, calls of this crate within `work` come to an end soon, with
/// [`Error::Interrupted`]; what they were writing to is then written in part.
///
/// ```
/// use std::sync::Arc;
/// use std::sync::atomic::{AtomicBool, Ordering};
///
/// let stop = Arc::new(AtomicBool::new(false)); // set by another thread, or by a signal handler
/// let asked = Arc::clone(&stop);
/// let result = ipm_rs::interruptible(move || asked.load(Ordering::Relaxed), || {
///     ipm_rs::BevGrid::new((6.0, 36.0), (-8.0, 8.0), (0.1, 0.1), ipm_rs::SampleAt::Center)
/// });
/// assert!(result.is_ok());
/// ```
pub fn interruptible<R>(check: impl Fn() -> bool + 'static, work: impl FnOnce() -> R) -> R {
    /// Puts back what was watched before: `check` may itself call what is watched.
    struct Restore(Option<Watch>);
    impl Drop for Restore {
        fn drop(&mut self) {
            WATCH.set(self.0.take());
        }
    }
    let watch = Watch { check: Rc::new(check), due: Instant::now() + INTERVAL };
    let _restore = Restore(WATCH.replace(Some(watch)));
    work()
}

/// Whether this thread's work is to go on. It asks the clock each time, 30 ns or so: a row is a good step, a cell is not.
///
/// # Errors
/// [`Error::Interrupted`].
pub(crate) fn check_interrupt() -> Result<()> {
    let due = WATCH.with_borrow_mut(|watch| {
        let watch = watch.as_mut()?;
        let now = Instant::now();
        if now < watch.due {
            return None;
        }
        watch.due = now + INTERVAL;
        Some(Rc::clone(&watch.check))
    });
    // not borrowed any more: what is asked may come back here
    match due {
        Some(check) if check() => Err(Error::Interrupted),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;
    use std::thread::sleep;

    use super::*;

    #[test]
    fn short_work_is_not_asked_and_long_work_is() {
        let asked = Rc::new(Cell::new(0));
        let check = || {
            let asked = Rc::clone(&asked);
            move || {
                asked.set(asked.get() + 1);
                asked.get() > 1
            }
        };
        assert_eq!(interruptible(check(), check_interrupt), Ok(()));
        assert_eq!(asked.get(), 0);
        let long = || {
            sleep(INTERVAL);
            check_interrupt()?;
            check_interrupt()?; // just asked
            sleep(INTERVAL);
            check_interrupt()
        };
        assert_eq!(interruptible(check(), long), Err(Error::Interrupted));
        assert_eq!(asked.get(), 2);
    }

    #[test]
    fn nobody_asks_after_the_work_or_on_another_thread() {
        interruptible(
            || true,
            || {
                std::thread::scope(|scope| {
                    scope.spawn(|| {
                        sleep(INTERVAL);
                        assert_eq!(check_interrupt(), Ok(()));
                    });
                })
            },
        );
        sleep(INTERVAL);
        assert_eq!(check_interrupt(), Ok(()));
        interruptible(
            || true,
            || {
                interruptible(|| false, || ());
                sleep(INTERVAL);
                assert_eq!(check_interrupt(), Err(Error::Interrupted)); // the outer one again
            },
        );
    }

    #[test]
    fn jobs_stop_whoever_works_on_them() {
        for threads in [1, 4] {
            let begun = std::sync::atomic::AtomicUsize::new(0);
            let work = |_| {
                begun.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                sleep(Duration::from_millis(5));
                Ok(())
            };
            let result = interruptible(|| true, || super::super::for_each(threads, 0..10_000, work));
            assert_eq!(result, Err(Error::Interrupted));
            assert!(begun.into_inner() < 1000);
        }
    }
}
