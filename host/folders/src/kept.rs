//! Folder of what is done: a line of each pair as it is done, and sources laid on their targets.

use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use crate::record::Record;

/// Name of the file of records, a line of JSON each after the line of the settings.
const RECORDS: &str = "registered.jsonl";

/// A folder that cannot be gone on with.
#[derive(Debug, thiserror::Error)]
pub enum KeptError {
    /// It cannot be read or written.
    #[error("{}: {error}", path.display())]
    Io {
        /// File or folder.
        path: PathBuf,
        /// Reason.
        error: io::Error,
    },
    /// It has records of other settings or other pairs.
    #[error(
        "{}: its records are of other settings ({found}), and {asked} are asked for: take another \
         folder, or the same settings",
        path.display()
    )]
    Other {
        /// The file.
        path: PathBuf,
        /// Settings that it has.
        found: String,
        /// Settings asked for.
        asked: String,
    },
}

/// Folder of what is done.
pub struct Kept {
    folder: PathBuf,
    file: File,
    done: BTreeMap<String, Record>,
}

impl Kept {
    /// Makes the folder, or reads what is in it: pairs that are done are not done again, and those
    /// that could not be tried are tried again. `settings` is a line of text, the same for the same
    /// registration.
    ///
    /// # Errors
    ///
    /// [`KeptError`], of a folder with records of other settings.
    pub fn open(folder: &Path, settings: &str) -> Result<Self, KeptError> {
        let path = folder.join(RECORDS);
        let io = |error| KeptError::Io { path: path.clone(), error };
        fs::create_dir_all(folder).map_err(io)?;
        let mut options = OpenOptions::new();
        let mut file =
            options.read(true).write(true).create(true).truncate(false).open(&path).map_err(io)?;
        let mut text = String::new();
        file.read_to_string(&mut text).map_err(io)?;
        // A line that was cut short is done again.
        let whole = text.rfind('\n').map_or(0, |end| end + 1);
        let mut lines = text[..whole].lines();
        match lines.next() {
            None => {
                file.set_len(0).map_err(io)?;
                file.seek(SeekFrom::Start(0)).map_err(io)?;
                writeln!(file, "{settings}").map_err(io)?;
            }
            Some(found) if found != settings => {
                let (found, asked) = (found.to_owned(), settings.to_owned());
                return Err(KeptError::Other { path, found, asked });
            }
            Some(_) => {
                file.set_len(whole as u64).map_err(io)?;
                file.seek(SeekFrom::End(0)).map_err(io)?;
            }
        }
        let records = lines.filter_map(|line| serde_json::from_str::<Record>(line).ok());
        let tried = records.filter(|record| !record.is_untried());
        let done = tried.map(|record| (record.name.clone(), record)).collect();
        Ok(Self { folder: folder.to_owned(), file, done })
    }

    /// Record of a pair that is done.
    pub fn record(&self, name: &str) -> Option<&Record> {
        self.done.get(name)
    }

    /// Adds a record.
    ///
    /// # Errors
    ///
    /// [`KeptError::Io`].
    pub fn add(&mut self, record: &Record) -> Result<(), KeptError> {
        let written = self.file.write_all(record.to_json().as_bytes());
        let path = self.folder.join(RECORDS);
        written.and_then(|()| self.file.flush()).map_err(|error| KeptError::Io { path, error })
    }

    /// File of the source of a pair in its target's frame.
    pub fn laid(&self, name: &str) -> PathBuf {
        self.folder.join(format!("{name}.ply"))
    }
}
