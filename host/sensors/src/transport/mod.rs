//! Transports of the link's bytes.

mod in_process;
mod serial;

use std::io;
use std::time::{Duration, Instant};

pub use in_process::InProcess;
pub use serial::{NativePort, Serial};

/// Time without a byte taken after which a line is lost.
const STUCK: Duration = Duration::from_secs(5);

/// Longest wait before `stop` is looked at again.
pub(super) const LOOK_UP: Duration = Duration::from_millis(100);

/// Line of bytes to a sensor. Bytes may be lost, changed or late: the client retries.
pub trait Transport {
    /// Sends all bytes.
    ///
    /// # Errors
    ///
    /// When the line is lost.
    fn send(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// Sends bytes from the first on, and returns how many were taken before the timeout. A line
    /// that never blocks takes them all.
    ///
    /// # Errors
    ///
    /// When the line is lost.
    fn send_some(&mut self, bytes: &[u8], _timeout: Duration) -> io::Result<usize> {
        self.send(bytes).map(|()| bytes.len())
    }

    /// Receives some bytes; 0 at the timeout.
    ///
    /// # Errors
    ///
    /// When the line is lost.
    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize>;
}

impl<T: Transport + ?Sized> Transport for Box<T> {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        (**self).send(bytes)
    }

    fn send_some(&mut self, bytes: &[u8], timeout: Duration) -> io::Result<usize> {
        (**self).send_some(bytes, timeout)
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        (**self).receive(buffer, timeout)
    }
}

/// True when a call may be repeated: it was interrupted, or would block.
pub(super) fn may_go_on(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::Interrupted | io::ErrorKind::WouldBlock)
}

/// Sends all bytes, or until `stop` returns true.
///
/// # Errors
///
/// When the line is lost, or takes no byte for five seconds: nobody reads at its other end.
pub(super) fn send_until(
    line: &mut (impl Transport + ?Sized),
    mut bytes: &[u8],
    stop: &dyn Fn() -> bool,
) -> io::Result<()> {
    let mut deadline = Instant::now() + STUCK;
    while !bytes.is_empty() && !stop() {
        let taken = line.send_some(bytes, LOOK_UP)?;
        bytes = bytes.get(taken..).unwrap_or_default();
        if taken > 0 {
            deadline = Instant::now() + STUCK;
        } else if Instant::now() > deadline {
            let what =
                format!("the line took no byte for {STUCK:?}: nobody reads at its other end");
            return Err(io::Error::new(io::ErrorKind::TimedOut, what));
        }
    }
    Ok(())
}
