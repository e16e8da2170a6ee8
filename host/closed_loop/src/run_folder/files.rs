//! Atomic files, whole or absent: written beside their place, made durable, then renamed.

use std::fs::{self, File, Metadata, OpenOptions, TryLockError};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use echoloop_files::folder_of;
use serde::Serialize;
use thiserror::Error;

/// Failed operation on a file.
#[derive(Debug, Error)]
#[error("cannot {verb} {}: {source}", path.display())]
pub struct FileError {
    /// Operation: `write`, `open`, `lock`.
    pub verb: &'static str,
    /// The file.
    pub path: PathBuf,
    /// Reason.
    pub source: io::Error,
}

/// Error of an operation on a file, for `map_err`.
pub fn file_error(verb: &'static str, path: &Path) -> impl FnOnce(io::Error) -> FileError {
    move |source| FileError { verb, path: path.to_owned(), source }
}

/// Suffix of a file that is being written.
pub const PART: &str = ".part";

/// Path with a suffix appended.
pub fn beside(path: &Path, ending: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(ending);
    name.into()
}

/// Accepts a path where nothing or a regular file lies. A link is refused, wherever it leads.
///
/// # Errors
///
/// [`FileError`] names what else is in the way.
pub fn is_free_for_a_file(path: &Path) -> Result<(), FileError> {
    match fs::symlink_metadata(path) {
        Ok(found) if found.is_file() => Ok(()),
        Ok(found) => {
            let problem = format!("{} is in the way", kind_of(&found));
            Err(file_error("write", path)(io::Error::other(problem)))
        }
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        Err(error) => Err(file_error("write", path)(error)),
    }
}

fn kind_of(found: &Metadata) -> &'static str {
    if found.is_dir() {
        "a folder"
    } else if found.is_symlink() {
        "a link"
    } else if is_fifo(found) {
        "a FIFO"
    } else {
        "a special file"
    }
}

#[cfg(unix)]
fn is_fifo(found: &Metadata) -> bool {
    std::os::unix::fs::FileTypeExt::is_fifo(&found.file_type())
}

#[cfg(not(unix))]
fn is_fifo(_: &Metadata) -> bool {
    false
}

#[cfg(unix)]
fn is_device(found: &Metadata) -> bool {
    std::os::unix::fs::FileTypeExt::is_char_device(&found.file_type())
}

#[cfg(not(unix))]
fn is_device(_: &Metadata) -> bool {
    false
}

/// True when a path names a descriptor that a shell has opened: `/dev/stdout`, or `/dev/fd/63` of
/// `>(gzip > cloud.ply.gz)`. Opening it does not wait for a reader.
fn is_open_already(path: &Path) -> bool {
    path == Path::new("/dev/stdout")
        || ["/dev/fd", "/proc/self/fd"].iter().any(|at| path.starts_with(at))
}

/// True when a path still leads to this open file, and not through a link.
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let place = |found: Metadata| (found.dev(), found.ino());
    let (open, there) = (file.metadata().map(place), fs::symlink_metadata(path).map(place));
    matches!((open, there), (Ok(open), Ok(there)) if open == there)
}

/// True when a path leads to a regular file, which is all that this system tells.
#[cfg(not(unix))]
fn is_at(_: &File, path: &Path) -> bool {
    fs::symlink_metadata(path).is_ok_and(|found| found.is_file())
}

/// Opens a regular file, and refuses a link, a FIFO or a folder.
pub fn open_own(path: &Path, options: &OpenOptions) -> Result<File, FileError> {
    is_free_for_a_file(path)?;
    options.open(path).map_err(file_error("open", path))
}

/// Creates a part file. Removes one that a process left that died.
///
/// # Errors
///
/// [`FileError`]; a link, a FIFO or a folder in the way stays as it is.
pub fn begin_part(part: &Path) -> Result<File, FileError> {
    is_free_for_a_file(part)?;
    match fs::remove_file(part) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => {
            return Err(file_error("replace", part)(error));
        }
        _ => {}
    }
    // Exclusive: a link or file that appears meanwhile is not opened.
    let mut options = OpenOptions::new();
    options.read(true).write(true).create_new(true).open(part).map_err(file_error("write", part))
}

