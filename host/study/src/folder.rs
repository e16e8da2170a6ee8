//! Folder of a table: its plan, a record for each cell, a run folder for each search.
//!
//! ```text
//! plan.json           shared by all cells: seed, version, settings
//! cells/NAME.json     record of a finished cell: written whole, or absent
//! cells/NAME.failed   reason of a failed cell, which is tried again
//! runs/NAME/          the run of a search, with its journal
//! times.json          duration of each cell
//! table.json          the table
//! report.html         the table and its figures as a page
//! ```

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use echoloop_files::{MOST_TEXT, one_line, read_text};
use serde::Serialize;
use serde::de::DeserializeOwned;
use thiserror::Error;

use super::cell::Cell;
use super::estimate::Times;
use super::folder_plan::FolderPlan;
use super::record::Record;
use echoloop_closed_loop::run_folder::files::{FileError, Lock, file_error, make_folders, replace};

const PLAN: &str = "plan.json";
const CELLS: &str = "cells";
const TIMES: &str = "times.json";
/// Held by the process that writes the folder.
const LOCK: &str = "run.lock";

/// Greatest size of a record, bytes: ten thousand pairs.
const MAX_RECORD_BYTES: u64 = 16 << 20;

/// Reason why a folder cannot be used.
#[derive(Debug, Error)]
pub enum FolderError {
    /// A file of the folder cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The folder has files but no plan.
    #[error(
        "{}: there are files and no {PLAN}, so no table is kept there; expected a folder of \
         `echoloop reproduce`, an empty one or none",
        path.display()
    )]
    NoPlan {
        /// The folder.
        path: PathBuf,
    },
    /// A record of it cannot be read.
    #[error("{0}; remove it, and the cell is run again")]
    BrokenRecord(FileError),
    /// A record is not of this cell and plan.
    #[error(
        "{}: {name} is {was} in it and {is} in the table; remove it, and the cell is run again",
        path.display()
    )]
    OtherRecord {
        /// The record.
        path: PathBuf,
        /// Name of the first value that differs.
        name: &'static str,
        /// Value in the record.
        was: String,
        /// Value expected from the plan or the file's name.
        is: String,
    },
    /// The folder's plan is another.
    #[error(
        "{}: {name} is {was} there and {is} now, and cells of both do not stand in one table; give \
         another folder with --runs, or what is there",
        path.display()
    )]
    OtherPlan {
        /// The folder.
        path: PathBuf,
        /// Name of the first setting that differs.
        name: String,
        /// Value in the folder's plan.
        was: String,
        /// Value wanted now.
        is: String,
    },
}

/// Folder of a table. Locked against other processes, unless opened by [`Folder::look`].
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    /// Settings that its cells share.
    pub plan: FolderPlan,
    _lock: Option<Lock>,
}

impl Folder {
    /// Opens a folder of this plan, or creates it.
    ///
    /// # Errors
    ///
    /// [`FolderError`] names the folder, what differs, and both values; nothing is changed then.
    pub fn open(path: &Path, plan: FolderPlan) -> Result<Self, FolderError> {
        if Self::plan_of(path)?.is_none() {
            make_folders(path)?;
        }
        let lock = Lock::take(&path.join(LOCK))?;
        // Read again: before the lock another process may have written its plan.
        let found = Self::plan_of(path)?;
        let is_new = found.is_none();
        if let Some((name, was, is)) = found.and_then(|found| found.difference(&plan)) {
            let [name, was, is] = [name, was, is].map(|text| one_line(&text));
            return Err(FolderError::OtherPlan { path: path.to_owned(), name, was, is });
        }
        let folder = Self { path: path.to_owned(), plan, _lock: Some(lock) };
        make_folders(&path.join(CELLS))?;
        if is_new {
            folder.write(&folder.path.join(PLAN), &folder.plan)?;
        }
        Ok(folder)
    }

    /// Opens a folder to read, of any plan and without a lock.
    ///
    /// # Errors
    ///
    /// [`FolderError`].
    pub fn look(path: &Path) -> Result<Self, FolderError> {
        let Some(plan) = Self::plan_of(path)? else {
            let problem = io::Error::from(io::ErrorKind::NotFound);
            return Err(file_error("read", &path.join(PLAN))(problem).into());
        };
        Ok(Self { path: path.to_owned(), plan, _lock: None })
    }

    /// Plan of a folder; none of a missing or empty folder.
    fn plan_of(path: &Path) -> Result<Option<FolderPlan>, FolderError> {
        if let Some(plan) = read(&path.join(PLAN))? {
            return Ok(Some(plan));
        }
        let entries = match fs::read_dir(path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            entries => entries.map_err(file_error("read the folder", path))?,
        };
        // Left by a process that died before it wrote its plan.
        let ours = [LOCK, CELLS, "plan.json.part"];
        let is_foreign = |name: &std::ffi::OsString| !ours.iter().any(|own| name == own);
        let mut names = entries.filter_map(|entry| Some(entry.ok()?.file_name()));
        match names.any(|name| is_foreign(&name)) {
            true => Err(FolderError::NoPlan { path: path.to_owned() }),
            false => Ok(None),
        }
    }

