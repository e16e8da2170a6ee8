//! Fault of a file, named by its path.

use std::io;
use std::path::{Path, PathBuf};

/// Reason why a file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// The file cannot be read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The operating system's error.
        source: io::Error,
    },
    /// Its content, or its name, is not the expected one.
    #[error("{}: {problem}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// Expected and found content.
        problem: String,
    },
    /// A line of it is not the expected one.
    #[error("{}:{line}: {problem}", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// Its line, from 1.
        line: usize,
        /// Expected and found content.
        problem: String,
    },
}

impl FileError {
    /// Adds the path to an error of the operating system.
    pub fn io(path: &Path) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::Io { path: path.into(), source }
    }

    /// Adds the path to a message about the content.
    pub fn content<P: ToString>(path: &Path) -> impl Fn(P) -> Self {
        move |problem| Self::Content { path: path.into(), problem: problem.to_string() }
    }
}
