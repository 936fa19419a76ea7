//! Threads: a pool of our own, made on first use, sized by [`set_num_threads`], `IPM_RS_NUM_THREADS` or the CPUs that
//! the process may use.
//!
//! The pool is ours and not rayon's global one because a fork (PyTorch's DataLoader, multiprocessing) leaves a child
//! with a pool whose threads do not exist: here a child finds none for its process id and makes a fresh one.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, OnceLock, PoisonError};

use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::error::{Error, Result};

/// Threads asked for by [`set_num_threads`]; 0 before it is called.
static REQUESTED: AtomicUsize = AtomicUsize::new(0);

/// More threads than this bring nothing and may not be had from the system.
const MAX_THREADS: usize = 1024;

/// Sets how many threads a call uses when it does not say; it takes effect at the next call.
///
/// # Errors
/// [`Error::Threads`] below 1.
pub fn set_num_threads(threads: usize) -> Result<()> {
    check_threads(threads)?;
    REQUESTED.store(threads.min(MAX_THREADS), Ordering::Relaxed);
    Ok(())
}

/// How many threads a call uses when it does not say: that of [`set_num_threads`], else `IPM_RS_NUM_THREADS` if it is
/// a positive integer, else the CPUs that the process may use (affinity and control groups respected).
pub fn num_threads() -> usize {
    static DEFAULT: OnceLock<usize> = OnceLock::new();
    match REQUESTED.load(Ordering::Relaxed) {
        0 => *DEFAULT.get_or_init(|| {
            let from_environment = std::env::var("IPM_RS_NUM_THREADS").ok().and_then(|value| value.trim().parse().ok());
            let available = || std::thread::available_parallelism().map_or(1, usize::from);
            from_environment.filter(|&threads| threads > 0).unwrap_or_else(available).min(MAX_THREADS)
        }),
        threads => threads,
    }
}

/// Refuses a thread count below one.
pub(crate) fn check_threads(threads: usize) -> Result<()> {
    if threads == 0 { Err(Error::Threads { got: threads }) } else { Ok(()) }
}

/// Runs `work` on every job, at most `threads` at once, the caller's thread among them. Jobs are handed out in order
/// as threads come free, so bands of unequal cost even out.
pub(crate) fn for_each<J: Send>(threads: usize, jobs: impl Iterator<Item = J> + Send, work: impl Fn(J) + Sync) {
    let helpers = threads.min(MAX_THREADS) - 1;
    let pool = if helpers == 0 { None } else { pool(num_threads()) };
    let Some(pool) = pool else {
        jobs.for_each(work);
        return;
    };
    let queue = Mutex::new(jobs);
    let next = || queue.lock().unwrap_or_else(PoisonError::into_inner).next();
    let drain = || {
        while let Some(job) = next() {
            work(job);
        }
    };
    pool.in_place_scope(|scope| {
        for _ in 0..helpers.min(pool.current_num_threads()) {
            scope.spawn(|_| drain());
        }
        drain();
    });
}

/// How many rows make a band: a few bands for each thread, so that they even out, and none too small to be worth
/// handing out.
pub(crate) fn rows_per_band(rows: usize, columns: usize, threads: usize) -> usize {
    const BANDS_PER_THREAD: usize = 4;
    const CELLS_PER_BAND: usize = 8192;
    let even = rows.div_ceil(threads * BANDS_PER_THREAD);
    even.max(CELLS_PER_BAND.div_ceil(columns.max(1))).min(rows.max(1))
}

/// The pool of this process for that many threads, one of which is the caller; `None` where there is nobody to help
/// or the system gives no threads.
fn pool(threads: usize) -> Option<&'static ThreadPool> {
    /// A list that only grows: a pool for each process id and size that was ever used. Nothing in it is locked while
    /// a pool works, so a fork at any moment leaves the child a readable list.
    struct Entry {
        process: u32,
        threads: usize,
        pool: Option<ThreadPool>,
        next: OnceLock<Box<Entry>>,
    }
    static FIRST: OnceLock<Box<Entry>> = OnceLock::new();

    let process = std::process::id();
    let mut slot = &FIRST;
    loop {
        if let Some(entry) = slot.get() {
            if entry.process == process && entry.threads == threads {
                return entry.pool.as_ref();
            }
            slot = &entry.next;
            continue;
        }
        // made before it is put in place: the slot is never held while threads start
        let pool = (threads > 1)
            .then(|| ThreadPoolBuilder::new().num_threads(threads - 1).thread_name(|i| format!("ipm_rs-{i}")).build())
            .and_then(Result::ok);
        // another thread may have been faster: then its entry is looked at next
        let _ = slot.set(Box::new(Entry { process, threads, pool, next: OnceLock::new() }));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_job_runs_once_whatever_the_threads() {
        for threads in [1, 2, 3, 100] {
            let done: Vec<AtomicUsize> = (0..1000).map(|_| AtomicUsize::new(0)).collect();
            for_each(threads, done.iter(), |job| {
                job.fetch_add(1, Ordering::Relaxed);
            });
            assert!(done.iter().all(|job| job.load(Ordering::Relaxed) == 1));
        }
    }

    #[test]
    fn bands_cover_the_rows() {
        for (rows, columns, threads) in [(1, 1, 1), (860, 800, 2), (3, 1_000_000, 64), (1_000_000, 1, 3)] {
            let band = rows_per_band(rows, columns, threads);
            assert!((1..=rows).contains(&band));
        }
        assert_eq!(rows_per_band(860, 800, 2), 108);
    }

    #[test]
    fn refuses_no_threads() {
        assert_eq!(set_num_threads(0), Err(Error::Threads { got: 0 }));
        assert!(num_threads() >= 1);
    }
}
