//! How a command ends badly, and how it prints so that it can.

use std::fmt::Display;
use std::io::{ErrorKind, Write};

use serde::Serialize;

use super::interrupt::{INTERRUPTED, end_the_process, is_ending};
use echoloop_closed_loop::dataset::DatasetError;
use echoloop_closed_loop::run_folder::files::FileError;
use echoloop_closed_loop::run_folder::journal::JournalError;
use echoloop_closed_loop::search::TuneError;
use echoloop_files::stderr::{bounded, say};
use echoloop_sensors::client::ClientError;
use echoloop_sensors::sensor::SensorError;

/// What a shell says of a command that wrote to a closed pipe: 128 + SIGPIPE.
pub const READER_GONE: u8 = 141;

/// A message for people, and an exit code for scripts.
#[derive(Debug)]
pub struct Failure {
    /// What went wrong.
    pub message: String,
    /// 1 the run, 2 usage, configuration or a file, 3 the link or the sensor, 4 below the recall
    /// asked, 130 interrupted, 141 the reader of standard output has gone.
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

    /// What was asked makes no sense, or a file is unusable.
    pub(super) fn usage(message: impl Display) -> Self {
        Self::new(2, message)
    }
}

impl From<SensorError> for Failure {
    fn from(error: SensorError) -> Self {
        let asked_wrong = matches!(
            error,
            SensorError::Open { .. } | SensorError::Client { source: ClientError::Refused(_), .. }
        );
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

/// A document as JSON for people and scripts, with the end of its last line.
///
/// # Errors
///
/// [`Failure`] 1 when it cannot be written down.
pub(super) fn json(document: &impl Serialize) -> Result<String, Failure> {
    Ok(serde_json::to_string_pretty(document).map_err(Failure::run)? + "\n")
}

/// As [`print`], what is no text.
///
/// # Errors
///
/// As of [`print`].
pub(super) fn print_bytes(bytes: &[u8]) -> Result<(), Failure> {
    write_to(&mut std::io::stdout().lock(), bytes)
}

fn write_to(out: &mut impl Write, bytes: &[u8]) -> Result<(), Failure> {
    out.write_all(bytes).and_then(|()| out.flush()).map_err(|error| match error.kind() {
        ErrorKind::BrokenPipe => Failure::new(READER_GONE, error),
        _ => Failure::run(format_args!("cannot write to standard output: {error}")),
    })
}

/// Says on standard error what went wrong, but for a reader that has gone; gives the exit code.
/// Where the process is being ended, an emulator was stopped before us: the failure is that end.
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

    /// Takes a text into its buffer, and fails when it has to pass it on.
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
    fn what_cannot_be_written_is_a_failure_even_if_it_was_buffered() {
        let failed =
            write_to(&mut Full(ErrorKind::StorageFull), b"a\n").map_err(|f| (f.code, f.message));
        assert_eq!(failed, Err((1, "cannot write to standard output: no storage space".into())));
        let left = write_to(&mut Full(ErrorKind::BrokenPipe), b"a\n").map_err(|f| f.code);
        assert_eq!(left, Err(READER_GONE));
    }
}
