//! Reasons why a file gives no cloud.

use std::path::PathBuf;

use echoloop_files::FileError;

use crate::Dropped;

/// Reason why a cloud could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum CloudError {
    /// The file cannot be read or written, its extension names no format, or its content breaks the
    /// rules of its format.
    #[error(transparent)]
    File(#[from] FileError),
    /// The file is valid but holds no echo.
    #[error("{}: expected at least one point, found none ({dropped})", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
        /// Points left out because they are no echo.
        dropped: Dropped,
    },
}