/// Moves a part file to its place: the content durable first, then renamed, then the name durable.
pub fn settle_part(file: &File, part: &Path, path: &Path) -> Result<(), FileError> {
    file.sync_all().map_err(file_error("write", part))?;
    is_free_for_a_file(path)?;
    fs::rename(part, path).map_err(file_error("write", path))?;
    sync_folder_of(path)
}

/// Makes the names in a file's folder durable.
#[cfg(unix)]
pub fn sync_folder_of(path: &Path) -> Result<(), FileError> {
    let folder = folder_of(path);
    match File::open(folder).and_then(|folder| folder.sync_all()) {
        // Some file systems keep names durable by themselves and refuse the call.
        Err(e) if !matches!(e.kind(), io::ErrorKind::InvalidInput | io::ErrorKind::Unsupported) => {
            Err(file_error("write in", folder)(e))
        }
        _ => Ok(()),
    }
}

/// Does nothing: this system has no call for it.
#[cfg(not(unix))]
pub fn sync_folder_of(_: &Path) -> Result<(), FileError> {
    Ok(())
}

/// Makes a folder and its missing parents, durably.
pub fn make_folders(folder: &Path) -> Result<(), FileError> {
    let is_missing = |path: &&Path| !path.as_os_str().is_empty() && !path.exists();
    let missing: Vec<&Path> = folder.ancestors().take_while(is_missing).collect();
    fs::create_dir_all(folder).map_err(file_error("make the folder", folder))?;
    missing.into_iter().try_for_each(sync_folder_of)
}

/// TOML text of a document, for the file at `path`.
pub fn toml_text(path: &Path, document: &impl Serialize) -> Result<String, FileError> {
    toml::to_string(document).map_err(io::Error::other).map_err(file_error("write", path))
}

/// Replaces a file as a whole, durably.
///
/// # Errors
///
/// [`FileError`]; the old file is then unchanged.
pub fn replace(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    replace_by(&beside(path, PART), path, bytes)
}

fn replace_by(part: &Path, path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    let mut file = begin_part(part)?;
    let written = file.write_all(bytes).map_err(file_error("write", part));
    let settled = written.and_then(|()| settle_part(&file, part, path));
    if settled.is_err() {
        let _ = fs::remove_file(part); // ours: it was not there before
    }
    settled
}

/// Output file that a user names, written when a command is done.
#[derive(Clone, Debug)]
pub struct Output {
    path: PathBuf,
    /// Device, as `/dev/null`, or pipe of the shell: nothing can be renamed to its place.
    is_stream: bool,
}

impl Output {
    /// Checks before any work that the file can be written. What is there stays. A user's own link
    /// is followed.
    ///
    /// # Errors
    ///
    /// [`FileError`] when a folder or a FIFO lies there, or its folder takes no files.
    pub fn at(named: &Path) -> Result<Self, FileError> {
        let path = fs::canonicalize(named).unwrap_or_else(|_| named.to_owned());
        let is_stream =
            |found: Metadata| is_device(&found) || is_fifo(&found) && is_open_already(named);
        let output = Self { is_stream: fs::metadata(&path).is_ok_and(is_stream), path };
        if !output.is_stream {
            is_free_for_a_file(&output.path)?;
            let renamed = |error: FileError| FileError { path: named.to_owned(), ..error };
            begin_part(&output.part()).map_err(renamed)?;
            fs::remove_file(output.part()).map_err(file_error("write", named))?;
        }
        Ok(output)
    }

    /// True for a device or a pipe, whose name has no extension to tell a format by.
    pub fn is_stream(&self) -> bool {
        self.is_stream
    }

    /// Writes the file, whole or not at all. To a device or a pipe it writes what is taken.
    pub fn write(&self, bytes: &[u8]) -> Result<(), FileError> {
        if self.is_stream {
            let opened = OpenOptions::new().write(true).open(&self.path);
            let written = opened.and_then(|mut stream| stream.write_all(bytes));
            return written.map_err(file_error("write", &self.path));
        }
        replace_by(&self.part(), &self.path, bytes)
    }

    /// Part file of this process: another may write the same file, and the later one wins.
    fn part(&self) -> PathBuf {
        beside(&self.path, &format!("{PART}{}", std::process::id()))
    }
}