    /// Record of a cell; none where it is not finished.
    ///
    /// # Errors
    ///
    /// [`FolderError`] of a record that cannot be read, or is of another cell, seed, version or
    /// build than this folder's.
    pub fn record(&self, cell: &Cell) -> Result<Option<Record>, FolderError> {
        let path = self.cell_file(cell, "json");
        let record: Option<Record> = read(&path).map_err(FolderError::BrokenRecord)?;
        match record.as_ref().and_then(|record| self.plan.mismatch(record, cell)) {
            None => Ok(record),
            Some((name, was, is)) => {
                let [was, is] = [was, is].map(|text| one_line(&text));
                Err(FolderError::OtherRecord { path, name, was, is })
            }
        }
    }

    /// Reason why the last run of a cell failed.
    ///
    /// # Errors
    ///
    /// [`FolderError`].
    pub fn failure(&self, cell: &Cell) -> Result<Option<String>, FolderError> {
        Ok(read(&self.cell_file(cell, "failed"))?)
    }

    /// Writes the record of a finished cell, whole or not at all.
    ///
    /// # Errors
    ///
    /// [`FolderError`].
    pub fn save(&self, record: &Record) -> Result<(), FolderError> {
        self.write(&self.cell_file(&record.cell, "json"), record)?;
        let path = self.cell_file(&record.cell, "failed");
        match fs::remove_file(&path) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => {
                Err(file_error("remove", &path)(error).into())
            }
            _ => Ok(()),
        }
    }

    /// Writes the reason why a cell failed.
    ///
    /// # Errors
    ///
    /// [`FolderError`].
    pub fn save_failure(&self, cell: &Cell, why: &str) -> Result<(), FolderError> {
        self.write(&self.cell_file(cell, "failed"), &why)
    }

    /// Run folder of a cell's search.
    pub fn run_of(&self, cell: &Cell) -> PathBuf {
        self.path.join("runs").join(cell.file_name())
    }

    /// Durations of the cells.
    ///
    /// # Errors
    ///
    /// [`FolderError`].
    pub fn times(&self) -> Result<Times, FolderError> {
        Ok(read(&self.path.join(TIMES))?.unwrap_or_default())
    }

    /// Writes the durations of the cells.
    ///
    /// # Errors
    ///
    /// [`FolderError`].
    pub fn save_times(&self, times: &Times) -> Result<(), FolderError> {
        self.write(&self.path.join(TIMES), times)
    }

    /// Writes the table and its page; returns the page's path.
    ///
    /// # Errors
    ///
    /// [`FolderError`].
    pub fn save_table(&self, table: &impl Serialize, page: &str) -> Result<PathBuf, FolderError> {
        self.write(&self.path.join("table.json"), table)?;
        let path = self.path.join("report.html");
        replace(&path, page.as_bytes())?;
        Ok(path)
    }

    fn cell_file(&self, cell: &Cell, ending: &str) -> PathBuf {
        self.path.join(CELLS).join(format!("{}.{ending}", cell.file_name()))
    }

    fn write(&self, path: &Path, value: &impl Serialize) -> Result<(), FolderError> {
        let text = serde_json::to_string_pretty(value).map_err(io::Error::from);
        let text = text.map_err(file_error("write", path))?;
        Ok(replace(path, (text + "\n").as_bytes())?)
    }
}

/// Reads a JSON file; none where there is no file.
fn read<T: DeserializeOwned>(path: &Path) -> Result<Option<T>, FileError> {
    let text = match read_text(path, MAX_RECORD_BYTES.max(MOST_TEXT)) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        text => text.map_err(file_error("read", path))?,
    };
    let problem = |error: serde_json::Error| io::Error::other(one_line(&error.to_string()));
    serde_json::from_str(&text).map(Some).map_err(problem).map_err(file_error("read", path))
}

#[cfg(test)]
mod tests {
    use super::*;
    use echoloop_closed_loop::config::RunConfig;

    fn plan(seed: u64) -> FolderPlan {
        FolderPlan::new(&RunConfig { seed, ..RunConfig::default() }, false)
    }

    #[test]
    fn a_folder_of_another_seed_or_without_a_plan_is_refused_and_unchanged() {
        let runs = tempfile::tempdir().unwrap();
        let path = runs.path().join("a/b");
        drop(Folder::open(&path, plan(1)).unwrap());
        drop(Folder::open(&path, plan(1)).unwrap());
        let before = fs::read(path.join(PLAN)).unwrap();
        for detour in ["a/b", "missing/../a/b"] {
            let error = Folder::open(&runs.path().join(detour), plan(2)).unwrap_err().to_string();
            assert!(error.contains("seed is 1 there and 2 now"), "{error}");
        }
        assert_eq!(fs::read(path.join(PLAN)).unwrap(), before);

        let other = runs.path().join("photos");
        fs::create_dir(&other).unwrap();
        fs::write(other.join("cat.png"), "").unwrap();
        let error = Folder::open(&other, plan(1)).unwrap_err().to_string();
        assert!(error.contains("photos") && error.contains(PLAN), "{error}");
        assert_eq!(fs::read_dir(&other).unwrap().count(), 1);

        fs::write(path.join(PLAN), "{").unwrap();
        let error = Folder::open(&path, plan(1)).unwrap_err().to_string();
        assert!(error.contains(PLAN), "{error}");
    }

    #[test]
    fn a_folder_is_locked_for_one_process() {
        let runs = tempfile::tempdir().unwrap();
        let _held = Folder::open(runs.path(), plan(1)).unwrap();
        let error = Folder::open(runs.path(), plan(1)).unwrap_err().to_string();
        assert!(error.contains("another process"), "{error}");
        assert_eq!(Folder::look(runs.path()).unwrap().plan, plan(1), "others may read");
    }
}
