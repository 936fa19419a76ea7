//! Threads, and what long work answers to.
//!
//! A pool of our own, made on first use, sized by [`set_num_threads`], `IPM_RS_NUM_THREADS` or the CPUs that the process
//! may use. Work is handed out in jobs; where one fails, or where the caller is [interrupted](interruptible), no more
//! jobs begin.

mod crew;
pub(crate) mod error;
mod interrupt;
mod policy;
mod pool;

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

pub(crate) use interrupt::check_interrupt;
pub use interrupt::interruptible;
pub(crate) use policy::{Work, rows_per_band};

use crate::error::{Error, Result, ThreadsError};
use crew::Crew;

/// Threads asked for by [`set_num_threads`]; 0 before it is called.
static REQUESTED: AtomicUsize = AtomicUsize::new(0);

/// More threads than this bring nothing and may not be had from the system.
pub(crate) const MAX_THREADS: usize = 1024;

/// The environment variable that says how many threads a call uses when it does not say.
const VARIABLE: &str = "IPM_RS_NUM_THREADS";

/// Sets how many threads a call uses when it does not say; it takes effect at the next call. Threads of a pool of
/// another size end as soon as no call needs them.
///
/// # Errors
/// [`ThreadsError::Zero`] below 1, and [`ThreadsError::TooMany`] above 1024.
pub fn set_num_threads(threads: usize) -> Result<()> {
    check_threads(threads)?;
    if threads > MAX_THREADS {
        return Err(Error::Threads(ThreadsError::TooMany { got: threads, limit: MAX_THREADS }));
    }
    REQUESTED.store(threads, Ordering::Relaxed);
    pool::release_unless(threads - 1);
    Ok(())
}

/// How many threads a call uses when it does not say: that of [`set_num_threads`], else `IPM_RS_NUM_THREADS` if it is
/// a whole number from 1 to 1024, else the CPUs that the process may use (affinity and control groups respected).
pub fn num_threads() -> usize {
    // two threads may find it out at the same time; a lock that one of them held would be locked for ever in a child
    // that is forked meanwhile
    static DEFAULT: AtomicUsize = AtomicUsize::new(0);
    for known in [&REQUESTED, &DEFAULT] {
        match known.load(Ordering::Relaxed) {
            0 => {}
            threads => return threads,
        }
    }
    let from_environment = std::env::var(VARIABLE).ok().and_then(|value| threads_from(&value));
    let available = || std::thread::available_parallelism().map_or(1, usize::from).min(MAX_THREADS);
    let threads = from_environment.unwrap_or_else(available);
    DEFAULT.store(threads, Ordering::Relaxed);
    threads
}

/// What is wrong with `IPM_RS_NUM_THREADS`, whose value is then not heeded; `None` where it is not set, or empty, or a
/// number of threads.
pub fn ignored_variable() -> Option<String> {
    let value = std::env::var_os(VARIABLE)?;
    match value.to_str() {
        Some(text) if text.trim().is_empty() || threads_from(text).is_some() => None,
        _ => Some(format!(
            "{VARIABLE}: expected a whole number of threads from 1 to {MAX_THREADS}, got {value:?}, which is not heeded: \
             {} threads are used; correct it or unset it",
            num_threads()
        )),
    }
}

/// A number of threads that can be had.
fn threads_from(text: &str) -> Option<usize> {
    text.trim().parse().ok().filter(|threads| (1..=MAX_THREADS).contains(threads))
}

/// Refuses a thread count below one.
pub(crate) fn check_threads(threads: usize) -> Result<()> {
    if threads == 0 { Err(Error::Threads(ThreadsError::Zero { got: threads })) } else { Ok(()) }
}

