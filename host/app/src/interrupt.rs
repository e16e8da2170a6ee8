//! ^C, and the end of a process that was asked to end.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use echoloop_sensors::sensor::end_emulators;

/// What a shell says of a command that ^C ended: 128 + SIGINT.
pub(super) const INTERRUPTED: u8 = 130;

/// Set before the first emulator is stopped: what fails from then on fails for that.
static ENDING: AtomicBool = AtomicBool::new(false);

/// ^C asks the search to stop after what it is at; a second ^C ends the process.
pub(super) fn stop_on_interrupt() -> Arc<AtomicBool> {
    let stop = stop_once_listening();
    stop.listen();
    stop.asked
}

/// A wish to stop, and whether anybody listens to it.
pub(super) struct Stop {
    /// Set by ^C.
    pub(super) asked: Arc<AtomicBool>,
    heard: Arc<AtomicBool>,
}

impl Stop {
    /// From now on somebody looks at it, often.
    pub(super) fn listen(&self) {
        self.heard.store(true, Ordering::Relaxed);
    }
}

/// As [`stop_on_interrupt`], but as long as nobody listens the first ^C ends the process.
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

/// The first ^C ends the process, where nobody else waits for it: a process that just ended would
/// leave its emulators behind.
pub(super) fn end_on_interrupt() {
    let _ = ctrlc::set_handler(|| end_the_process());
}

/// Whether the process is being ended, so that a lost sensor is no news.
pub(super) fn is_ending() -> bool {
    ENDING.load(Ordering::SeqCst)
}

/// Stops the emulators, then the process. Whoever comes second stops what the first has not, waits
/// for what it is stopping, and ends with the same code.
pub(super) fn end_the_process() -> ! {
    ENDING.store(true, Ordering::SeqCst);
    end_emulators();
    std::process::exit(INTERRUPTED.into())
}
