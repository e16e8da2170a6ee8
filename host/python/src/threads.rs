//! Threads of the work. A process that was forked off has none, and makes its own.

use std::process;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use pyo3::marker::Ungil;
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

/// Process that loaded the module: the threads of rayon are there.
static LOADED_IN: OnceLock<u32> = OnceLock::new();

/// Threads of another process, and which.
static POOL: Mutex<Option<(u32, Arc<ThreadPool>)>> = Mutex::new(None);

/// Remembers the process that loads the module.
pub(crate) fn loaded() {
    LOADED_IN.get_or_init(process::id);
}

/// Threads of a process that was forked off, as many as there are processors, or as
/// `RAYON_NUM_THREADS` says. None in the process that loaded the module.
fn pool() -> Option<Arc<ThreadPool>> {
    let own = process::id();
    if LOADED_IN.get().is_none_or(|loaded_in| *loaded_in == own) {
        return None;
    }
    let mut pool = POOL.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((_, pool)) = pool.as_ref().filter(|(process, _)| *process == own) {
        return Some(Arc::clone(pool));
    }
    let new = Arc::new(ThreadPoolBuilder::new().build().ok()?);
    // The threads of the process before are not here: nothing waits for them.
    std::mem::forget(pool.replace((own, Arc::clone(&new))));
    Some(new)
}

/// Work without the interpreter's lock, on the threads of this process.
pub(crate) fn detached<T: Ungil + Send>(
    py: Python<'_>,
    work: impl FnOnce() -> T + Ungil + Send,
) -> T {
    py.detach(|| match pool() {
        Some(pool) => pool.install(work),
        None => work(),
    })
}