/// Runs `work` on every job, at most `threads` at once, the caller's thread among them. Jobs are handed out in order
/// as threads come free, so bands of unequal cost even out. The caller waits for nobody who has not begun to help: a
/// pool that is busy with other callers, or whose threads get no CPU, costs it nothing.
///
/// Between jobs the caller asks whether it is to stop, so jobs should not take more than some 50 ms.
///
/// # Errors
/// The first that a job came back with, or [`Error::Interrupted`]: jobs that have not begun are then left.
pub(crate) fn for_each<J: Send>(
    threads: usize,
    mut jobs: impl Iterator<Item = J> + Send,
    work: impl Fn(J) -> Result<()> + Sync,
) -> Result<()> {
    let work = |job| work(job).and_then(|()| check_interrupt());
    let helpers = threads.min(num_threads()) - 1;
    let pool = if helpers == 0 { None } else { pool::of(num_threads() - 1) };
    let Some(pool) = pool else { return jobs.try_for_each(work) };
    let queue = Mutex::new(jobs);
    let next = || lock(&queue).next();
    let (failed, failure) = (AtomicBool::new(false), Mutex::new(None));
    let note = |error: Error| {
        lock(&failure).get_or_insert(error);
        failed.store(true, Ordering::Relaxed);
    };
    let drain = || {
        while !failed.load(Ordering::Relaxed)
            && let Some(job) = next()
        {
            work(job).unwrap_or_else(note);
        }
    };
    let crew = Crew::new(&drain);
    for _ in 0..helpers.min(pool.helpers()) {
        pool.spawn(crew.helper());
    }
    drain();
    crew.dismiss(|| check_interrupt().unwrap_or_else(note));
    let failure = lock(&failure).take();
    failure.map_or(Ok(()), Err)
}

/// Locks, also after a panic: what the locks here guard is never left half changed.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Enough that every thread has some; Miri takes a minute for fifty.
    const JOBS: usize = if cfg!(miri) { 50 } else { 1000 };

    #[test]
    fn every_job_runs_once_whatever_the_threads() {
        for threads in [1, 2, 3, 100] {
            let done: Vec<AtomicUsize> = (0..JOBS).map(|_| AtomicUsize::new(0)).collect();
            let work = |job: &AtomicUsize| {
                job.fetch_add(1, Ordering::Relaxed);
                Ok(())
            };
            assert_eq!(for_each(threads, done.iter(), work), Ok(()));
            assert!(done.iter().all(|job| job.load(Ordering::Relaxed) == 1));
        }
    }

    #[test]
    fn a_panic_reaches_the_caller_and_leaves_the_pool_usable() {
        if num_threads() == 1 {
            return; // nobody to meet at the barrier
        }
        for on_caller in [true, false] {
            let caller = std::thread::current().id();
            let result = std::panic::catch_unwind(|| {
                // barriers of two: caller and helper both take a job before one of them panics
                let both = std::sync::Barrier::new(2);
                for_each(2, 0..2, |_| {
                    both.wait();
                    assert!((std::thread::current().id() == caller) != on_caller, "on purpose");
                    Ok(())
                })
            });
            assert!(result.is_err());
            every_job_runs_once_whatever_the_threads();
        }
    }

    #[test]
    fn callers_do_not_wait_for_helpers_of_others() {
        let release = Mutex::new(());
        let held = lock(&release);
        std::thread::scope(|scope| {
            // occupies every thread of the pool until it is let go
            scope.spawn(|| {
                for_each(MAX_THREADS, 0..MAX_THREADS, |_| {
                    drop(lock(&release));
                    Ok(())
                })
            });
            std::thread::sleep(std::time::Duration::from_millis(20));
            every_job_runs_once_whatever_the_threads();
            drop(held);
        });
    }

    #[test]
    fn a_job_that_fails_ends_the_call_with_its_error() {
        for threads in [1, 3] {
            let begun = AtomicUsize::new(0);
            let result = for_each(threads, 0..100_000, |job| {
                begun.fetch_add(1, Ordering::Relaxed);
                if job == 7 { Err(Error::OutOfMemory { what: "test", bytes: job }) } else { Ok(()) }
            });
            assert_eq!(result, Err(Error::OutOfMemory { what: "test", bytes: 7 }));
            assert!(begun.into_inner() < 100_000);
        }
    }

    #[test]
    fn threads_are_numbers_from_1_to_1024() {
        for (text, threads) in [("1", Some(1)), (" 8\n", Some(8)), ("1024", Some(1024))] {
            assert_eq!(threads_from(text), threads);
        }
        for text in ["", "abc", "0", "-1", "2.5", "1025", "10000000000000000000000000", "0x4"] {
            assert_eq!(threads_from(text), None, "{text:?}");
        }
    }

    #[test]
    fn refuses_no_threads() {
        assert_eq!(set_num_threads(0), Err(Error::Threads(ThreadsError::Zero { got: 0 })));
        assert_eq!(set_num_threads(5000), Err(Error::Threads(ThreadsError::TooMany { got: 5000, limit: 1024 })));
        assert!(num_threads() >= 1);
    }
}
