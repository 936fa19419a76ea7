//! Threads: a pool of our own, made on first use, sized by [`set_num_threads`], `IPM_RS_NUM_THREADS` or the CPUs that
//! the process may use.
//!
//! The pool is ours and not rayon's global one because a fork (PyTorch's DataLoader, multiprocessing) leaves a child
//! with a pool whose threads do not exist: here a child finds none for its process id and makes a fresh one.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock, PoisonError};

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
    // two threads may find it out at the same time; a lock that one of them held would be locked for ever in a child
    // that is forked meanwhile
    static DEFAULT: AtomicUsize = AtomicUsize::new(0);
    for known in [&REQUESTED, &DEFAULT] {
        match known.load(Ordering::Relaxed) {
            0 => {}
            threads => return threads,
        }
    }
    let from_environment = std::env::var("IPM_RS_NUM_THREADS").ok().and_then(|value| value.trim().parse().ok());
    let available = || std::thread::available_parallelism().map_or(1, usize::from);
    let threads = from_environment.filter(|&threads| threads > 0).unwrap_or_else(available).min(MAX_THREADS);
    DEFAULT.store(threads, Ordering::Relaxed);
    threads
}

/// Refuses a thread count below one.
pub(crate) fn check_threads(threads: usize) -> Result<()> {
    if threads == 0 { Err(Error::Threads { got: threads }) } else { Ok(()) }
}

/// Runs `work` on every job, at most `threads` at once, the caller's thread among them. Jobs are handed out in order
/// as threads come free, so bands of unequal cost even out. The caller waits for nobody who has not begun to help: a
/// pool that is busy with other callers, or whose threads get no CPU, costs it nothing.
pub(crate) fn for_each<J: Send>(threads: usize, jobs: impl Iterator<Item = J> + Send, work: impl Fn(J) + Sync) {
    let helpers = threads.min(MAX_THREADS) - 1;
    let pool = if helpers == 0 { None } else { pool(num_threads()) };
    let Some(pool) = pool else {
        jobs.for_each(work);
        return;
    };
    let queue = Mutex::new(jobs);
    let next = || lock(&queue).next();
    let drain = || {
        while let Some(job) = next() {
            work(job);
        }
    };
    let crew = Crew::new(&drain);
    for _ in 0..helpers.min(pool.current_num_threads()) {
        let helper = Arc::clone(&crew.0);
        pool.spawn(move || helper.help());
    }
    drain();
    crew.dismiss();
}

/// `work` of every item, in order; the result does not depend on `threads`. For work of 10 ns an item and more.
#[cfg(feature = "python")]
pub(crate) fn map<T: Sync, U: Send + Clone>(
    threads: usize,
    items: &[T],
    blank: U,
    work: impl Fn(&T) -> U + Sync,
) -> Vec<U> {
    /// A job of 10 us or more.
    const ITEMS_A_JOB: usize = 1024;
    let mut results = vec![blank; items.len()];
    let jobs = items.chunks(ITEMS_A_JOB).zip(results.chunks_mut(ITEMS_A_JOB));
    let threads = if items.len() <= 2 * ITEMS_A_JOB { 1 } else { threads };
    for_each(threads, jobs, |(items, results)| {
        for (result, item) in results.iter_mut().zip(items) {
            *result = work(item);
        }
    });
    results
}

/// The helpers of one call, which ends when the last of them who began to help has finished.
struct Crew<'a>(Arc<Shared>, std::marker::PhantomData<&'a ()>);

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
    fn new(work: &'a (dyn Fn() + Sync + 'a)) -> Self {
        // SAFETY: only the lifetime changes. `help` calls it between `close` not having come and `close` having
        // returned, which the crew's drop, within 'a, does at the latest.
        let work: &'static (dyn Fn() + Sync) = unsafe { std::mem::transmute(work) };
        let (state, idle) = (Mutex::default(), Condvar::new());
        Self(Arc::new(Shared { work: Work(work), state, idle }), std::marker::PhantomData)
    }

    /// Waits for those who help, and passes on a helper's panic.
    fn dismiss(self) {
        if let Some(panic) = self.0.close() {
            resume_unwind(panic);
        }
    }
}

impl Drop for Crew<'_> {
    fn drop(&mut self) {
        self.0.close();
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
    fn close(&self) -> Option<Box<dyn Any + Send>> {
        let mut state = lock(&self.state);
        state.closed = true;
        while state.helping > 0 {
            state = self.idle.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        state.panic.take()
    }
}

/// Locks, also after a panic: what the locks here guard is never left half changed.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// How many rows make a band: several bands for each thread, so that they even out and the last one is short, and none
/// too small to be worth handing out (50 ns against the 2 us or more of so many cells). With 8 bands for each of two
/// threads the seed job took 0.19 ms at best, with 4 or 2 it took 0.21 to 0.23, with 32 no less; one thread: 0.32.
pub(crate) fn rows_per_band(rows: usize, columns: usize, threads: usize) -> usize {
    const BANDS_PER_THREAD: usize = 8;
    const CELLS_PER_BAND: usize = 4096;
    let even = rows.div_ceil(threads.saturating_mul(BANDS_PER_THREAD));
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
    fn a_panic_reaches_the_caller_and_leaves_the_pool_usable() {
        if num_threads() == 1 {
            return; // nobody to meet at the barrier
        }
        for on_caller in [true, false] {
            let caller = std::thread::current().id();
            let result = catch_unwind(|| {
                // barriers of two: caller and helper both take a job before one of them panics
                let both = std::sync::Barrier::new(2);
                for_each(2, 0..2, |_| {
                    both.wait();
                    assert!((std::thread::current().id() == caller) != on_caller, "on purpose");
                });
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
            scope.spawn(|| for_each(MAX_THREADS, 0..MAX_THREADS, |_| drop(lock(&release))));
            std::thread::sleep(std::time::Duration::from_millis(20));
            every_job_runs_once_whatever_the_threads();
            drop(held);
        });
    }

    #[test]
    fn bands_cover_the_rows() {
        for (rows, columns, threads) in [(1, 1, 1), (860, 800, 2), (3, 1_000_000, 64), (1_000_000, 1, 3)] {
            let band = rows_per_band(rows, columns, threads);
            assert!((1..=rows).contains(&band));
        }
        assert_eq!(rows_per_band(860, 800, 2), 54);
    }

    #[test]
    fn refuses_no_threads() {
        assert_eq!(set_num_threads(0), Err(Error::Threads { got: 0 }));
        assert!(num_threads() >= 1);
    }
}
