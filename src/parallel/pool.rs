//! The threads that help.
//!
//! There is at most one pool that new calls take helpers from. A pool of another size, which calls that have begun may
//! still use, ends with the last of them: its threads are told to, and waited for.
//!
//! It is ours and not rayon's global one because a fork (PyTorch's DataLoader, multiprocessing) leaves a child with a
//! pool whose threads do not exist, and with locks that one of those threads may have held. So everything here is kept
//! for each process id: a child finds nothing of its own, makes it, and touches nothing of its parent's.

use std::io;
use std::ptr;
use std::sync::atomic::{AtomicPtr, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::{Builder, JoinHandle};
use std::time::{Duration, Instant};

use rayon::{ThreadPool, ThreadPoolBuilder};

use super::lock;

/// Threads that help, perhaps fewer than were asked for.
pub(super) struct Pool {
    /// `None` where the system gives no threads.
    threads: Option<ThreadPool>,
    handles: Vec<JoinHandle<()>>,
    wanted: usize,
    made: Instant,
}

impl Pool {
    /// As many threads as the system gives, `wanted` at most.
    fn new(wanted: usize) -> Self {
        let mut count = wanted;
        let (mut threads, mut handles) = (None, Vec::new());
        while count > 0 && threads.is_none() {
            threads = start(count, &mut handles).ok();
            count /= 2;
        }
        Self { threads, handles, wanted, made: Instant::now() }
    }

    /// Whether it is still the right one for so many. One that is too small, for lack of memory say, is not tried
    /// again at each call.
    fn serves(&self, wanted: usize) -> bool {
        const RETRY: Duration = Duration::from_secs(1);
        self.wanted == wanted && (self.helpers() == wanted || self.made.elapsed() < RETRY)
    }

    /// How many threads it has.
    pub(super) fn helpers(&self) -> usize {
        self.threads.as_ref().map_or(0, ThreadPool::current_num_threads)
    }

    /// Runs `help` on one of the threads as soon as one is free.
    pub(super) fn spawn(&self, help: impl FnOnce() + Send + 'static) {
        if let Some(threads) = &self.threads {
            threads.spawn(help);
        }
    }
}

impl Drop for Pool {
    fn drop(&mut self) {
        drop(self.threads.take()); // tells them to end
        end(&mut self.handles);
    }
}

/// So many threads, or none.
fn start(count: usize, handles: &mut Vec<JoinHandle<()>>) -> io::Result<ThreadPool> {
    let pool = ThreadPoolBuilder::new()
        .num_threads(count)
        .spawn_handler(|thread| {
            let builder = Builder::new().name(format!("ipm_rs-{}", thread.index()));
            handles.push(builder.spawn(|| thread.run())?);
            Ok(())
        })
        .build();
    pool.map_err(|error| {
        end(handles); // those that had started were told to end
        io::Error::other(error)
    })
}

/// Waits for threads that were told to end.
fn end(handles: &mut Vec<JoinHandle<()>>) {
    for handle in handles.drain(..) {
        // a helper's panic has reached its caller; there is nobody here to tell
        let _ = handle.join();
    }
}

/// What one process has. Never freed, and the lock is held by no more than one pool's making.
struct Process {
    id: u32,
    pool: Mutex<Option<Arc<Pool>>>,
    /// That of the process that this one was forked from.
    parent: *const Process,
}

/// This process's own, or that of the one that it was forked from.
static PROCESS: AtomicPtr<Process> = AtomicPtr::new(ptr::null_mut());

fn process() -> &'static Process {
    let id = std::process::id();
    let newest = PROCESS.load(Ordering::Acquire);
    let mut found = newest.cast_const();
    // SAFETY: null, or from `Box::into_raw` below, and nothing ever frees it.
    while let Some(process) = unsafe { found.as_ref() } {
        if process.id == id {
            return process;
        }
        found = process.parent;
    }
    let own = Box::into_raw(Box::new(Process { id, pool: Mutex::new(None), parent: newest }));
    match PROCESS.compare_exchange(newest, own, Ordering::AcqRel, Ordering::Acquire) {
        // SAFETY: made just now, never freed.
        Ok(_) => unsafe { &*own },
        Err(_) => {
            // SAFETY: made just now, and nobody else has seen it.
            drop(unsafe { Box::from_raw(own) });
            process() // another thread was faster
        }
    }
}

/// The pool of so many helpers.
pub(super) fn of(helpers: usize) -> Option<Arc<Pool>> {
    let mut pool = lock(&process().pool);
    if let Some(pool) = pool.as_ref().filter(|pool| pool.serves(helpers)) {
        return Some(Arc::clone(pool)).filter(|pool| pool.helpers() > 0);
    }
    let outgrown = pool.take();
    let new = pool.insert(Arc::new(Pool::new(helpers)));
    let new = Arc::clone(new);
    drop(pool);
    drop(outgrown); // it waits for its threads, if this was the last to hold it
    Some(new).filter(|pool| pool.helpers() > 0)
}

/// Lets go of a pool of any other size.
pub(super) fn release_unless(helpers: usize) {
    let outgrown = lock(&process().pool).take_if(|pool| pool.wanted != helpers);
    drop(outgrown);
}
