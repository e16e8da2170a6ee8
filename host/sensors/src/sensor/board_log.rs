//! Log of a real board: from its second serial port, or from the TCP port of a debugger that reads
//! RTT.

use std::fmt;
use std::fs;
use std::io::{self, Read};
use std::net::{TcpStream, ToSocketAddrs};
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use thiserror::Error;

use super::spec::{Port, SpecError};
use crate::defmt_log::{Messages, begin_file, write_lines};
use crate::transport::{Serial, Transport, may_go_on};
use echoloop_files::say;

/// Timeout of a connection to a debugger.
const CONNECTING: Duration = Duration::from_secs(5);
/// Silence after which a stopped log is at its end.
const QUIET: Duration = Duration::from_millis(200);
/// Longest wait for the rest of a stopped log.
const LAST_WORDS: Duration = Duration::from_secs(2);

/// Source of a log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum LogSource {
    /// Serial port: the board's line for its log.
    Serial(Port),
    /// `HOST:PORT` of a debugger that passes on RTT.
    Tcp(String),
}

/// Reason that a text names no source.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum LogSourceError {
    /// No known kind.
    #[error("expected serial:PORT[@BAUD] or tcp:HOST:PORT, as tcp:localhost:19021")]
    Kind,
    /// Malformed serial port.
    #[error(transparent)]
    Port(#[from] SpecError),
}

impl FromStr for LogSource {
    type Err = LogSourceError;

    fn from_str(text: &str) -> Result<Self, LogSourceError> {
        match text.split_once(':') {
            Some(("serial", port)) => Ok(Self::Serial(port.parse()?)),
            Some(("tcp", address)) => match address.rsplit_once(':') {
                Some((host, port)) if !host.is_empty() && port.parse::<u16>().is_ok() => {
                    Ok(Self::Tcp(address.to_owned()))
                }
                _ => Err(LogSourceError::Kind),
            },
            _ => Err(LogSourceError::Kind),
        }
    }
}

impl fmt::Display for LogSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Serial(port) => write!(f, "serial:{port}"),
            Self::Tcp(address) => write!(f, "tcp:{address}"),
        }
    }
}

/// Writer of a log, until it is dropped. A failure of the log does not stop the sensor's client.
pub struct BoardLog {
    stop: Arc<AtomicBool>,
    writer: Option<JoinHandle<()>>,
}

impl BoardLog {
    /// Starts writing to `to`, with the image that the board runs; `-` is standard error.
    ///
    /// # Errors
    ///
    /// Message with the option that cannot be used, and the reason. The file is created last.
    pub fn start(from: &LogSource, image: &Path, to: &Path) -> Result<Self, String> {
        let unusable = |why: &dyn fmt::Display| format!("--firmware {}: {why}", image.display());
        let elf = fs::read(image).map_err(|error| unusable(&error))?;
        let messages = Messages::from_elf(&elf).map_err(|error| unusable(&error))?;
        let line = Line::open(from).map_err(|why| format!("--log-from {from}: {why}"))?;
        begin_file(to)?;
        let stop = Arc::new(AtomicBool::new(false));
        let copy = Copy { line, to: to.to_owned(), stop: Arc::clone(&stop) };
        let (from, image) = (from.clone(), image.to_owned());
        let work = move || copy.run(&messages, &from, &image);
        let writer = std::thread::Builder::new().name("log".into()).spawn(work);
        let writer = writer.map_err(|error| format!("--log-from: no thread: {error}"))?;
        Ok(Self { stop, writer: Some(writer) })
    }
}

impl Drop for BoardLog {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        self.writer.take().map(JoinHandle::join);
    }
}

/// Open source of a log.
enum Line {
    Serial(Serial),
    Tcp(TcpStream),
}

impl Line {
    fn open(from: &LogSource) -> Result<Self, String> {
        match from {
            LogSource::Serial(port) => Serial::open(&port.path, port.baud).map(Self::Serial),
            LogSource::Tcp(address) => {
                let stream = connect(address);
                stream.map(Self::Tcp).map_err(|error| format!("it cannot be reached: {error}"))
            }
        }
    }

