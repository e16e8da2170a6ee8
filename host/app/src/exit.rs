//! Exit codes and error output of the commands.

use std::fmt::Display;
use std::io::{ErrorKind, Write};

use serde::Serialize;

use super::interrupt::{INTERRUPTED, end_the_process, is_ending};
use echoloop_closed_loop::config::LoadError;
use echoloop_closed_loop::dataset::DatasetError;
use echoloop_closed_loop::external_search::ExternalSearchError;
use echoloop_closed_loop::parameters::ValueError;
use echoloop_closed_loop::prepared::PrepareError;
use echoloop_closed_loop::run_folder::files::FileError;
use echoloop_closed_loop::run_folder::journal::JournalError;
use echoloop_closed_loop::run_folder::tuned_run::TunedRunError;
use echoloop_closed_loop::scan_folder::ScanError;
use echoloop_closed_loop::search::TuneError;
use echoloop_closed_loop::tuning::WriteRunError;
use echoloop_files::stderr::{bounded, say};
use echoloop_report::finished_runs::RunError;
use echoloop_sensors::client::ClientError;
use echoloop_sensors::sensor::SensorError;

/// Exit code of a command that wrote to a closed pipe: 128 + SIGPIPE.
pub const READER_GONE: u8 = 141;

/// A message for people, and an exit code for scripts.
#[derive(Debug)]
pub struct Failure {
    /// The reason, without `error: `.
    pub message: String,
    /// 1 the run, 2 usage, configuration or a file, 3 the link or the sensor, 4 below
    /// `--require-recall`, 130 interrupted, 141 the reader of standard output has gone.
    pub code: u8,
}

impl Failure {
    pub(super) fn new(code: u8, message: impl Display) -> Self {
        Self { message: bounded(&message.to_string()), code }
    }

    /// The run failed.
    pub(super) fn run(message: impl Display) -> Self {
        Self::new(1, message)
    }

    /// Flags or configuration make no sense, or a file is unusable.
    pub(super) fn usage(message: impl Display) -> Self {
        Self::new(2, message)
    }
}

impl From<SensorError> for Failure {
    fn from(error: SensorError) -> Self {
        let is_usage = matches!(
            error,
            SensorError::Open { .. } | SensorError::Client { source: ClientError::Refused(_), .. }
        );
        Self::new(if is_usage { 2 } else { 3 }, error)
    }
}

/// Errors that end a command with exit code 2.
macro_rules! usage_errors {
    ($($error:ty),* $(,)?) => {$(
        impl From<$error> for Failure {
            fn from(error: $error) -> Self {
                Self::usage(error)
            }
        }
    )*};
}

usage_errors![
    DatasetError,
    FileError,
    JournalError,
    LoadError,
    RunError,
    TunedRunError,
    ValueError,
];

impl From<PrepareError> for Failure {
    fn from(error: PrepareError) -> Self {
        match error {
            PrepareError::Sensor(error) => error.into(),
            error => Self::usage(error),
        }
    }
}

impl From<ScanError> for Failure {
    fn from(error: ScanError) -> Self {
        match error {
            ScanError::Sensor(error) => error.into(),
            ScanError::File(error) => error.into(),
            ScanError::NoEcho { .. } => Self::run(error),
            ScanError::Interrupted => Self::new(INTERRUPTED, error),
        }
    }
}

impl From<ExternalSearchError> for Failure {
    fn from(error: ExternalSearchError) -> Self {
        match error {
            ExternalSearchError::Sensor(error) => error.into(),
            ExternalSearchError::Input(_) => Self::usage(error),
        }
    }
}

impl From<WriteRunError> for Failure {
    fn from(error: WriteRunError) -> Self {
        match error {
            WriteRunError::File(error) => error.into(),
            WriteRunError::Sensor(error) => error.into(),
        }
    }
}

impl From<TuneError> for Failure {
    fn from(error: TuneError) -> Self {
        match error {
            TuneError::Sensor(error) => error.into(),
            TuneError::Journal(error) => error.into(),
            TuneError::Optimizer(_)
            | TuneError::Front(_)
            | TuneError::Diverged { .. }
            | TuneError::NothingFound { .. }
            | TuneError::NothingToKeep { .. } => Self::usage(error),
            TuneError::Interrupted { .. } => Self::new(INTERRUPTED, error),
        }
    }
}

/// Writes a whole text to standard output.
///
/// # Errors
///
/// [`Failure`] 1 when it cannot be written, as to a full disk; [`READER_GONE`] when nobody reads it
/// any more.
pub(super) fn print(text: &str) -> Result<(), Failure> {
    print_bytes(text.as_bytes())
}

/// A document as indented JSON, with a line end.
///
/// # Errors
///
/// [`Failure`] 1 when it cannot be serialised.
pub(super) fn json(document: &impl Serialize) -> Result<String, Failure> {
    Ok(serde_json::to_string_pretty(document).map_err(Failure::run)? + "\n")
}

/// Prints a document as [`json`] has it.
///
/// # Errors
///
/// Errors of [`json`] and [`print`].
pub(super) fn print_json(document: &impl Serialize) -> Result<(), Failure> {
    print(&json(document)?)
}

/// [`print`] for bytes that are no text.
///
/// # Errors
///
/// Errors of [`print`].
pub(super) fn print_bytes(bytes: &[u8]) -> Result<(), Failure> {
    write_to(&mut std::io::stdout().lock(), bytes)
}

fn write_to(out: &mut impl Write, bytes: &[u8]) -> Result<(), Failure> {
    out.write_all(bytes).and_then(|()| out.flush()).map_err(|error| match error.kind() {
        ErrorKind::BrokenPipe => Failure::new(READER_GONE, error),
        _ => Failure::run(format_args!("cannot write to standard output: {error}")),
    })
}

/// Prints the failure to standard error, unless the reader of standard output has gone, and returns
/// the exit code. After ^C the failure is that of the stopped emulator, so the process ends here
/// instead.
pub fn report_failure(failure: &Failure) -> std::process::ExitCode {
    if is_ending() {
        end_the_process();
    }
    if failure.code != READER_GONE {
        say(format_args!("error: {}", failure.message.trim_end()));
    }
    std::process::ExitCode::from(failure.code)
}

#[cfg(test)]
mod tests {
    use std::io;

    use super::*;

    /// Accepts every byte, and fails at the flush.
    struct Full(ErrorKind);

    impl Write for Full {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Err(self.0.into())
        }
    }

    #[test]
    fn a_failed_flush_is_a_failure_although_the_write_succeeded() {
        let failed =
            write_to(&mut Full(ErrorKind::StorageFull), b"a\n").map_err(|f| (f.code, f.message));
        assert_eq!(failed, Err((1, "cannot write to standard output: no storage space".into())));
        let left = write_to(&mut Full(ErrorKind::BrokenPipe), b"a\n").map_err(|f| f.code);
        assert_eq!(left, Err(READER_GONE));
    }
}
