//! Reasons why a file gives no cloud.

use std::path::PathBuf;

use crate::Dropped;
use crate::format::{CloudFormat, read_extensions};

/// Reason why a cloud could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum CloudError {
    /// The file cannot be read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The operating system's error.
        source: std::io::Error,
    },
    /// The extension names no format that is read.
    #[error("{}: expected a {} file", path.display(), read_extensions())]
    Extension {
        /// The file.
        path: PathBuf,
    },
    /// The extension names no format that is written.
    #[error("{}: expected a name that ends in {}", path.display(), CloudFormat::extensions())]
    Output {
        /// The file.
        path: PathBuf,
    },
    /// The content breaks the rules of its format.
    #[error("{}: {problem}", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// Expected and found content.
        problem: String,
    },
    /// The file is valid but holds no echo.
    #[error("{}: expected at least one point, found none ({dropped})", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
        /// Points left out because they are no echo.
        dropped: Dropped,
    },
}
