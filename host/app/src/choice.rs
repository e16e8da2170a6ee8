//! `--sensor` and its flags.

use std::path::PathBuf;

use clap::builder::TypedValueParser;
use clap::{Args, ValueHint};

use super::exit::Failure;
use super::interrupt::end_on_interrupt;
use super::method_choice::one_of;
use echoloop_sensors::defmt_log::begin_file;
use echoloop_sensors::sensor::{
    BoardLog, Detector, FrontEndAt, LogSource, Model, QemuOptions, SensorSpec, Sensors,
};

/// Flags that choose the sensor.
#[derive(Clone, Debug, Args)]
pub(crate) struct SensorChoice {
    /// Sensor to use: in-process, qemu[:BOARD], or serial:PORT[@BAUD], as
    /// serial:/dev/ttyACM0@115200.
    ///
    /// in-process: the firmware in this program, looking at the configuration's scene. qemu: its
    /// image in an emulated microcontroller, looking at the same. serial: a board on a serial line,
    /// at 921600 baud unless it says otherwise. What a board sees is up to whoever turns it: the
    /// number of the scan, which the firmware writes to the emitter's FRAME register, is that of
    /// the viewpoint, 2p+1 and 2p+2 for training pair p = 0, 1, …, then the held-out pairs in the
    /// same way; `scan` asks for 1. `echoloop serve` is the other end, to rehearse with.
    #[arg(long, value_name = "SENSOR", default_value = "in-process")]
    sensor: SensorSpec,
    /// Front end that turns light into codes.
    #[arg(long, value_name = "WHERE", value_parser = front_end(), default_value = "sensor")]
    front_end: FrontEndAt,
    /// The firmware's image, which --sensor qemu runs, or the board of --sensor serial.
    #[arg(long, value_name = "ELF", value_hint = ValueHint::FilePath)]
    firmware: Option<PathBuf>,
    /// File for the firmware's log; - is standard error. With --sensor serial it takes --log-from
    /// and --firmware.
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    sensor_log: Option<PathBuf>,
    /// With --sensor serial: where the log comes from, serial:PORT[@BAUD] or tcp:HOST:PORT.
    ///
    /// serial: the board's second line. tcp: a debugger's server of what it reads by RTT, as
    /// OpenOCD's `rtt server start 19021 0`.
    #[arg(long, value_name = "SOURCE")]
    log_from: Option<LogSource>,
}

impl SensorChoice {
    /// The firmware in this program.
    pub(super) fn in_process() -> Self {
        let sensor = SensorSpec::InProcess;
        let (firmware, sensor_log, log_from) = (None, None, None);
        Self { sensor, front_end: FrontEndAt::Sensor, firmware, sensor_log, log_from }
    }

    /// True when the sensor is the firmware in this program.
    pub(super) fn is_in_process(&self) -> bool {
        matches!(self.sensor, SensorSpec::InProcess)
    }

    /// The sensors that the flags choose; none is opened yet.
    pub(super) fn sensors(&self, model: Model) -> Result<Sensors, Failure> {
        self.check_log().map_err(Failure::usage)?;
        if model.detector == Detector::Ideal && !self.is_in_process() {
            return Err(Failure::usage(format_args!(
                "detector.kind = ideal is for --sensor in-process, not {}",
                self.sensor
            )));
        }
        if matches!(self.sensor, SensorSpec::Qemu(_)) {
            end_on_interrupt();
        }
        let log = match (&self.log_from, &self.firmware, &self.sensor_log) {
            (Some(from), Some(image), Some(to)) => {
                Some(BoardLog::start(from, image, to).map_err(Failure::usage)?)
            }
            // Now, not when the sensors are switched off.
            (_, _, Some(to)) => begin_file(to).map(|()| None).map_err(Failure::usage)?,
            _ => None,
        };
        let qemu = QemuOptions { firmware: self.firmware.clone(), log: self.sensor_log.clone() };
        let sensors = Sensors::new(&self.sensor, self.front_end, model, qemu);
        Ok(match log {
            Some(log) => sensors.with_log(log),
            None => sensors,
        })
    }

    /// Refuses flags of the log that do not go together.
    fn check_log(&self) -> Result<(), String> {
        let flags = [
            ("--firmware", self.firmware.is_some()),
            ("--sensor-log", self.sensor_log.is_some()),
            ("--log-from", self.log_from.is_some()),
        ];
        let given = flags.iter().find(|(_, given)| *given);
        match (&self.sensor, given) {
            (_, None) => Ok(()),
            (SensorSpec::Qemu(_) | SensorSpec::InProcess, _) if self.log_from.is_some() => {
                Err(format!("--log-from is for --sensor serial, not {}", self.sensor))
            }
            (SensorSpec::Qemu(_), _) => Ok(()),
            (SensorSpec::InProcess, Some((flag, _))) => {
                Err(format!("{flag} is for --sensor qemu or serial, not in-process"))
            }
            (SensorSpec::Serial(port), Some((flag, _))) => {
                if let Some((missing, _)) = flags.iter().find(|(_, given)| !given) {
                    return Err(format!(
                        "{flag} needs {missing}, too: a board's log takes --log-from SOURCE, \
                         --firmware ELF and --sensor-log FILE"
                    ));
                }
                match &self.log_from {
                    Some(LogSource::Serial(log)) if log.path == port.path => Err(format!(
                        "--log-from {}: that is the link's port, and the log comes from another",
                        log.path
                    )),
                    _ => Ok(()),
                }
            }
        }
    }

    /// The flags as text, for a command that resumes; empty for the default sensor.
    pub(super) fn again(&self) -> String {
        let file = |flag: &str, path: &Option<PathBuf>| {
            path.as_ref().map(|path| format!(" {flag} {}", path.display()))
        };
        let files = file("--firmware", &self.firmware)
            .into_iter()
            .chain(file("--sensor-log", &self.sensor_log))
            .chain(self.log_from.as_ref().map(|from| format!(" --log-from {from}")));
        let sensor = match self.sensor {
            SensorSpec::InProcess => String::new(),
            _ => format!(" --sensor {}", self.sensor) + &files.collect::<String>(),
        };
        match self.front_end {
            FrontEndAt::Sensor => sensor,
            FrontEndAt::Host => sensor + " --front-end host",
        }
    }

    /// True when the sensor is aimed externally: a board on a serial line with its own front end.
    pub(super) fn is_turned_by_others(&self) -> bool {
        matches!(self.sensor, SensorSpec::Serial(_)) && self.front_end == FrontEndAt::Sensor
    }
}

/// Reads `--front-end`.
fn front_end() -> impl TypedValueParser<Value = FrontEndAt> {
    one_of(FrontEndAt::ALL.map(|at| (at.name(), at.summary(), at)))
}
