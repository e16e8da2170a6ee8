//! Writing a cloud: the extension of the file tells the format.

use std::path::Path;

use echoloop_files::FileError;

use crate::Cloud;
use crate::format::CloudFormat;
use crate::recorded::Recorded;

/// Writes a cloud in the format that the file's extension names.
///
/// # Errors
///
/// [`FileError`] when the extension names no format, or the file cannot be written.
pub fn write_cloud(path: &Path, cloud: &Cloud) -> Result<(), FileError> {
    write(path, |format| format.bytes(cloud, &[]))
}

/// [`write_cloud`] with the columns, and with coordinates in the frame and of the type of the file
/// that they came from.
pub fn write_recorded(path: &Path, recorded: &Recorded) -> Result<(), FileError> {
    write(path, |format| format.recorded(recorded))
}

fn write(path: &Path, bytes: impl Fn(CloudFormat) -> Vec<u8>) -> Result<(), FileError> {
    let expected = || format!("expected a name that ends in {}", CloudFormat::extensions());
    let format = CloudFormat::of(path).ok_or_else(expected).map_err(FileError::content(path))?;
    std::fs::write(path, bytes(format)).map_err(FileError::io(path))
}
