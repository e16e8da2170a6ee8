//! The sensor's image in QEMU.

use std::path::PathBuf;

use super::{Model, Sensor, SensorError, SensorSpec};

/// Boards the image runs on; the first is the usual one.
pub(super) const BOARDS: [&str; 1] = ["mps2-an386"];

/// How to run it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct QemuOptions {
    /// The image (ELF).
    pub firmware: Option<PathBuf>,
    /// Where its log goes, decoded; `-` is standard error.
    pub log: Option<PathBuf>,
}

/// Starts an emulated board with the image.
///
/// # Errors
///
/// [`SensorError::Open`] when it cannot be started, [`SensorError::Client`] when it does not answer.
pub(super) fn open_qemu(_model: &Model, board: &str, _options: &QemuOptions) -> Result<Sensor, SensorError> {
    Err(SensorError::open(SensorSpec::Qemu(board.to_owned()), "not built into this program"))
}
