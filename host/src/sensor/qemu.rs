//! The sensor's image in QEMU.

use std::path::PathBuf;

use super::{Model, Sensor, SensorError, SensorSpec};

/// How to run it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct QemuOptions {
    /// The image (ELF); absent: where `cargo xtask firmware` puts it, below the current folder.
    pub firmware: Option<PathBuf>,
    /// Where its log goes, decoded; `-` is standard error.
    pub log: Option<PathBuf>,
}

#[cfg(unix)]
pub(super) use here::{boards, open_qemu};

#[cfg(unix)]
mod here {
    use std::path::Path;
    use std::sync::{Arc, Mutex};
    use std::time::Duration;

    use echoloop_sim::qemu::{self, Machine, Qemu};

    use super::{Model, QemuOptions, Sensor, SensorError, SensorSpec};
    use crate::client::Patience;

    /// An emulated processor may be slow when others need this one.
    const PATIENCE: Patience = Patience { timeout: Duration::from_secs(2), tries: 8 };

    /// Boards the image runs on; the first is the usual one.
    pub(crate) fn boards() -> Vec<&'static str> {
        Machine::ALL.map(Machine::name).to_vec()
    }

    /// Starts an emulated board with the image, looking through a front end in this process.
    ///
    /// # Errors
    ///
    /// [`SensorError::Open`] when it cannot be started, [`SensorError::Client`] when it does not answer.
    pub(crate) fn open_qemu(model: &Model, board: &str, options: &QemuOptions) -> Result<Sensor, SensorError> {
        let name = SensorSpec::Qemu(board.to_owned());
        let machine = Machine::of_name(board).ok_or_else(|| SensorError::open(&name, "no such board"))?;
        if options.log.is_some() {
            return Err(SensorError::open(&name, "--sensor-log: the log is not decoded yet"));
        }
        let mut how = qemu::QemuOptions::new(machine, Path::new(""));
        how.image = options.firmware.clone().unwrap_or(how.image);
        let front_end = Arc::new(Mutex::new(model.front_end()));
        let started = Qemu::start(&how, Arc::clone(&front_end), model.pattern, model.hardware);
        let line = started.map_err(|error| SensorError::open(&name, error))?;
        Sensor::simulated(Box::new(line), front_end, PATIENCE).map_err(SensorError::client(&name))
    }
}

#[cfg(not(unix))]
pub(super) fn boards() -> Vec<&'static str> {
    Vec::new()
}

#[cfg(not(unix))]
pub(super) fn open_qemu(_model: &Model, board: &str, _options: &QemuOptions) -> Result<Sensor, SensorError> {
    Err(SensorError::open(SensorSpec::Qemu(board.to_owned()), "QEMU is reached over Unix sockets"))
}
