//! Reader of files of waveforms.

use std::path::{Path, PathBuf};

use echoloop_files::read_data;

use super::problem::Problem;
use super::rows::Rows;
use super::{csv, npy};

/// Reason why a file gives no waveforms.
#[derive(Debug, thiserror::Error)]
pub enum WaveformError {
    /// The file cannot be read.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Error of the system.
        source: std::io::Error,
    },
    /// A cell is no finite number.
    #[error("{}: row {row}, column {column}: expected a finite number, found \
             {found}{hint}", path.display())]
    Cell {
        /// The file.
        path: PathBuf,
        /// Row, from 1.
        row: usize,
        /// Column, from 1.
        column: usize,
        /// Text of the cell.
        found: String,
        /// A likely reason; may be empty.
        hint: &'static str,
    },
    /// The content does not fit the format.
    #[error("{}: {problem}", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// Expected and found.
        problem: String,
    },
}

/// Reads one waveform a row: CSV without a header, rows of any length, or a NumPy `.npy` array of
/// one or two dimensions (recognised by its first bytes, not by its name).
///
/// Every number must be finite. An empty row is an empty waveform; empty cells at a row's end are
/// dropped.
///
/// # Errors
///
/// [`WaveformError`] names the file, the expected content and, for a cell, row and column. A file
/// without rows is an error too.
pub fn read_waveforms(path: &Path) -> Result<Rows, WaveformError> {
    let bytes =
        read_data(path).map_err(|source| WaveformError::Io { path: path.into(), source })?;
    parse_waveforms(path, bytes)
}

/// As [`read_waveforms`], from bytes; `path` is for messages.
///
/// # Errors
///
/// As of [`read_waveforms`].
pub fn parse_waveforms(path: &Path, bytes: Vec<u8>) -> Result<Rows, WaveformError> {
    parse(bytes).map_err(|problem| match problem {
        Problem::Cell(row, column, found, hint) => {
            WaveformError::Cell { path: path.into(), row, column, found, hint }
        }
        Problem::Format(problem) => WaveformError::Format { path: path.into(), problem },
    })
}

fn parse(bytes: Vec<u8>) -> Result<Rows, Problem> {
    let rows = if npy::is_npy(&bytes) {
        Rows::of_array(npy::parse(bytes)?)
    } else {
        let (numbers, ends) = csv::parse(&bytes)?;
        Rows::of_text(numbers, ends)
    };
    match rows.is_empty() {
        true => Err(Problem::Format("expected at least one row, found none".into())),
        false => Ok(rows),
    }
}
