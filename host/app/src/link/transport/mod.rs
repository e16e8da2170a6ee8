//! Ways to carry the link's bytes.

mod in_process;
#[cfg(unix)]
mod qemu;
mod recording;
mod serial;

use std::io;
use std::time::Duration;

pub use in_process::InProcess;
pub use recording::{Conversation, Direction, Recording};
pub use serial::Serial;

/// A line of bytes to a sensor. Bytes may be lost, changed or late: the client above copes.
pub trait Transport {
    /// Sends all bytes.
    ///
    /// # Errors
    ///
    /// When the line is gone for good.
    fn send(&mut self, bytes: &[u8]) -> io::Result<()>;

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

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        (**self).receive(buffer, timeout)
    }
}
