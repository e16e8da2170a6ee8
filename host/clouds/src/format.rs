//! The formats that clouds are written in.

use std::path::Path;

use echoloop_files::Column;

use crate::layout::Layout;
use crate::{Cloud, CloudError, pcd, ply};

/// A format that clouds are written in, always binary and little endian.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CloudFormat {
    /// The Stanford polygon format: one element, `vertex`.
    Ply,
    /// That of the Point Cloud Library, 0.7: unorganized, for beams without an echo are left out.
    Pcd,
}

impl CloudFormat {
    /// All.
    pub const ALL: [Self; 2] = [Self::Ply, Self::Pcd];

    /// The extension of its files, and its name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Ply => "ply",
            Self::Pcd => "pcd",
        }
    }

    /// A line of help.
    #[must_use]
    pub fn summary(self) -> &'static str {
        match self {
            Self::Ply => "binary PLY, an element `vertex`",
            Self::Pcd => "binary PCD 0.7, unorganized",
        }
    }

    /// The format of a file by its extension, in any case.
    #[must_use]
    pub fn of(path: &Path) -> Option<Self> {
        let extension = path.extension()?;
        Self::ALL.into_iter().find(|format| extension.eq_ignore_ascii_case(format.name()))
    }

    /// A whole file: `x y z` in m, normals if the cloud has them, `range_sd` if it is known, and
    /// the columns.
    ///
    /// A column of another length than the cloud's is left out. A name that no header takes, or
    /// that stands already, is changed; PLY has whole numbers of 8 bytes as `double`.
    #[must_use]
    pub fn bytes(self, cloud: &Cloud, columns: &[Column]) -> Vec<u8> {
        self.layout().bytes(cloud, columns)
    }

    fn layout(self) -> &'static Layout {
        match self {
            Self::Ply => &ply::LAYOUT,
            Self::Pcd => &pcd::LAYOUT,
        }
    }
}

/// Writes a cloud in the format of the file's name.
///
/// # Errors
///
/// [`CloudError::Output`] when the name ends otherwise, [`CloudError::Io`] when the file cannot be
/// written.
pub fn write_cloud(path: &Path, cloud: &Cloud) -> Result<(), CloudError> {
    let format = CloudFormat::of(path).ok_or_else(|| CloudError::Output { path: path.into() })?;
    std::fs::write(path, format.bytes(cloud, &[]))
        .map_err(|source| CloudError::Io { path: path.into(), source })
}
