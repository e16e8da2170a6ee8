//! A folder that is written whole or not at all.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::run_folder::files::{
    FileError, file_error, make_folders, replace, sync_folder_of, toml_text,
};

/// A new folder. Files go into a folder beside it, which takes its name when it is complete and is
/// removed when dropped before.
#[derive(Debug)]
pub struct AtomicFolder {
    folder: PathBuf,
    part: PathBuf,
}

impl AtomicFolder {
    /// Refuses a folder that holds something, or that cannot be made.
    ///
    /// # Errors
    ///
    /// The reason.
    pub fn check_free(folder: &Path) -> Result<(), String> {
        if folder.file_name().is_none() {
            return Err("expected the name of a folder to make".into());
        }
        match fs::read_dir(folder).map(|mut entries| entries.next().is_none()) {
            Ok(true) => Ok(()),
            Ok(false) => Err("the folder is not empty".into()),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
            Err(error) => Err(error.to_string()),
        }
    }

    /// Begins a folder.
    ///
    /// # Errors
    ///
    /// [`FileError`] when nothing can be written beside it.
    pub fn new(folder: &Path) -> Result<Self, FileError> {
        let name = folder.file_name().ok_or_else(|| io::ErrorKind::InvalidFilename.into());
        let mut name = name.map_err(file_error("make the folder", folder))?.to_owned();
        name.push(format!(".part{}", std::process::id()));
        let part = folder.with_file_name(name);
        make_folders(part.parent().unwrap_or(Path::new("")))?;
        // Fails where there is one: it is another process's.
        fs::create_dir(&part).map_err(file_error("make the folder", &part))?;
        Ok(Self { folder: folder.to_owned(), part })
    }

    /// Writes a file of the folder.
    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) -> Result<(), FileError> {
        replace(&self.part.join(name), content.as_ref())
    }

    /// Writes a table as a file of the folder.
    pub fn write_toml(&self, name: &str, table: &impl Serialize) -> Result<(), FileError> {
        self.write(name, toml_text(&self.part.join(name), table)?)
    }

    /// Gives the folder its name, durably.
    ///
    /// # Errors
    ///
    /// [`FileError`] when something has come there meanwhile.
    pub fn finish(self) -> Result<(), FileError> {
        if self.folder.exists() {
            // Fails unless it is empty.
            fs::remove_dir(&self.folder).map_err(file_error("replace", &self.folder))?;
        }
        fs::rename(&self.part, &self.folder)
            .map_err(file_error("make the folder", &self.folder))?;
        sync_folder_of(&self.folder)
    }
}

impl Drop for AtomicFolder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.part); // gone already when it became the folder
    }
}
