//! Run folders with links, FIFOs, folders and left-over files in them, before and during writing:
//! the obstacle is named, nothing is written through a link, nothing hangs.

use std::fs;
use std::os::unix::fs::{FileTypeExt, symlink};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;

use echoloop_closed_loop::run_folder::files::Output;
use echoloop_closed_loop::run_folder::run::RunFolder;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use tempfile::TempDir;

use crate::campaign::{Campaign, Verdict};

/// Names of all files that a run writes, and of its lock.
const NAMES: [&str; 9] = [
    "config.toml",
    "history.jsonl",
    "result.json",
    "about.json",
    "report.html",
    "before.ply",
    "after.ply",
    "README.txt",
    "run.lock",
];

const PRECIOUS: &str = "precious";

/// A FIFO to link to. It has no reader, so opening it would hang.
static FIFO: LazyLock<(TempDir, PathBuf)> = LazyLock::new(|| {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("fifo");
    assert!(Command::new("mkfifo").arg(&path).status().expect("mkfifo runs").success());
    (folder, path)
});

/// A run's folder, and a file beside it that must not change.
struct Scene {
    folder: TempDir,
    run: PathBuf,
}

impl Scene {
    fn new() -> Self {
        let folder = tempfile::tempdir_in(FIFO.0.path()).expect("a folder");
        fs::write(folder.path().join("victim"), PRECIOUS).expect("a file");
        let run = RunFolder::create(folder.path(), "a").expect("a run");
        run.write("config.toml", "first").expect("a file");
        Self { run: run.path().to_owned(), folder }
    }

    fn victim(&self) -> PathBuf {
        self.folder.path().join("victim")
    }

    /// Puts something at the path of one of the run's files; returns its name if it is an obstacle.
    fn obstruct(&self, rng: &mut ChaCha8Rng) -> Option<String> {
        let name = NAMES[rng.random_range(0..NAMES.len())];
        let ending = if name != "run.lock" && rng.random() { ".part" } else { "" };
        let name = format!("{name}{ending}");
        let path = self.run.join(&name);
        if path.symlink_metadata().is_ok_and(|found| !found.is_file()) {
            return Some(name); // something is there already
        }
        let _ = fs::remove_file(&path);
        match rng.random_range(0..6) {
            0 => fs::create_dir(&path),
            1 => fs::create_dir(&path).and_then(|()| fs::write(path.join("kept"), PRECIOUS)),
            2 => symlink(self.victim(), &path),
            3 => symlink(self.folder.path().join("absent"), &path),
            4 => fs::hard_link(&FIFO.1, &path),
            _ => {
                return fs::write(&path, "left by a process that died")
                    .map(|()| None)
                    .expect(&name);
            }
        }
        .expect(&name);
        Some(name)
    }

    /// Paths and contents of the run's folder.
    fn seen(&self) -> Vec<(PathBuf, String)> {
        let look = |path: PathBuf| {
            let found = path.symlink_metadata().expect("an entry").file_type();
            let content = match () {
                () if found.is_file() => fs::read_to_string(&path).expect("a file"),
                () if found.is_fifo() => "FIFO".into(),
                () if found.is_symlink() => format!("link to {:?}", fs::read_link(&path)),
                () => "folder".into(),
            };
            (path, content)
        };
        let entries = fs::read_dir(&self.run).expect("a folder");
        let mut seen: Vec<_> = entries.map(|entry| look(entry.expect("an entry").path())).collect();
        seen.sort();
        seen
    }

    fn unharmed(&self) -> Result<(), String> {
        let victim = fs::read_to_string(self.victim()).map_err(|error| error.to_string())?;
        if victim != PRECIOUS || self.folder.path().join("absent").exists() {
            return Err("a link was written through".into());
        }
        Ok(())
    }
}

#[test]
fn an_obstacle_in_a_run_folder_is_named_and_nothing_is_written_through_it() {
    Campaign { kind: "run_folder", cases: 300 }.run(|rng| {
        let scene = Scene::new();
        let verdict = opened(rng, &scene);
        scene.unharmed().and(verdict)
    });
}

fn opened(rng: &mut ChaCha8Rng, scene: &Scene) -> Verdict {
    let obstacles = (0..rng.random_range(0..4)).filter_map(|_| scene.obstruct(rng));
    let obstacles: Vec<String> = obstacles.collect();
    let before = scene.seen();
    match RunFolder::open(&scene.run).map(drop) {
        Err(error) if scene.seen() != before => Err(format!("refused, and changed: {error}")),
        Err(error) if named(&error.to_string(), &obstacles) => Ok("named and refused"),
        Err(error) => Err(format!("{obstacles:?}: {error}")),
        Ok(()) if !obstacles.is_empty() => Err(format!("opened over {obstacles:?}")),
        Ok(()) => written(rng, scene),
    }
}

fn named(error: &str, obstacles: &[String]) -> bool {
    obstacles.iter().any(|name| error.contains(&format!("{name}:")))
}

/// Writes all files while obstacles appear.
fn written(rng: &mut ChaCha8Rng, scene: &Scene) -> Verdict {
    let run = RunFolder::open(&scene.run).map_err(|error| error.to_string())?;
    if RunFolder::open(&scene.run).is_ok() {
        return Err("the folder was opened twice".into());
    }
    let mut obstacles: Vec<String> = Vec::new();
    for name in &NAMES[..7] {
        if rng.random_range(0..4) == 0 {
            obstacles.extend(scene.obstruct(rng));
        }
        match run.write(name, "new") {
            Err(error) if named(&error.to_string(), &obstacles) => return Ok("named on the way"),
            Err(error) => return Err(format!("{obstacles:?}: {error}")),
            Ok(()) if at(&scene.run.join(name))? != "new" => {
                return Err(format!("{name} is not what was written"));
            }
            Ok(()) => {}
        }
    }
    Ok("written")
}

/// Content of a regular file.
fn at(path: &Path) -> Result<String, String> {
    let is_file = path.symlink_metadata().is_ok_and(|found| found.is_file());
    let text = is_file.then(|| fs::read_to_string(path).ok()).flatten();
    text.ok_or_else(|| format!("{} is no file", path.display()))
}

#[test]
fn an_output_is_written_whole_or_its_obstacle_is_named() {
    Campaign { kind: "run_folder", cases: 300 }.run(|rng| {
        let scene = Scene::new();
        let mut blocked = scene.obstruct(rng);
        let name = blocked.clone().unwrap_or_else(|| "cloud.ply".into());
        let path = scene.run.join(&name);
        // A link to a file is followed.
        blocked = blocked.filter(|_| fs::metadata(&path).is_ok_and(|found| !found.is_file()));
        let output = Output::at(&path);
        let wrote = output
            .map_err(|e| e.to_string())
            .and_then(|output| output.write(b"cloud").map_err(|error| error.to_string()));
        match (wrote, blocked) {
            (Err(error), Some(_)) if error.contains(&name) => Ok("named and refused"),
            (Ok(()), None) if fs::read(&path).is_ok_and(|bytes| bytes == b"cloud") => Ok("written"),
            // A dangling link cannot be written.
            (Err(error), None) if path.is_symlink() && error.contains("a link") => {
                Ok("named and refused")
            }
            (wrote, blocked) => Err(format!("{name}, blocked {blocked:?}: {wrote:?}")),
        }
    });
}
