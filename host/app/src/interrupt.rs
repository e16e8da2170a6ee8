//! ^C: stopping work, and ending the process with its emulators.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use echoloop_sensors::sensor::end_emulators;

/// Exit code of a command that ^C ended: 128 + SIGINT.
pub(super) const INTERRUPTED: u8 = 130;

/// Set before the first emulator is stopped: later failures come of that.
static ENDING: AtomicBool = AtomicBool::new(false);

/// ^C sets a flag, which the work looks at; a second ^C ends the process.
pub(super) fn stop_on_interrupt() -> Arc<AtomicBool> {
    let stop = stop_once_listening();
    stop.listen();
    stop.asked
}

/// Request to stop, and whether the work looks at it.
pub(super) struct Stop {
    /// Set by ^C.
    pub(super) asked: Arc<AtomicBool>,
    heard: Arc<AtomicBool>,
}

impl Stop {
    /// From now on the work looks at it, often.
    pub(super) fn listen(&self) {
        self.heard.store(true, Ordering::Relaxed);
    }
}

/// [`stop_on_interrupt`], but until [`Stop::listen`] the first ^C ends the process.
pub(super) fn stop_once_listening() -> Stop {
    let [asked, heard] = [(); 2].map(|()| Arc::new(AtomicBool::new(false)));
    let (flag, listens) = (Arc::clone(&asked), Arc::clone(&heard));
    // Without a handler ^C just ends the process; the journal holds every whole generation either
    // way.
    let _ = ctrlc::set_handler(move || {
        if flag.swap(true, Ordering::Relaxed) || !listens.load(Ordering::Relaxed) {
            end_the_process();
        }
    });
    Stop { asked, heard }
}

/// The first ^C ends the process and its emulators, where no other handler is set.
pub(super) fn end_on_interrupt() {
    let _ = ctrlc::set_handler(|| end_the_process());
}

/// True while the process is being ended, so that a lost sensor is not reported.
pub(super) fn is_ending() -> bool {
    ENDING.load(Ordering::SeqCst)
}

/// Stops the emulators, then the process. A second thread helps, waits for the first and ends with
/// the same code.
pub(super) fn end_the_process() -> ! {
    ENDING.store(true, Ordering::SeqCst);
    end_emulators();
    std::process::exit(INTERRUPTED.into())
}
