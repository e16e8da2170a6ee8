//! How a command ends badly.

use std::fmt::Display;

use crate::client::ClientError;
use crate::dataset::DatasetError;
use crate::journal::JournalError;
use crate::run::FileError;
use crate::sensor::SensorError;
use crate::tune::TuneError;

/// A message for people, and an exit code for scripts.
#[derive(Debug)]
pub struct Failure {
    /// What went wrong.
    pub message: String,
    /// 1 the run, 2 usage, configuration or a file, 3 the link or the sensor, 4 below the recall asked, 130 interrupted.
    pub code: u8,
}

impl Failure {
    pub(super) fn new(code: u8, message: impl Display) -> Self {
        Self { message: message.to_string(), code }
    }

    /// The run failed.
    pub(super) fn run(message: impl Display) -> Self {
        Self::new(1, message)
    }

    /// What was asked makes no sense, or a file is unusable.
    pub(super) fn usage(message: impl Display) -> Self {
        Self::new(2, message)
    }
}

impl From<SensorError> for Failure {
    fn from(error: SensorError) -> Self {
        let asked_wrong =
            matches!(error, SensorError::Open { .. } | SensorError::Client { source: ClientError::Refused(_), .. });
        Self::new(if asked_wrong { 2 } else { 3 }, error)
    }
}

impl From<DatasetError> for Failure {
    fn from(error: DatasetError) -> Self {
        Self::usage(error)
    }
}

impl From<JournalError> for Failure {
    fn from(error: JournalError) -> Self {
        Self::usage(error)
    }
}

impl From<FileError> for Failure {
    fn from(error: FileError) -> Self {
        Self::usage(error)
    }
}

impl From<TuneError> for Failure {
    fn from(error: TuneError) -> Self {
        match error {
            TuneError::Sensor(error) => error.into(),
            TuneError::Journal(error) => error.into(),
            TuneError::Optimizer(_) => Self::usage(error),
            TuneError::Interrupted { .. } => Self::new(130, error),
        }
    }
}

/// Says on standard error what went wrong; gives the exit code.
pub fn report_failure(failure: &Failure) -> std::process::ExitCode {
    eprintln!("error: {}", failure.message.trim_end());
    std::process::ExitCode::from(failure.code)
}
