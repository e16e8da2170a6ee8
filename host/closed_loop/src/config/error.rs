//! Why a value of the configuration is refused.

use echoloop_files::shown;
use echoloop_parameters::Refused;
use thiserror::Error;

/// A value of the configuration that makes no sense.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum RunConfigError {
    /// Not what its key must be.
    #[error(transparent)]
    Refused(Refused),
    /// A table of beams that is none.
    #[error("scanner.pattern = {path}: {reason}")]
    Table {
        /// The file.
        path: String,
        /// Which line, and what is wrong.
        reason: String,
    },
    /// Bounds that no pair lies between.
    #[error("data.least_overlap = {least} must be at most data.most_overlap = {most}")]
    Overlap {
        /// The lower.
        least: f64,
        /// The upper.
        most: f64,
    },
}

/// Of a value as much as a message can hold.
impl From<Refused> for RunConfigError {
    fn from(refused: Refused) -> Self {
        Self::Refused(Refused { value: shown(&refused.value), ..refused })
    }
}
