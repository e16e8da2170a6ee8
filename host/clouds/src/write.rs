//! Writing a cloud: the extension of the file tells the format.

use std::path::Path;

use echoloop_files::Column;

use crate::Cloud;
use crate::error::CloudError;
use crate::format::CloudFormat;
use crate::recorded::Recorded;

/// Writes a cloud in the format that the file's extension names.
///
/// # Errors
///
/// [`CloudError::Output`] when the extension names no format, [`CloudError::Io`] when the file
/// cannot be written.
pub fn write_cloud(path: &Path, cloud: &Cloud) -> Result<(), CloudError> {
    write(path, cloud, &[])
}

/// Writes a cloud and its columns in the format that the file's extension names.
///
/// # Errors
///
/// As for [`write_cloud`].
pub fn write_recorded(path: &Path, recorded: &Recorded) -> Result<(), CloudError> {
    write(path, &recorded.cloud, &recorded.columns)
}

fn write(path: &Path, cloud: &Cloud, columns: &[Column]) -> Result<(), CloudError> {
    let format = CloudFormat::of(path).ok_or_else(|| CloudError::Output { path: path.into() })?;
    std::fs::write(path, format.bytes(cloud, columns))
        .map_err(|source| CloudError::Io { path: path.into(), source })
}