    /// Receives some bytes; 0 after [`QUIET`].
    fn receive(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self {
            Self::Serial(port) => port.receive(buffer, QUIET),
            Self::Tcp(stream) => match stream.read(buffer) {
                Ok(0) => Err(io::Error::other("its other end was closed")),
                Err(error) if may_go_on(&error) || error.kind() == io::ErrorKind::TimedOut => Ok(0),
                read => read,
            },
        }
    }
}

/// Connects to the first address of a name that answers.
fn connect(address: &str) -> io::Result<TcpStream> {
    let mut last = io::Error::other("the name has no address");
    for address in address.to_socket_addrs()? {
        match TcpStream::connect_timeout(&address, CONNECTING) {
            Ok(stream) => {
                stream.set_read_timeout(Some(QUIET))?;
                return Ok(stream);
            }
            Err(error) => last = error,
        }
    }
    Err(last)
}

/// Work of the writer's thread.
struct Copy {
    line: Line,
    to: PathBuf,
    stop: Arc<AtomicBool>,
}

impl Copy {
    fn run(mut self, messages: &Messages, from: &LogSource, image: &Path) {
        let (mut reader, mut buffer) = (messages.reader(), [0; 4096]);
        let (mut until, mut warned) = (None, false);
        loop {
            if self.stop.load(Ordering::Relaxed) {
                until.get_or_insert_with(|| Instant::now() + LAST_WORDS);
            }
            let length = match self.line.receive(&mut buffer) {
                Ok(0) if until.is_some() => break,
                Ok(length) => length,
                Err(error) => {
                    say(format_args!("warning: the log from {from} has ended: {error}"));
                    break;
                }
            };
            let lines = reader.read(buffer.get(..length).unwrap_or_default());
            if let Err(error) = write_lines(&self.to, 1, &lines) {
                say(format_args!("warning: no more log in {}: {error}", self.to.display()));
                return;
            }
            // One broken message is usual: the log may have been joined in the middle of it.
            if reader.broken() > 1 && !warned {
                warned = true;
                say(format_args!(
                    "warning: messages of the log from {from} cannot be read: bytes were lost, or \
                     the board does not run {}",
                    image.display()
                ));
            }
            if until.is_some_and(|until| Instant::now() > until) {
                break;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_source_is_a_serial_port_or_one_of_tcp_and_reads_back_as_itself() {
        let serial = |path: &str, baud| LogSource::Serial(Port { path: path.into(), baud });
        let tcp = |address: &str| LogSource::Tcp(address.into());
        let table = [
            ("serial:/dev/ttyUSB1", serial("/dev/ttyUSB1", 921_600)),
            ("serial:COM4@115200", serial("COM4", 115_200)),
            ("tcp:localhost:19021", tcp("localhost:19021")),
            ("tcp:[::1]:9090", tcp("[::1]:9090")),
        ];
        for (text, source) in table {
            assert_eq!(text.parse(), Ok(source.clone()), "{text}");
            assert_eq!(source.to_string().parse(), Ok(source), "{text}");
        }
    }

    #[test]
    fn a_text_that_names_no_source_is_answered_with_what_would() {
        let table = [
            ("", "expected serial:PORT[@BAUD] or tcp:HOST:PORT"),
            ("/dev/ttyUSB1", "expected serial"),
            ("tcp:19021", "expected serial"),
            ("tcp::19021", "expected serial"),
            ("tcp:localhost:rtt", "expected serial"),
            ("tcp:localhost:70000", "expected serial"),
            ("serial:", "needs its port"),
            ("serial:/dev/ttyUSB1@fast", "'fast' is no speed"),
        ];
        for (text, problem) in table {
            let error = text.parse::<LogSource>().unwrap_err().to_string();
            assert!(error.contains(problem), "{text}: {error}");
        }
    }
}
