//! Ways to carry the link's bytes.

mod in_process;
#[cfg(unix)]
mod qemu;
mod recording;
mod serial;

use std::io;
use std::time::{Duration, Instant};

pub use in_process::InProcess;
pub use recording::{Conversation, Direction, Recording};
pub use serial::{NativePort, Serial};

/// A line that takes no bytes for so long is lost.
const STUCK: Duration = Duration::from_secs(5);

/// How often to look whether to stop.
pub(super) const LOOK_UP: Duration = Duration::from_millis(100);

/// A line of bytes to a sensor. Bytes may be lost, changed or late: the client above copes.
pub trait Transport {
    /// Sends all bytes.
    ///
    /// # Errors
    ///
    /// When the line is gone for good.
    fn send(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// Sends some of the bytes, from the first on; how many the line took before the time was up. A
    /// line that never makes its sender wait takes them all.
    ///
    /// # Errors
    ///
    /// When the line is gone for good.
    fn send_some(&mut self, bytes: &[u8], _timeout: Duration) -> io::Result<usize> {
        self.send(bytes).map(|()| bytes.len())
    }

    /// Receives some bytes; none when the time is up.
    ///
    /// # Errors
    ///
    /// When the line is gone for good.
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

/// Sends all bytes, as the line takes them, or until told to stop.
///
/// # Errors
///
/// When the line is gone, or takes nothing for five seconds: nobody reads at its other end.
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
