//! Ends an emulator whose host was killed, and removes its folder: nobody else is left to.
//!
//! A process that is killed (`kill -9`, no memory left) drops nothing. What the system does for it
//! is to close its pipes. So a shell waits at the end of one, in a process group that the emulator
//! joins as it starts: a group cannot be confused with another, as a number of a process that has
//! ended can. The shell is there before the folder, so that there is no moment in which something
//! could be left.

use std::fs::{self, DirBuilder};
use std::hash::{BuildHasher, Hasher, RandomState};
use std::io;
use std::os::unix::fs::DirBuilderExt;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

/// Waits for the end of its input, ends the emulator, and once that has gone removes the folder,
/// if there is one; at last what did not end, itself included.
const SCRIPT: &str = "read -r _; trap '' TERM; kill -TERM 0; sleep 1; [ -z \"$1\" ] || rm -rf -- \
                      \"$1\"; kill -KILL 0";

/// A shell that waits for this process to end, and the folder that goes away with it or with this.
pub(super) struct Guard {
    shell: Child,
    folder: Option<PathBuf>,
}

impl Guard {
    /// Over an emulator whose folder is kept.
    pub(super) fn over_emulator() -> io::Result<Self> {
        Ok(Self { shell: watch(Path::new(""))?, folder: None })
    }

    /// Over a new folder below `parent`, which nobody else may enter, and an emulator.
    pub(super) fn over_new_folder(parent: &Path) -> io::Result<Self> {
        let name = format!("echoloop-{:016x}", RandomState::new().build_hasher().finish());
        let path = parent.join(name);
        let mut guard = Self { shell: watch(&path)?, folder: None };
        make_private(&path)?; // one that is there already is not ours to remove
        guard.folder = Some(path);
        Ok(guard)
    }

    /// The new folder.
    pub(super) fn folder(&self) -> Option<&Path> {
        self.folder.as_deref()
    }

    /// The process group for the emulator to be in.
    pub(super) fn group(&self) -> i32 {
        self.shell.id().cast_signed()
    }
}

impl Drop for Guard {
    /// The folder first: until it has gone, somebody must be there to remove it.
    fn drop(&mut self) {
        if let Some(folder) = &self.folder {
            let _ = fs::remove_dir_all(folder);
        }
        let _ = self.shell.kill();
        let _ = self.shell.wait();
    }
}

/// Makes a folder, and those above it that are not there, for this user alone.
pub(super) fn make_private_with_parents(folder: &Path) -> io::Result<()> {
    DirBuilder::new().recursive(true).mode(0o700).create(folder)
}

fn make_private(folder: &Path) -> io::Result<()> {
    DirBuilder::new().mode(0o700).create(folder)
}

/// The shell holds nothing of ours but its end of the pipe: no folder, no terminal.
fn watch(folder: &Path) -> io::Result<Child> {
    let mut shell = Command::new("/bin/sh");
    shell.args(["-c", SCRIPT, "echoloop-guard"]).arg(folder).current_dir("/").process_group(0);
    shell.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::null()).spawn()
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt;
    use std::time::Duration;

    use super::*;

    fn emulator(guard: &Guard) -> Child {
        // Deaf to a request: it has to be killed.
        let mut command = Command::new("/bin/sh");
        command.args(["-c", "trap '' TERM; sleep 10 & wait; sleep 10"]);
        command.process_group(guard.group()).spawn().expect("a shell")
    }

    #[test]
    fn the_folder_is_private_and_goes_away_with_its_guard() {
        let parent = tempfile::tempdir().expect("a folder");
        let guard = Guard::over_new_folder(parent.path()).expect("a guard");
        let folder = guard.folder().expect("a new folder").to_owned();
        let mode = fs::metadata(&folder).expect("a folder").permissions().mode();
        assert_eq!(mode & 0o777, 0o700);
        fs::write(folder.join("memory"), "1").expect("a file");
        let shell = format!("/proc/{}", guard.shell.id());
        drop(guard);
        assert!(!folder.exists() && !Path::new(&shell).exists());
    }

    #[test]
    fn when_the_pipe_closes_emulator_and_folder_go_away() {
        let parent = tempfile::tempdir().expect("a folder");
        let mut guard = Guard::over_new_folder(parent.path()).expect("a guard");
        let folder = guard.folder().expect("a new folder").to_owned();
        fs::write(folder.join("memory"), "1").expect("a file");
        let mut emulator = emulator(&guard);
        std::thread::sleep(Duration::from_millis(200));
        assert!(emulator.try_wait().expect("a child").is_none() && folder.exists());
        drop(guard.shell.stdin.take()); // as the system does when this process is killed
        guard.shell.wait().expect("a child"); // it ends itself
        assert!(!folder.exists());
        assert!(!emulator.wait().expect("a child").success());
    }

    #[test]
    fn a_kept_folder_is_kept() {
        let kept = tempfile::tempdir().expect("a folder");
        let mut guard = Guard::over_emulator().expect("a guard");
        assert_eq!(guard.folder(), None);
        let mut emulator = emulator(&guard);
        drop(guard.shell.stdin.take());
        guard.shell.wait().expect("a child");
        assert!(!emulator.wait().expect("a child").success());
        assert!(kept.path().exists());
        make_private_with_parents(&kept.path().join("a/b")).expect("folders");
        let mode = fs::metadata(kept.path().join("a")).expect("a folder").permissions().mode();
        assert_eq!(mode & 0o777, 0o700);
    }
}
