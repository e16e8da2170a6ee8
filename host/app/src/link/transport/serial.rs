//! A serial line.

use std::io;
use std::time::{Duration, Instant};

use echoloop_link::MAX_FRAME;
use serialport::{ErrorKind, SerialPort};

use super::Transport;
use crate::link::client::RetryPolicy;

/// Bits a byte takes on the line: start, eight, stop.
const BITS_PER_BYTE: f64 = 10.0;
/// What a board may take to measure the beams of one report, and an adapter to pass them on.
const BOARD: Duration = Duration::from_millis(300);
/// A line that takes no bytes for so long is lost.
const STUCK: Duration = Duration::from_secs(5);

/// A serial port: eight bits, no parity, one stop bit, no flow control.
pub struct Serial {
    port: Box<dyn SerialPort>,
    name: String,
}

impl Serial {
    /// Opens a port for this program alone.
    ///
    /// # Errors
    ///
    /// That it cannot be opened, why, and for the usual reasons what to do.
    pub fn open(name: &str, baud: u32) -> Result<Self, String> {
        let port =
            serialport::new(name, baud).timeout(STUCK).open().map_err(|error| why_not(&error))?;
        Ok(Self::from_open_port(port, name))
    }

    /// A port that is open already.
    pub fn from_open_port(port: Box<dyn SerialPort>, name: &str) -> Self {
        Self { port, name: name.to_owned() }
    }

    /// How to wait for answers over a line of this speed: 300 ms for the board, and the longest
    /// frame's time once each way, because 2.8 kB take 246 ms at 115,200 baud.
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
            // A terminal whose other end has gone.
            Ok(0) => Err(io::ErrorKind::UnexpectedEof.into()),
            Err(error) if error.kind() == io::ErrorKind::TimedOut => Ok(0),
            read => read,
        }
    }
}

fn why_not(error: &serialport::Error) -> String {
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
        self.port.set_timeout(STUCK).map_err(io::Error::from).map_err(self.named())?;
        self.port.write_all(bytes).map_err(self.named())?;
        self.port.flush().map_err(self.named())
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        let deadline = Instant::now() + timeout;
        loop {
            match self.read(buffer, deadline.saturating_duration_since(Instant::now())) {
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
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
        let said = |kind| why_not(&serialport::Error::new(kind, "denied"));
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
