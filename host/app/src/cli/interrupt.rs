//! ^C.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::link::sensor::end_emulators;

/// ^C asks the search to stop after what it is at; a second ^C ends the process.
pub(super) fn stop_on_interrupt() -> Arc<AtomicBool> {
    let stop = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&stop);
    // Without a handler ^C just ends the process; the journal holds every whole generation either
    // way.
    let _ = ctrlc::set_handler(move || {
        if flag.swap(true, Ordering::Relaxed) {
            end_emulators();
            std::process::exit(130);
        }
    });
    stop
}
