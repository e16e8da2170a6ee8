//! `--sensor` and `--front-end`: kind of sensor and place of its front end.

use std::fmt;
use std::str::FromStr;

use echoloop_parameters::choice;
use thiserror::Error;

/// Default speed of a serial line, baud.
const BAUD: u32 = 921_600;

/// Kind of sensor.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SensorSpec {
    /// Firmware in this process.
    InProcess,
    /// Image of the firmware in an emulated microcontroller, on this board.
    Qemu(String),
    /// Board on a serial line.
    Serial(Port),
}

choice! {
    /// `--front-end`: place where light becomes codes.
    pub enum FrontEndAt by default Sensor {
        /// At the sensor, as its maker has it.
        Sensor = "sensor",
        /// Here: the sensor gets waveforms over its link, to find echoes in.
        Host = "host",
    }
}

/// A serial port and its speed: `PORT[@BAUD]`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Port {
    /// Path or name.
    pub path: String,
    /// Speed, bits a second.
    pub baud: u32,
}

/// Reason that a text names no sensor.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum SpecError {
    /// No known kind.
    #[error("expected in-process, qemu[:BOARD] or serial:PORT[@BAUD]")]
    Kind,
    /// Board that QEMU does not have here.
    #[error("qemu has no board '{0}' here, only {boards}", boards = boards().join(", "))]
    Board(String),
    /// Serial line without a port.
    #[error("a serial line needs its port, as serial:/dev/ttyACM0 or serial:/dev/ttyUSB0@115200")]
    NoPort,
    /// Text after the last @ that is no speed.
    #[error("'{0}' is no speed of a serial line: a whole number of baud, 1 or more")]
    Baud(String),
}

/// Names of the boards that QEMU emulates here, the default first. QEMU is reached over Unix
/// sockets, so other systems have none.
fn boards() -> Vec<&'static str> {
    #[cfg(unix)]
    let boards = crate::boards::qemu::Machine::ALL.map(crate::boards::qemu::Machine::name).to_vec();
    #[cfg(not(unix))]
    let boards = Vec::new();
    boards
}

impl FromStr for SensorSpec {
    type Err = SpecError;

    fn from_str(text: &str) -> Result<Self, SpecError> {
        match text.split_once(':') {
            None if text == "in-process" => Ok(Self::InProcess),
            None if text == "qemu" => {
                boards().first().map(|board| Self::Qemu((*board).to_owned())).ok_or(SpecError::Kind)
            }
            None if text == "serial" => Err(SpecError::NoPort),
            Some(("qemu", board)) if boards().contains(&board) => Ok(Self::Qemu(board.to_owned())),
            Some(("qemu", board)) => Err(SpecError::Board(board.to_owned())),
            Some(("serial", port)) => port.parse().map(Self::Serial),
            _ => Err(SpecError::Kind),
        }
    }
}

impl FromStr for Port {
    type Err = SpecError;

    fn from_str(text: &str) -> Result<Self, SpecError> {
        let (path, baud) = match text.rsplit_once('@') {
            Some((path, baud)) => {
                (path, baud.parse().map_err(|_| SpecError::Baud(baud.to_owned()))?)
            }
            None => (text, BAUD),
        };
        match (path, baud) {
            ("", _) => Err(SpecError::NoPort),
            (_, 0) => Err(SpecError::Baud("0".into())),
            _ => Ok(Self { path: path.to_owned(), baud }),
        }
    }
}

impl fmt::Display for SensorSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::InProcess => f.write_str("in-process"),
            Self::Qemu(board) => write!(f, "qemu:{board}"),
            Self::Serial(port) => write!(f, "serial:{port}"),
        }
    }
}

impl fmt::Display for Port {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}@{}", self.path, self.baud)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sensor_is_named_by_kind_and_place_and_reads_back_as_itself() {
        let serial = |path: &str, baud| SensorSpec::Serial(Port { path: path.into(), baud });
        let table = [
            ("in-process", SensorSpec::InProcess),
            ("qemu", SensorSpec::Qemu("mps2-an386".into())),
            ("qemu:mps2-an386", SensorSpec::Qemu("mps2-an386".into())),
            ("serial:/dev/ttyACM0", serial("/dev/ttyACM0", 921_600)),
            ("serial:COM3@115200", serial("COM3", 115_200)),
            ("serial:/dev/serial/by-id/a:b@c@9600", serial("/dev/serial/by-id/a:b@c", 9600)),
        ];
        for (text, spec) in table {
            assert_eq!(text.parse(), Ok(spec.clone()), "{text}");
            assert_eq!(spec.to_string().parse(), Ok(spec), "{text}");
        }
    }

    #[test]
    fn a_text_that_names_no_sensor_is_answered_with_what_would() {
        let table = [
            ("", "expected in-process"),
            ("in-process:2", "expected in-process"),
            ("uart:/dev/ttyS0", "expected in-process"),
            ("qemu:toaster", "no board 'toaster'"),
            ("qemu:", "no board ''"),
            ("serial", "needs its port"),
            ("serial:", "needs its port"),
            ("serial:@9600", "needs its port"),
            ("serial:/dev/ttyS0@fast", "'fast' is no speed"),
            ("serial:/dev/ttyS0@", "'' is no speed"),
            ("serial:/dev/ttyS0@0", "'0' is no speed"),
        ];
        for (text, problem) in table {
            let error = text.parse::<SensorSpec>().unwrap_err().to_string();
            assert!(error.contains(problem), "{text}: {error}");
        }
    }
}
