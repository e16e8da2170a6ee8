//! Sensors in QEMU.

use std::path::PathBuf;

#[cfg(not(unix))]
use super::{FrontEndAt, Model, Sensor, SensorError, SensorSpec};

/// Options of an emulated sensor.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct QemuOptions {
    /// Image (ELF); `None` for the one that `cargo xtask firmware` puts below the current folder.
    pub firmware: Option<PathBuf>,
    /// File for its decoded log; `-` is standard error.
    pub log: Option<PathBuf>,
}

#[cfg(unix)]
pub use crate::boards::qemu::stop_all as end_emulators;
#[cfg(unix)]
pub(super) use here::open_qemu;

#[cfg(unix)]
mod here {
    use std::fs;
    use std::io;
    use std::path::{Path, PathBuf};
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::sync::{Arc, Mutex};
    use std::time::Duration;

    use crate::boards::qemu::{self, Machine, Qemu, QemuError};

    use super::super::{FrontEndAt, Line, Model, Sensor, SensorError, SensorSpec, SharedFrontEnd};
    use super::QemuOptions;
    use crate::client::RetryPolicy;
    use crate::defmt_log::{self, write_lines};
    use crate::transport::Transport;

    /// Long timeout: an emulated processor is slow on a busy machine.
    const RETRY_POLICY: RetryPolicy = RetryPolicy { timeout: Duration::from_secs(2), tries: 8 };

    /// Starts an emulated board with the image and a front end in this process.
    ///
    /// # Errors
    ///
    /// [`SensorError::Open`] when it cannot be started, [`SensorError::Client`] when it does not
    /// answer.
    pub(crate) fn open_qemu(
        model: &Model,
        at: FrontEndAt,
        board: &str,
        options: &QemuOptions,
    ) -> Result<Sensor, SensorError> {
        let name = SensorSpec::Qemu(board.to_owned());
        let machine =
            Machine::from_name(board).ok_or_else(|| SensorError::open(&name, "no such board"))?;
        if at == FrontEndAt::Sensor && !machine.has_front_end() {
            return Err(SensorError::open(&name, "it has no front end: --front-end host"));
        }
        let mut how = qemu::QemuOptions::new(machine, Path::new(""));
        how.image = options.firmware.clone().unwrap_or(how.image);
        let front_end = Arc::new(Mutex::new(model.front_end()));
        let started = Qemu::start(&how, Arc::clone(&front_end), model.pattern, model.hardware);
        let line = started.map_err(|error| match error {
            QemuError::Failed { what, .. } => {
                SensorError::client(&name)(io::Error::other(what).into())
            }
            unusable => SensorError::open(&name, unusable),
        })?;
        let line: Line = match &options.log {
            None => Box::new(line),
            Some(log) => Box::new(Logged::new(line, how.image, log.clone())),
        };
        let sensor = match at {
            FrontEndAt::Sensor => Sensor::simulated(line, front_end, RETRY_POLICY),
            FrontEndAt::Host => Sensor::fed(line, model, RETRY_POLICY),
        };
        sensor.map_err(SensorError::client(&name))
    }

    /// Line that writes the sensor's log when it is dropped.
    struct Logged {
        line: Qemu<SharedFrontEnd>,
        image: PathBuf,
        to: PathBuf,
        number: usize,
    }

    /// Number of sensors so far: each log has a number of its own.
    static SENSORS: AtomicUsize = AtomicUsize::new(0);

    impl Logged {
        fn new(line: Qemu<SharedFrontEnd>, image: PathBuf, to: PathBuf) -> Self {
            Self { line, image, to, number: 1 + SENSORS.fetch_add(1, Ordering::Relaxed) }
        }

        fn write(&self) -> io::Result<()> {
            let frames = fs::read(self.line.log_file())?;
            let lines =
                defmt_log::decode(&fs::read(&self.image)?, &frames).map_err(io::Error::other)?;
            write_lines(&self.to, self.number, &lines)
        }
    }

    impl Transport for Logged {
        fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
            self.line.send(bytes)
        }

        fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
            self.line.receive(buffer, timeout)
        }
    }

    impl Drop for Logged {
        fn drop(&mut self) {
            if let Err(error) = self.write() {
                echoloop_files::say(format_args!(
                    "warning: cannot write the sensor's log to {}: {error}",
                    self.to.display()
                ));
            }
        }
    }
}

#[cfg(not(unix))]
pub fn end_emulators() {}

#[cfg(not(unix))]
pub(super) fn open_qemu(
    _model: &Model,
    _at: FrontEndAt,
    board: &str,
    _options: &QemuOptions,
) -> Result<Sensor, SensorError> {
    Err(SensorError::open(SensorSpec::Qemu(board.to_owned()), "QEMU is reached over Unix sockets"))
}
