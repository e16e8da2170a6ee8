//! A folder that a command makes: whole, or not at all.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use super::exit::Failure;
use super::interrupt::INTERRUPTED;
use echoloop_closed_loop::run_folder::files::{
    FileError, file_error, make_folders, replace, sync_folder_of,
};

/// Goes on with work for a draft until ^C was heard.
pub(super) fn go_on(stop: &AtomicBool) -> Result<(), Failure> {
    if stop.load(Ordering::Relaxed) {
        Err(Failure::new(INTERRUPTED, "interrupted; nothing is written"))
    } else {
        Ok(())
    }
}

/// Whether the folder can be made; one that holds something stays as it is.
pub(super) fn check_free(folder: &Path) -> Result<(), Failure> {
    let refused = |why: &str| Failure::usage(format!("--output {}: {why}", folder.display()));
    if folder.file_name().is_none() {
        return Err(refused("expected the name of a folder to make"));
    }
    match fs::read_dir(folder).map(|mut entries| entries.next().is_none()) {
        Ok(true) => Ok(()),
        Ok(false) => Err(refused("the folder is not empty")),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        Err(error) => Err(refused(&error.to_string())),
    }
}

/// A folder beside the one wanted, which becomes that one when it is complete; else it goes.
pub(super) struct Draft {
    path: PathBuf,
}

impl Draft {
    pub(super) fn beside(folder: &Path) -> Result<Self, Failure> {
        let mut name = folder
            .file_name()
            .ok_or_else(|| Failure::usage("--output needs the name of a folder"))?
            .to_owned();
        name.push(format!(".part{}", std::process::id()));
        let path = folder.with_file_name(name);
        let above = path.parent().unwrap_or(Path::new(""));
        make_folders(above)?;
        // Its own, never one that is there.
        fs::create_dir(&path).map_err(file_error("make the folder", &path))?;
        Ok(Self { path })
    }

    pub(super) fn write(&self, name: &str, content: impl AsRef<[u8]>) -> Result<(), Failure> {
        Ok(replace(&self.path.join(name), content.as_ref())?)
    }

    pub(super) fn become_folder(self, folder: &Path) -> Result<(), FileError> {
        if folder.exists() {
            // Empty, else this fails.
            fs::remove_dir(folder).map_err(file_error("replace", folder))?;
        }
        fs::rename(&self.path, folder).map_err(file_error("make the folder", folder))?;
        sync_folder_of(folder)
    }
}

impl Drop for Draft {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.path); // gone already when it became the folder
    }
}
