//! Folder of what is done: a line of each pair as it is done, and sources laid on their targets.

use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use serde::{Deserialize, Serialize};

use crate::list::PairFiles;
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
    done: BTreeMap<String, Line>,
}

/// Line of a record: what was found, and in which files.
#[derive(Clone, Debug, Serialize)]
struct Line {
    #[serde(flatten)]
    record: Record,
    /// None when one was not there, and in folders that were begun before they were kept.
    inputs: Option<Inputs>,
}

/// What a line has besides its record.
#[derive(Deserialize)]
struct Besides {
    inputs: Option<Inputs>,
}

/// Files that a motion was found in, as they were then.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Inputs {
    target: Stamp,
    source: Stamp,
    initial: Option<Stamp>,
}

/// A file as it was: another content has another size or time, as `make` and `git` take it too. A
/// checksum would read a day of scans again only to find them done.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Stamp {
    /// Path without links.
    path: String,
    bytes: u64,
    /// Time of the last change, ns since 1970; 0 where the system does not tell.
    modified_ns: u64,
}

impl Line {
    /// Reads the record and the rest each by itself: serde cannot read a flattened number when
    /// another crate of the program wants numbers as text (`arbitrary_precision`).
    fn read(text: &str) -> Option<Self> {
        let record = serde_json::from_str(text).ok()?;
        let Besides { inputs } = serde_json::from_str(text).ok()?;
        Some(Self { record, inputs })
    }
}

impl Inputs {
    /// None when a file is not there.
    pub(crate) fn of(pair: &PairFiles) -> Option<Self> {
        let initial = match &pair.initial {
            Some(path) => Some(Stamp::of(path)?),
            None => None,
        };
        Some(Self { target: Stamp::of(&pair.target)?, source: Stamp::of(&pair.source)?, initial })
    }
}

impl Stamp {
    fn of(path: &Path) -> Option<Self> {
        let path = fs::canonicalize(path).ok()?;
        let found = fs::metadata(&path).ok()?;
        let since = found.modified().ok().and_then(|time| time.duration_since(UNIX_EPOCH).ok());
        let modified_ns = since.and_then(|since| u64::try_from(since.as_nanos()).ok());
        Some(Self {
            path: path.to_string_lossy().into_owned(),
            bytes: found.len(),
            modified_ns: modified_ns.unwrap_or_default(),
        })
    }
}

impl Kept {
    /// Makes the folder, or reads what is in it: pairs that are done are not done again, unless
    /// their files have changed; those that could not be tried are tried again. `settings` is a
    /// line of text, the same for the same registration.
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
        let tried = lines.filter_map(Line::read).filter(|line| !line.record.is_untried());
        // The last line of a name is that of its laid source.
        let done = tried.map(|line| (line.record.name.clone(), line)).collect();
        Ok(Self { folder: folder.to_owned(), file, done })
    }

    /// Record of a pair that is done: of the same files, unchanged, and with its source laid.
    pub(crate) fn record(&self, pair: &PairFiles) -> Option<&Record> {
        let Line { record, inputs } = self.done.get(&pair.name)?;
        let is_laid = !record.converged || self.laid(&pair.name).exists();
        (is_laid && inputs.is_some() && *inputs == Inputs::of(pair)).then_some(record)
    }

    /// True when the folder may have a source that was laid by a record of this name.
    pub(crate) fn has_laid(&self, name: &str) -> bool {
        self.done.get(name).is_some_and(|line| line.record.converged)
    }

    /// Adds a record. It replaces an earlier one of its name.
    ///
    /// # Errors
    ///
    /// [`KeptError::Io`].
    pub(crate) fn add(&mut self, record: &Record, inputs: Option<Inputs>) -> Result<(), KeptError> {
        let path = self.folder.join(RECORDS);
        let line = Line { record: record.clone(), inputs };
        let text = serde_json::to_string(&line).map_err(io::Error::other);
        let written = text.and_then(|text| self.file.write_all((text + "\n").as_bytes()));
        written.and_then(|()| self.file.flush()).map_err(|error| KeptError::Io { path, error })
    }

    /// Files that a folder has of these pairs, once they are done.
    pub fn files(folder: &Path, pairs: &[PairFiles]) -> Vec<PathBuf> {
        let laid = pairs.iter().map(|pair| laid(folder, &pair.name));
        laid.chain([folder.join(RECORDS)]).collect()
    }

    /// File of the source of a pair in its target's frame.
    pub(crate) fn laid(&self, name: &str) -> PathBuf {
        laid(&self.folder, name)
    }
}

fn laid(folder: &Path, name: &str) -> PathBuf {
    folder.join(format!("{name}.ply"))
}
