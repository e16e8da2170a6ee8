//! Reader of files of waveforms.

use std::path::Path;

use echoloop_files::{FileError, read_data};

use super::hdf5::Selection;
use super::npy::is_npy;
use super::rows::Rows;
use super::{csv, hdf5, npy, scope};

/// Reads waveforms: one a row, CSV without a header, rows of any length, a NumPy `.npy` array of
/// one or two dimensions, or a dataset of an HDF5 file (both recognised by their first bytes, not
/// by their name). Or one below the other: a value a line, a time and values a line, the CSV of a
/// LeCroy or Tektronix oscilloscope.
///
/// A sample is missing where a cell is empty or has the fill value of the file. An empty row is an
/// empty waveform; empty cells at a row's end are dropped. What was not taken for rows of samples
/// is among the [`Rows::remarks`].
///
/// # Errors
///
/// [`FileError`] names the file, the expected content and, for a cell that is no finite number, row
/// and column. A file without rows is an error too, and a selection that leaves several datasets of
/// an HDF5 file, or that names one where there are none.
pub fn read_waveforms(path: &Path, selection: &Selection) -> Result<Rows, FileError> {
    match hdf5::is_hdf5_file(path) {
        true => finished(path, hdf5::read(path, selection)),
        false => parse_waveforms(path, read_data(path).map_err(FileError::io(path))?, selection),
    }
}

/// As [`read_waveforms`], from bytes; `path` is for messages.
pub fn parse_waveforms(
    path: &Path,
    bytes: Vec<u8>,
    selection: &Selection,
) -> Result<Rows, FileError> {
    let parsed = match () {
        () if hdf5::is_hdf5(&bytes) => hdf5::parse(bytes, selection),
        () if selection.name.is_some() => Err("expected HDF5, the only files with datasets".into()),
        () if is_npy(&bytes) => npy::parse(bytes).map(Rows::of_array).and_then(waveforms),
        () => csv::text(&bytes)
            .and_then(|text| {
                csv::parse(text).or_else(|problem| scope::parse(text).unwrap_or(Err(problem)))
            })
            .and_then(waveforms),
    };
    finished(path, parsed)
}

fn waveforms(rows: Rows) -> Result<Rows, String> {
    rows.into_waveforms().not_of_uneven_times()
}

fn finished(path: &Path, parsed: Result<Rows, String>) -> Result<Rows, FileError> {
    let rows = parsed.and_then(not_empty).map_err(FileError::content(path))?;
    Ok(rows.without_fill())
}

/// Reads the rows of a table of numbers, CSV without a header or `.npy`, as they are.
///
/// # Errors
///
/// As [`read_waveforms`].
pub fn read_table(path: &Path) -> Result<Rows, FileError> {
    parse_table(path, read_data(path).map_err(FileError::io(path))?)
}

/// As [`read_table`], from bytes; `path` is for messages.
pub(crate) fn parse_table(path: &Path, bytes: Vec<u8>) -> Result<Rows, FileError> {
    let parsed = match is_npy(&bytes) {
        true => npy::parse(bytes).map(Rows::of_array),
        false => csv::text(&bytes).and_then(csv::parse),
    };
    parsed.and_then(not_empty).map_err(FileError::content(path))
}

fn not_empty(rows: Rows) -> Result<Rows, String> {
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
