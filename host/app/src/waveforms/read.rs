//! Reads a file of waveforms.

use std::path::{Path, PathBuf};

use super::problem::Problem;
use super::{csv, npy};

/// Why a file gives no waveforms.
#[derive(Debug, thiserror::Error)]
pub enum WaveformError {
    /// The file cannot be read.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A cell is no number.
    #[error("{}: row {row}, column {column}: expected a finite number, found \
             {found}{hint}", path.display())]
    Cell {
        /// The file.
        path: PathBuf,
        /// Which row, from 1.
        row: usize,
        /// Which column, from 1.
        column: usize,
        /// What stands there.
        found: String,
        /// What may be the matter.
        hint: &'static str,
    },
    /// The content is not what the format asks for.
    #[error("{}: {problem}", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// What was expected, and what was found.
        problem: String,
    },
}

/// Reads one waveform a row: CSV without a header, rows of any length, or a NumPy `.npy` array of
/// one or two dimensions (told by its first bytes, not by its name).
///
/// Every number is finite. An empty row is an empty waveform; empty cells at a row's end are no
/// samples.
///
/// # Errors
///
/// [`WaveformError`] names the file and what was expected of it, where one is at fault the row and
/// column; a file without rows is an error too.
pub fn read_waveforms(path: &Path) -> Result<Vec<Vec<f64>>, WaveformError> {
    let bytes =
        std::fs::read(path).map_err(|source| WaveformError::Io { path: path.into(), source })?;
    parse_waveforms(path, &bytes)
}

/// What [`read_waveforms`] makes of a file's bytes; `path` is for messages.
///
/// # Errors
///
/// As of [`read_waveforms`].
pub fn parse_waveforms(path: &Path, bytes: &[u8]) -> Result<Vec<Vec<f64>>, WaveformError> {
    parse(bytes).map_err(|problem| match problem {
        Problem::Cell(row, column, found, hint) => {
            WaveformError::Cell { path: path.into(), row, column, found, hint }
        }
        Problem::Format(problem) => WaveformError::Format { path: path.into(), problem },
    })
}

fn parse(bytes: &[u8]) -> Result<Vec<Vec<f64>>, Problem> {
    let rows = if npy::is_npy(bytes) { npy::parse(bytes)? } else { csv::parse(bytes)? };
    match rows.is_empty() {
        true => Err(Problem::Format("expected at least one row, found none".into())),
        false => Ok(rows),
    }
}

/// A waveform without the zeros that pad its row to the others' length.
///
/// Zeros at the end are padding, unless the samples before them fall towards zero: with a last step
/// of d down to v, a zero may follow as a sample if v ≤ d. Or the row begins with two zeros. Then
/// as many zeros stay as there are, at most 16: such a record rests at zero, and they are the end
/// of an echo.
pub fn without_padding(row: &[f64]) -> &[f64] {
    let end = row.iter().rposition(|&v| v != 0.0).map_or(0, |last| last + 1);
    let falls_to_zero = match row[..end] {
        [.., before, last] => {
            last.abs() <= (before - last).abs() && (before > last) == (last > 0.0)
        }
        _ => false,
    };
    let kept = if falls_to_zero || row.starts_with(&[0.0, 0.0]) && end > 0 {
        (end + 16).min(row.len())
    } else {
        end
    };
    &row[..kept]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zeros_after_a_record_are_padding() {
        assert_eq!(without_padding(&[200., 210., 300., 222., 0., 0.]), [200., 210., 300., 222.]);
        assert_eq!(without_padding(&[3., 5., 10., 19., 0., 0., 0.]), [3., 5., 10., 19.]);
        assert!(without_padding(&[0.; 9]).is_empty());
        assert!(without_padding(&[]).is_empty());
        assert_eq!(without_padding(&[0., 4., 0., 1.]), [0., 4., 0., 1.]);
    }

    #[test]
    fn zeros_that_an_echo_falls_to_are_samples() {
        assert_eq!(without_padding(&[0., 5., 10., 5., 0., 0.]), [0., 5., 10., 5., 0., 0.]);
        assert_eq!(without_padding(&[0., 0., 100., 0., 0.]), [0., 0., 100., 0., 0.]);
        let mut row = vec![0., 50., 20., 4.];
        row.resize(100, 0.);
        assert_eq!(without_padding(&row).len(), 20);
    }
}
