//! Reader of files of waveforms.

use std::path::Path;

use echoloop_files::{FileError, read_data};

use super::rows::Rows;
use super::{csv, npy};

/// Reads one waveform a row: CSV without a header, rows of any length, or a NumPy `.npy` array of
/// one or two dimensions (recognised by its first bytes, not by its name).
///
/// Every number must be finite. An empty row is an empty waveform; empty cells at a row's end are
/// dropped.
///
/// # Errors
///
/// [`FileError`] names the file, the expected content and, for a cell, row and column. A file
/// without rows is an error too.
pub fn read_waveforms(path: &Path) -> Result<Rows, FileError> {
    parse_waveforms(path, read_data(path).map_err(FileError::io(path))?)
}

/// As [`read_waveforms`], from bytes; `path` is for messages.
pub fn parse_waveforms(path: &Path, bytes: Vec<u8>) -> Result<Rows, FileError> {
    parse(bytes).map_err(FileError::content(path))
}

fn parse(bytes: Vec<u8>) -> Result<Rows, String> {
    let rows = if npy::is_npy(&bytes) {
        Rows::of_array(npy::parse(bytes)?)
    } else {
        let (numbers, ends) = csv::parse(&bytes)?;
        Rows::of_text(numbers, ends)
    };
    match rows.is_empty() {
        true => Err("expected at least one row, found none".into()),
        false => Ok(rows),
    }
}

/// Message about a cell that is no finite number: row and column from 1, its text, and a likely
/// reason, which may be empty.
pub(super) fn no_number(row: usize, column: usize, found: &str, hint: &str) -> String {
    format!("row {row}, column {column}: expected a finite number, found {found}{hint}")
}
