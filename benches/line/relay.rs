//! Relay of a certain speed between two pseudo-terminals.

use std::io::{ErrorKind, Read, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use serialport::{SerialPort, TTYPort};

/// Bits per byte on a line.
const BITS_PER_BYTE: f64 = 10.0;
/// Polling interval of an idle direction.
const LOOK_UP: Duration = Duration::from_millis(1);

/// Carries bytes in both directions.
pub(crate) struct Relay {
    ways: [Way; 2],
}

/// A relay, and both ends of its line.
pub(crate) struct Ends {
    pub(crate) relay: Relay,
    pub(crate) host: TTYPort,
    pub(crate) board: TTYPort,
}

/// One direction.
struct Way {
    from: TTYPort,
    to: TTYPort,
    byte: Duration,
    /// Bytes sent at once: those of a millisecond.
    most: usize,
}

impl Relay {
    /// A line of this speed, with both ends.
    pub(crate) fn between_terminals(baud: u32) -> Ends {
        let pair = || TTYPort::pair().expect("terminals");
        let ((near, host), (far, board)) = (pair(), pair());
        let copy = |port: &TTYPort| port.try_clone_native().expect("a copy");
        let way = |from, to| Way::new(from, to, baud);
        let relay = Relay { ways: [way(copy(&near), copy(&far)), way(far, near)] };
        Ends { relay, host, board }
    }

    /// Carries bytes until told to stop.
    pub(crate) fn run(self, stop: &AtomicBool) {
        thread::scope(|scope| {
            for mut way in self.ways {
                scope.spawn(move || way.run(stop));
            }
        });
    }
}

impl Way {
    fn new(from: TTYPort, to: TTYPort, baud: u32) -> Self {
        let byte = Duration::from_secs_f64(BITS_PER_BYTE / f64::from(baud));
        let most = (LOOK_UP.as_secs_f64() / byte.as_secs_f64()).max(16.0) as usize;
        Self { from, to, byte, most }
    }

    /// Waits until a line would have carried this many more bytes. Time for which bytes waited for
    /// this thread counts.
    fn run(&mut self, stop: &AtomicBool) {
        let mut buffer = vec![0; self.most];
        let mut free = Instant::now();
        while !stop.load(Ordering::Relaxed) {
            self.from.set_timeout(LOOK_UP).expect("a terminal");
            let waiting = self.from.bytes_to_read().expect("a terminal") > 0;
            let length = match self.from.read(&mut buffer) {
                Ok(length) => length,
                Err(error) if error.kind() == ErrorKind::TimedOut => continue,
                Err(_) => return, // the other end is closed
            };
            if !waiting {
                free = free.max(Instant::now());
            }
            free += self.byte * length as u32;
            thread::sleep(free.saturating_duration_since(Instant::now()));
            self.to.set_timeout(Duration::from_secs(10)).expect("a terminal");
            if self.to.write_all(&buffer[..length]).is_err() {
                return;
            }
        }
    }
}
