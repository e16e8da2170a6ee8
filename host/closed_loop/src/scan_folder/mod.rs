//! Folders of scans for other programs: pairs with their true motions, scans along a trajectory.

pub mod pairs;
pub mod trajectory;

use std::sync::atomic::{AtomicBool, Ordering};

use thiserror::Error;

use crate::run_folder::files::FileError;
use echoloop_clouds::Recorded;
use echoloop_sensors::sensor::SensorError;

/// Scans that cannot be made or written.
#[derive(Debug, Error)]
pub enum ScanError {
    /// The sensor failed.
    #[error(transparent)]
    Sensor(#[from] SensorError),
    /// A file cannot be written.
    #[error(transparent)]
    File(#[from] FileError),
    /// A scan has no point.
    #[error("{scan}: no beam returned an echo (is the sensor inside something, or too weak?)")]
    NoEcho {
        /// The scan: its number, or its line in a file of poses.
        scan: String,
    },
    /// Stopped from outside.
    #[error("interrupted; nothing is written")]
    Interrupted,
}

/// [`ScanError::Interrupted`] once a stop was asked for.
pub fn go_on(stop: &AtomicBool) -> Result<(), ScanError> {
    if stop.load(Ordering::Relaxed) { Err(ScanError::Interrupted) } else { Ok(()) }
}

/// A cloud with points; `scan` names it in the refusal of one without.
///
/// # Errors
///
/// [`ScanError::NoEcho`].
pub fn with_points(
    recorded: Recorded,
    scan: impl FnOnce() -> String,
) -> Result<Recorded, ScanError> {
    match recorded.cloud.points.is_empty() {
        true => Err(ScanError::NoEcho { scan: scan() }),
        false => Ok(recorded),
    }
}
