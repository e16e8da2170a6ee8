//! Writing a cloud: the extension of the file tells the format.

use std::path::Path;

use echoloop_files::{Column, FileError};

use crate::Cloud;
use crate::format::CloudFormat;
use crate::recorded::Recorded;

/// Writes a cloud in the format that the file's extension names.
///
/// # Errors
///
/// [`FileError`] when the extension names no format, or the file cannot be written.
pub fn write_cloud(path: &Path, cloud: &Cloud) -> Result<(), FileError> {
    write(path, cloud, &[])
}

/// [`write_cloud`] with the columns.
pub fn write_recorded(path: &Path, recorded: &Recorded) -> Result<(), FileError> {
    write(path, &recorded.cloud, &recorded.columns)
}

fn write(path: &Path, cloud: &Cloud, columns: &[Column]) -> Result<(), FileError> {
    let expected = || format!("expected a name that ends in {}", CloudFormat::extensions());
    let format = CloudFormat::of(path).ok_or_else(expected).map_err(FileError::content(path))?;
    std::fs::write(path, format.bytes(cloud, columns)).map_err(FileError::io(path))
}
