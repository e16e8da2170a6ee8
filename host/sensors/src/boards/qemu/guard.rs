//! Guard that ends an emulator whose host was killed, and removes its folder.
//!
//! A process that is killed (`kill -9`, out of memory) drops nothing, but the system closes its
//! pipes. So a shell waits at the end of one, in a process group that the emulator joins as it
//! starts: the group's number is not reused while the shell lives, as that of an ended process may
//! be. The shell starts before the folder is made, so that nothing can be left behind.

use std::fs::{self, DirBuilder};
use std::hash::{BuildHasher, Hasher, RandomState};
use std::io;
use std::os::unix::fs::DirBuilderExt;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

/// Script that waits for the end of its input, ends the emulator, after a second removes the
/// folder, if there is one, and kills the rest of the group, itself included.
const SCRIPT: &str = "read -r _; trap '' TERM; kill -TERM 0; sleep 1; [ -z \"$1\" ] || rm -rf -- \
                      \"$1\"; kill -KILL 0";

/// Shell that waits for this process to end, and the folder that is removed with it or with this.
pub(super) struct Guard {
    shell: Child,
    folder: Option<PathBuf>,
}

impl Guard {
    /// Guard of an emulator whose folder is kept.
    pub(super) fn over_emulator() -> io::Result<Self> {
        Ok(Self { shell: watch(Path::new(""))?, folder: None })
    }

    /// Guard of an emulator and of a new private folder below `parent`.
    pub(super) fn over_new_folder(parent: &Path) -> io::Result<Self> {
        let name = format!("echoloop-{:016x}", RandomState::new().build_hasher().finish());
        let path = parent.join(name);
        let mut guard = Self { shell: watch(&path)?, folder: None };
        // Fails for an existing folder, which must not be removed.
        DirBuilder::new().mode(0o700).create(&path)?;
        guard.folder = Some(path);
        Ok(guard)
    }

    /// New folder.
    pub(super) fn folder(&self) -> Option<&Path> {
        self.folder.as_deref()
    }

    /// Process group for the emulator.
    pub(super) fn group(&self) -> i32 {
        self.shell.id().cast_signed()
    }
}

impl Drop for Guard {
    /// Removes the folder before it ends the shell, which would remove it if this process died now.
    fn drop(&mut self) {
        if let Some(folder) = &self.folder {
            let _ = fs::remove_dir_all(folder);
        }
        let _ = self.shell.kill();
        let _ = self.shell.wait();
    }
}

/// Makes a folder and its missing parents, for this user alone.
pub(super) fn make_private_with_parents(folder: &Path) -> io::Result<()> {
    DirBuilder::new().recursive(true).mode(0o700).create(folder)
}

/// Starts the shell. It holds only its end of the pipe: no folder and no terminal.
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
        // Ignores SIGTERM: it has to be killed.
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
