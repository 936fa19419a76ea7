//! Work without the GIL, which Python's signals still reach.

use std::cell::{Cell, RefCell};
use std::rc::Rc;

use pyo3::prelude::*;

use crate::interruptible;

/// Runs `work` without the GIL. While it takes long, pending signals are handled now and then, if this is the main
/// thread, where Python handles them: what a handler raises (`KeyboardInterrupt` on Ctrl-C) ends the work and is raised
/// here; a handler that raises nothing lets it go on.
///
/// # Errors
/// What a handler raises; those of `work`.
pub(super) fn run<R: Send>(py: Python<'_>, work: impl FnOnce() -> crate::Result<R> + Send) -> PyResult<R> {
    let (result, raised) = py.detach(|| {
        let raised = Rc::new(RefCell::new(None));
        let (found, is_elsewhere) = (Rc::clone(&raised), Cell::new(false));
        let check = move || {
            if is_elsewhere.get() {
                return false; // another thread's calls need not wait for the GIL
            }
            // none where the interpreter is ending
            let handled = Python::try_attach(|py| {
                is_elsewhere.set(!is_main_thread(py)?);
                py.check_signals()
            });
            let Some(Err(error)) = handled else { return false };
            found.replace(Some(error));
            true
        };
        let result = interruptible(check, work);
        (result, raised.take())
    });
    match raised {
        Some(error) => Err(error),
        None => Ok(result?),
    }
}

fn is_main_thread(py: Python<'_>) -> PyResult<bool> {
    let threading = py.import("threading")?;
    let main = threading.call_method0("main_thread")?.getattr("ident")?;
    main.eq(threading.call_method0("get_ident")?)
}
