//! Registration of many pairs of clouds: which pairs, all of them, and what is kept of each.
//!
//! | to | take |
//! |---|---|
//! | list the pairs of a folder or of a table, or consecutive scans | [`PairFiles`] |
//! | register them on all cores, in order | [`Batch::run`] |
//! | judge those whose truth is known, KITTI's sequences too | [`KnownPairs`] |
//! | keep what is done, and go on later | [`Kept`] |
//! | see that no input is overwritten | [`overwritten()`] |
//! | chain consecutive scans to a trajectory | [`sequence`] |
//! | write a line of each pair, and how many succeed | [`Record`], [`Tally`] |

mod batch;
mod kept;
mod kitti;
mod known;
mod list;
mod overwritten;
mod record;
pub mod sequence;

pub use batch::Batch;
pub use kept::{Kept, KeptError};
pub use known::{KnownError, KnownPair, KnownPairs, Tried};
pub use list::{ListError, PairFiles};
pub use overwritten::overwritten;
pub use record::{CSV_HEADING, Record, Tally, worst};

#[cfg(test)]
mod of_tests {
    use std::fs;

    /// A folder with files of these names and texts.
    pub(crate) fn folder(files: &[(&str, &str)]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().expect("a folder");
        for (name, text) in files {
            let path = folder.path().join(name);
            fs::create_dir_all(path.parent().expect("a parent")).expect("a folder");
            fs::write(path, text).expect("a file");
        }
        folder
    }
}
