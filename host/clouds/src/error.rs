//! Why a file gives no cloud.

use std::path::PathBuf;

use crate::Dropped;

/// Why a file gives no cloud.
#[derive(Debug, thiserror::Error)]
pub enum CloudError {
    /// The file cannot be read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The extension names no format we read.
    #[error(
        "{}: expected a .ply, .pcd, .vtk, .bin (KITTI), .xyz, .txt, .asc or .csv file",
        path.display()
    )]
    Extension {
        /// The file.
        path: PathBuf,
    },
    /// The extension names no format we write.
    #[error("{}: expected a name that ends in .ply or .pcd", path.display())]
    Output {
        /// The file.
        path: PathBuf,
    },
    /// The content is not what the format asks for.
    #[error("{}: {problem}", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// What was expected, and what was found.
        problem: String,
    },
    /// The file is in order but holds no echo.
    #[error("{}: expected at least one point, found none ({dropped})", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
        /// Points that were no echo.
        dropped: Dropped,
    },
}
