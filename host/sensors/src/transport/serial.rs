//! Serial line.

use std::io::{self, Read, Write};
use std::thread;
use std::time::{Duration, Instant};

use echoloop_link::MAX_FRAME;
use serialport::{ClearBuffer, ErrorKind, SerialPort};

use super::{LOOK_UP, Transport, may_go_on, send_until};
use crate::client::RetryPolicy;

/// Port type of this system.
#[cfg(unix)]
pub type NativePort = serialport::TTYPort;
/// Port type of this system.
#[cfg(windows)]
pub type NativePort = serialport::COMPort;

/// Bits of a byte on the line: start, eight, stop.
const BITS_PER_BYTE: f64 = 10.0;
/// Longest time of a board to measure the beams of one report, and of an adapter to pass them on.
const BOARD: Duration = Duration::from_millis(300);

/// Serial port: eight bits, no parity, one stop bit, no flow control.
pub struct Serial {
    port: NativePort,
    name: String,
}

impl Serial {
    /// Opens a port for this program alone.
    ///
    /// # Errors
    ///
    /// Message with the reason, and for the usual ones with what to do.
    pub fn open(name: &str, baud: u32) -> Result<Self, String> {
        let port = serialport::new(name, baud).timeout(LOOK_UP).open_native();
        let port = port.map_err(|error| message(&error))?;
        lock(&port).map_err(|_| message(&busy()))?;
        Self::from_open_port(port, name)
            .map_err(|error| format!("the port cannot be opened: {error}"))
    }

    /// Takes a port that is open already.
    ///
    /// # Errors
    ///
    /// When it cannot be made non-blocking.
    pub fn from_open_port(port: NativePort, name: &str) -> io::Result<Self> {
        never_block(&port)?;
        Ok(Self { port, name: name.to_owned() })
    }

    /// Timeout and tries at a speed: 300 ms for the board, and the longest frame once each way,
    /// because its 2.8 kB take 246 ms at 115,200 baud.
    pub fn retry_policy(baud: u32) -> RetryPolicy {
        let frame =
            Duration::from_secs_f64(MAX_FRAME as f64 * BITS_PER_BYTE / f64::from(baud.max(1)));
        RetryPolicy { timeout: BOARD + 2 * frame, ..RetryPolicy::default() }
    }

    fn named(&self) -> impl Fn(io::Error) -> io::Error {
        let name = self.name.clone();
        move |error| io::Error::new(error.kind(), format!("{name}: {error}"))
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        self.port.set_timeout(timeout)?;
        match self.port.read(buffer) {
            // A terminal whose other end was closed.
            Ok(0) => Err(io::ErrorKind::UnexpectedEof.into()),
            Err(error) if error.kind() == io::ErrorKind::TimedOut => Ok(0),
            read => read,
        }
    }

    /// Drops unsent bytes after a timeout: closing the port must not wait for them.
    fn give_up(&mut self, error: io::Error) -> io::Error {
        if error.kind() == io::ErrorKind::TimedOut {
            let _ = self.port.clear(ClearBuffer::Output);
        }
        self.named()(error)
    }
}

/// Makes writes take what fits. Otherwise a write to a line that nobody reads would block for ever
/// once its buffer has room for some of the bytes.
#[cfg(unix)]
fn never_block(port: &NativePort) -> io::Result<()> {
    use std::os::fd::{AsRawFd, BorrowedFd};

    use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};

    // SAFETY: the port is borrowed for the whole call, so its descriptor stays open.
    let descriptor = unsafe { BorrowedFd::borrow_raw(port.as_raw_fd()) };
    Ok(fcntl_setfl(descriptor, fcntl_getfl(descriptor)? | OFlags::NONBLOCK)?)
}

/// Locks the port: two hosts on one line would take each other's answers. The system keeps other
/// users from opening it, but not root.
#[cfg(unix)]
fn lock(port: &NativePort) -> io::Result<()> {
    use std::os::fd::{AsRawFd, BorrowedFd};

    use rustix::fs::{FlockOperation, flock};

    // SAFETY: the port is borrowed for the whole call, so its descriptor stays open.
    let descriptor = unsafe { BorrowedFd::borrow_raw(port.as_raw_fd()) };
    Ok(flock(descriptor, FlockOperation::NonBlockingLockExclusive)?)
}

/// Does nothing: Windows opens a port for one program only.
#[cfg(windows)]
fn lock(_port: &NativePort) -> io::Result<()> {
    Ok(())
}

fn busy() -> serialport::Error {
    serialport::Error::new(ErrorKind::NoDevice, "Device or resource busy")
}

/// Does nothing: the port's timeout holds for a whole write.
#[cfg(windows)]
fn never_block(_port: &NativePort) -> io::Result<()> {
    Ok(())
}

fn message(error: &serialport::Error) -> String {
    let advice = match error.kind() {
        ErrorKind::Io(io::ErrorKind::PermissionDenied) => {
            " (on Linux ports belong to the group dialout: sudo usermod -aG dialout $USER, then \
             log in again)"
        }
        ErrorKind::NoDevice => " (is another program using it?)",
        _ => "",
    };
    format!("the port cannot be opened: {error}{advice}")
}

impl Transport for Serial {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        send_until(self, bytes, &|| false).map_err(|error| self.give_up(error))
    }

    /// Writes to the system's buffer, and does not wait until it is empty, which needs a reader.
    fn send_some(&mut self, bytes: &[u8], timeout: Duration) -> io::Result<usize> {
        self.port.set_timeout(timeout)?;
        match self.port.write(bytes) {
            Err(error) if error.kind() == io::ErrorKind::TimedOut => Ok(0),
            Err(error) if may_go_on(&error) => {
                thread::sleep(Duration::from_millis(1)); // the system claimed room and had none
                Ok(0)
            }
            written => written,
        }
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        let deadline = Instant::now() + timeout;
        loop {
            match self.read(buffer, deadline.saturating_duration_since(Instant::now())) {
                Err(error) if may_go_on(&error) => {}
                read => return read.map_err(self.named()),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_port_without_permission_or_in_use_says_what_to_do() {
        let said = |kind| message(&serialport::Error::new(kind, "denied"));
        assert!(said(ErrorKind::Io(io::ErrorKind::PermissionDenied)).contains("dialout"));
        assert!(said(ErrorKind::NoDevice).contains("another program"));
        assert_eq!(said(ErrorKind::Unknown), "the port cannot be opened: denied");
    }

    #[test]
    fn the_timeout_grows_as_the_line_slows() {
        let timeout = |baud| Serial::retry_policy(baud).timeout.as_millis();
        assert_eq!([timeout(921_600), timeout(115_200), timeout(9_600)], [361, 791, 6195]);
    }
}
