//! `--sensor`: which sensor a command speaks to.

use std::fs::File;
use std::path::{Path, PathBuf};

use clap::{Args, ValueHint};

use super::exit::Failure;
use super::interrupt::end_on_interrupt;
use super::progress::Progress;
use crate::link::client::Identity;
use crate::link::pattern::described as beams_of;
use crate::link::sensor::{Model, QemuOptions, SensorSpec, Sensors};

/// Flags of every command that speaks to a sensor.
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
    /// With --sensor qemu: the firmware's image.
    #[arg(long, value_name = "ELF", value_hint = ValueHint::FilePath)]
    firmware: Option<PathBuf>,
    /// With --sensor qemu: where the firmware's log goes; - is standard error.
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    sensor_log: Option<PathBuf>,
}

impl SensorChoice {
    /// The firmware in this program.
    pub(super) fn in_process() -> Self {
        Self { sensor: SensorSpec::InProcess, firmware: None, sensor_log: None }
    }

    /// The sensors asked for; none is opened yet.
    pub(super) fn sensors(&self, model: Model) -> Result<Sensors, Failure> {
        let is_qemu = matches!(self.sensor, SensorSpec::Qemu(_));
        for (flag, given) in
            [("--firmware", self.firmware.is_some()), ("--sensor-log", self.sensor_log.is_some())]
        {
            if given && !is_qemu {
                return Err(Failure::usage(format!(
                    "{flag} is for --sensor qemu, not {}",
                    self.sensor
                )));
            }
        }
        if let Some(log) = self.sensor_log.as_deref().filter(|log| *log != Path::new("-")) {
            let made = File::create(log); // now, not when the sensors are switched off
            made.map_err(|error| {
                Failure::usage(format!("--sensor-log {}: {error}", log.display()))
            })?;
        }
        if is_qemu {
            end_on_interrupt();
        }
        let qemu = QemuOptions { firmware: self.firmware.clone(), log: self.sensor_log.clone() };
        Ok(Sensors::new(&self.sensor, model, qemu))
    }

    /// The flags again, to go on with; nothing for the usual sensor.
    pub(super) fn again(&self) -> String {
        let file = |flag: &str, path: &Option<PathBuf>| {
            path.as_ref().map(|path| format!(" {flag} {}", path.display()))
        };
        let files = file("--firmware", &self.firmware)
            .into_iter()
            .chain(file("--sensor-log", &self.sensor_log));
        match self.sensor {
            SensorSpec::InProcess => String::new(),
            _ => format!(" --sensor {}", self.sensor) + &files.collect::<String>(),
        }
    }

    /// Whether what the sensor sees is not ours to choose.
    pub(super) fn is_turned_by_others(&self) -> bool {
        matches!(self.sensor, SensorSpec::Serial(_))
    }
}

/// A sensor and its firmware, as in `serial:/dev/ttyACM0@115200, echoloop-sensor 0.1.0`.
pub(super) fn described(sensors: &Sensors, identity: &Identity) -> String {
    format!("{}, {}", sensors.name(), identity.build)
}

/// Opens the first sensor, says which it is, and holds it to the configuration.
pub(super) fn introduce(
    sensors: &Sensors,
    model: &Model,
    progress: &Progress,
) -> Result<Identity, Failure> {
    let identity = sensors.identity()?;
    progress.say(&format!("sensor {}", described(sensors, &identity)));
    hold_to(sensors, &identity, model)?;
    Ok(identity)
}

/// Its beams must point where the configuration says: there the scenes are traced, and for as many
/// there is memory.
pub(super) fn hold_to(
    sensors: &Sensors,
    identity: &Identity,
    model: &Model,
) -> Result<(), Failure> {
    let (theirs, ours) = (identity.pattern, model.pattern);
    if theirs == ours {
        return Ok(());
    }
    Err(Failure::usage(format!(
        "{}: its beams are {}, the configuration's [scanner] has {}",
        sensors.name(),
        beams_of(&theirs),
        beams_of(&ours)
    )))
}