/// Lock file of one process. The system releases it when the process ends, even when killed.
#[derive(Debug)]
pub struct Lock {
    path: PathBuf,
    file: File,
}

impl Lock {
    /// Takes the lock. Refuses when another process holds it.
    pub fn take(path: &Path) -> Result<Self, FileError> {
        let mut options = OpenOptions::new();
        let file = open_own(path, options.write(true).create(true).truncate(false))?;
        let held = || io::Error::other("another process writes this run; wait for it, or end it");
        match file.try_lock() {
            // Its last holder may have removed the file between opening and locking.
            Ok(()) if is_at(&file, path) => Ok(Self { path: path.to_owned(), file }),
            Ok(()) | Err(TryLockError::WouldBlock) => Err(file_error("lock", path)(held())),
            Err(TryLockError::Error(error)) => Err(file_error("lock", path)(error)),
        }
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        // Removed while held, so that another process that has opened it sees that it is gone.
        if cfg!(unix) && is_at(&self.file, &self.path) {
            let _ = fs::remove_file(&self.path);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_replaced_as_a_whole_and_leaves_no_part() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        fs::write(beside(&path, PART), "left by a process that died").unwrap();
        for text in ["one", "two"] {
            replace(&path, text.as_bytes()).unwrap();
            assert_eq!(fs::read_to_string(&path).unwrap(), text);
        }
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_lock_has_one_holder_at_a_time_and_leaves_no_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lock");
        let held = Lock::take(&path).unwrap();
        let error = Lock::take(&path).unwrap_err().to_string();
        assert!(error.contains("lock") && error.contains("another process"), "{error}");
        drop(held);
        assert!(!path.exists());
        fs::write(&path, "").unwrap(); // its holder was killed
        Lock::take(&path).unwrap();
    }

    #[cfg(unix)]
    #[test]
    fn links_fifos_and_folders_are_named_and_stay_as_they_are() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::write(at("victim"), "precious").unwrap();
        std::os::unix::fs::symlink("victim", at("file.part")).unwrap();
        fs::create_dir(at("other")).unwrap();
        let fifo = std::process::Command::new("mkfifo").arg(at("fifo")).status().unwrap();
        assert!(fifo.success());
        for (name, part) in [("file", "a link"), ("other", "a folder"), ("fifo", "a FIFO")] {
            let error = replace(&at(name), b"new").unwrap_err().to_string();
            assert!(error.contains(name) && error.contains(part), "{error}");
        }
        assert_eq!(fs::read_to_string(at("victim")).unwrap(), "precious");
        for name in ["other", "fifo"] {
            assert!(Output::at(&at(name)).is_err(), "{name}");
        }
        assert!(open_own(&at("fifo"), OpenOptions::new().read(true)).is_err());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 4);
    }

    #[cfg(unix)]
    #[test]
    fn an_output_may_be_a_pipe_that_the_shell_has_opened() {
        use std::io::Read;
        use std::os::fd::AsRawFd;
        let (mut reader, writer) = io::pipe().unwrap();
        let named = format!("/dev/fd/{}", writer.as_raw_fd());
        Output::at(Path::new(&named)).unwrap().write(b"cloud").unwrap();
        drop(writer);
        let mut read = String::new();
        reader.read_to_string(&mut read).unwrap();
        assert_eq!(read, "cloud");
    }

    #[cfg(unix)]
    #[test]
    fn an_output_follows_its_user_s_link_and_a_device_stays_one() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::write(at("cloud"), "old").unwrap();
        std::os::unix::fs::symlink("cloud", at("link")).unwrap();
        Output::at(&at("link")).unwrap().write(b"new").unwrap();
        assert_eq!(fs::read_to_string(at("cloud")).unwrap(), "new");
        assert!(at("link").is_symlink());
        Output::at(Path::new("/dev/null")).unwrap().write(b"new").unwrap();
        assert!(is_device(&fs::metadata("/dev/null").unwrap()));
        let error = Output::at(&at("absent/cloud")).unwrap_err().to_string();
        assert!(error.contains("absent/cloud:"), "{error}");
    }
}
