//! Reasons why a file is not a road network.

use std::fmt::Display;
use std::path::PathBuf;

use echoloop_files::one_line;
use thiserror::Error;

/// Fault of a road, and what was expected.
pub(super) fn of_road(road: &str, what: impl Display) -> String {
    format!("road {}: {what}", one_line(road))
}

/// Reason why a file is not a road network.
#[derive(Debug, Error)]
pub enum RoadsError {
    /// The file cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Error of the system.
        source: std::io::Error,
    },
    /// The file is no road network that can be built.
    #[error("{} is not an OpenDRIVE road network: {fault}", path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// The fault.
        fault: String,
    },
}
