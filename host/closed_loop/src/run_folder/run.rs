//! Folder of a run: files to look at, to repeat the run from, or to resume it.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use echoloop_dsp::{Kind, PARAMETERS, Parameter};
use serde::{Deserialize, Serialize};

use crate::config::RunConfig;
use crate::evaluation::compare::Comparison;
use crate::evaluation::summary::Summary;
use crate::front::Front;
#[cfg(doc)]
use crate::parameters::ThetaReg;
use crate::parameters::{Axis, Scale, Values, written_values};
use crate::run_folder::files::{
    FileError, Lock, Output, PART, beside, file_error, is_free_for_a_file, make_folders, replace,
    sync_folder_of, toml_text,
};
use crate::search::{Check, Finalist, Stage};

/// Configuration of the run, with every value.
pub const CONFIG: &str = "config.toml";
/// Journal of the search.
pub const HISTORY: &str = "history.jsonl";
/// Journal of the search for a front.
pub const FRONT: &str = "front.jsonl";
/// Configuration that starts with the tuned parameters.
pub const TUNED: &str = "tuned.toml";
/// Result.
pub const RESULT: &str = "result.json";
/// Provenance: commands, versions and times.
pub const ABOUT: &str = "about.json";
/// Report page.
pub const REPORT: &str = "report.html";
/// Cloud of the shown pair with default parameters.
pub const BEFORE: &str = "before.ply";
/// Cloud of the shown pair with tuned parameters.
pub const AFTER: &str = "after.ply";

const README: &str = "README.txt";

/// Suffix of a journal that was put aside when its run was extended.
const BEFORE_EXTENDED: &str = ".before";

/// Lock of the process that writes the run; removed when it ends.
const LOCK: &str = "run.lock";

/// Files of a run's folder.
const WRITTEN: [&str; 10] =
    [CONFIG, HISTORY, FRONT, TUNED, RESULT, ABOUT, REPORT, BEFORE, AFTER, README];

/// Version of [`RESULT`]'s format.
pub const RESULT_FORMAT: u64 = 1;

/// Result of a run. It has no times and no paths: the same configuration gives the same bytes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunResult {
    /// Version of this format.
    pub format: u32,
    /// Protocol: the parameters that were tuned.
    pub protocol: String,
    /// The registration method.
    pub method: String,
    /// The scene.
    pub scene: String,
    /// The seed.
    pub seed: u64,
    /// Generations searched.
    pub generations: usize,
    /// Registrations of the search.
    pub registrations: usize,
    /// [`Origin`](crate::search::Origin) of the tuned parameters, as text.
    pub origin: String,
    /// All parameters at the start.
    #[serde(serialize_with = "written_values")]
    pub default: Values,
    /// All parameters after tuning.
    #[serde(serialize_with = "written_values")]
    pub tuned: Values,
    /// Finalists of the final selection, best first.
    pub finalists: Vec<Finalist>,
    /// Check of the selected parameters on pairs that no search has seen, if configured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub check: Option<Check>,
    /// Sensor settings of the start with the plain method ([`ThetaReg::plain`]); absent when the
    /// start's method is plain.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plain_summary: Option<Summary>,
    /// Summary of the start on held-out pairs.
    pub default_summary: Summary,
    /// Summary of the tuned parameters on held-out pairs.
    pub tuned_summary: Summary,
    /// Error of the tuned parameters minus that of the start, pair by pair.
    pub comparison: Comparison,
    /// Front of error against a cost, if one was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub front: Option<Front>,
    /// Further data of the report page; absent in results of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub background: Option<Background>,
}

impl RunResult {
    /// Held-out pair to show: the one with the largest error by the default parameters.
    pub fn shown_pair(&self) -> usize {
        let errors = &self.default_summary.errors;
        let worst = errors.iter().max_by(|a, b| a.frobenius.total_cmp(&b.frobenius));
        worst.map_or(0, |error| error.pair)
    }
}

/// Data that only a running search has, kept so that its page can be written again.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Background {
    /// The scene's triangles.
    pub triangles: usize,
    /// The scan pattern in a few words.
    pub beams: String,
    /// Place of each held-out pair.
    pub places: Vec<String>,
    /// Stages in their order.
    pub stages: Vec<Stage>,
    /// The axes of the cube, in the order of its coordinates.
    pub axes: Vec<AxisRecord>,
    /// Names of the axes of the last stage.
    pub correlated: Vec<String>,
    /// Correlations of these axes at the end of that stage.
    pub correlations: Vec<Vec<f64>>,
    /// Share of the covariance that the optimiser can have learned, 0 to 1.
    pub covariance_learned: f64,
}

/// Axis of the cube.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AxisRecord {
    /// Section and key of the configuration.
    pub name: String,
    /// Unit; empty for plain numbers.
    pub unit: String,
    /// Scale from coordinate to value.
    pub scale: Scale,
    /// Least value.
    pub min: f64,
    /// Greatest value.
    pub max: f64,
}

impl AxisRecord {
    /// [`Axis`] with these bounds, without name and unit.
    pub fn axis(&self) -> Axis {
        let Self { scale, min, max, .. } = *self;
        Axis { name: "", unit: "", scale, min, max, default: min }
    }
}

impl From<&Axis> for AxisRecord {
    fn from(axis: &Axis) -> Self {
        Self {
            name: axis.name.into(),
            unit: axis.unit.into(),
            scale: axis.scale,
            min: axis.min,
            max: axis.max,
        }
    }
}

/// Folder of a run, locked against other processes while this lives.
#[derive(Debug)]
pub struct RunFolder {
    path: PathBuf,
    _lock: Lock,
}

impl RunFolder {
    /// Checks, without making one, that run folders can be made below `runs`: tracing comes first
    /// and takes long.
    ///
    /// # Errors
    ///
    /// [`FileError`] when something is in the way, or nothing can be written there.
    pub fn check(runs: &Path) -> Result<(), FileError> {
        let made = |kind: io::ErrorKind| file_error("make the folder", runs)(kind.into());
        let there = |path: &&Path| path.as_os_str().is_empty() || path.symlink_metadata().is_ok();
        let nearest = runs.ancestors().find(there).unwrap_or(Path::new(""));
        let nearest = if nearest.as_os_str().is_empty() { Path::new(".") } else { nearest };
        if !nearest.is_dir() {
            return Err(made(io::ErrorKind::NotADirectory));
        }
        check_latest(&runs.join(LATEST))?;
        Output::at(&nearest.join(LOCK)).map_err(|error| made(error.source.kind()))?;
        Ok(())
    }

    /// Makes the next free folder `runs/NNNN-name`.
    ///
    /// # Errors
    ///
    /// [`FileError`] when a folder cannot be made.
    pub fn create(runs: &Path, name: &str) -> Result<Self, FileError> {
        make_folders(runs)?;
        let mut number = next_number(runs)?;
        let path = loop {
            let path = runs.join(format!("{number:04}-{name}"));
            match fs::create_dir(&path) {
                Ok(()) => break path,
                // Another run has just taken this number.
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists && number < u32::MAX => {
                    number += 1
                }
                Err(source) => return Err(FileError { verb: "make the folder", path, source }),
            }
        };
        sync_folder_of(&path)?;
        let folder = Self { _lock: Lock::take(&path.join(LOCK))?, path };
        folder.write(README, readme())?;
        Ok(folder)
    }

    /// Opens the run folder at this path, or makes it with this configuration.
    ///
    /// # Errors
    ///
    /// [`FileError`], as of [`Self::create`] and [`Self::open`].
    pub fn at(path: &Path, config: &RunConfig) -> Result<Self, FileError> {
        if path.join(CONFIG).exists() {
            return Self::open(path);
        }
        make_folders(path)?;
        let folder = Self { _lock: Lock::take(&path.join(LOCK))?, path: path.to_owned() };
        folder.write(README, readme())?;
        folder.write_toml(CONFIG, config)?;
        Ok(folder)
    }

    /// Opens the folder of a run to resume it.
    ///
    /// # Errors
    ///
    /// [`FileError`] when it holds no configuration, when another process has locked it, or when
    /// something other than a regular file is where a file will be written.
    pub fn open(path: &Path) -> Result<Self, FileError> {
        let config = path.join(CONFIG);
        fs::metadata(&config).map_err(file_error("resume without", &config))?;
        for name in WRITTEN {
            let file = path.join(name);
            is_free_for_a_file(&file)?;
            is_free_for_a_file(&beside(&file, PART))?;
        }
        Ok(Self { path: path.to_owned(), _lock: Lock::take(&path.join(LOCK))? })
    }

    /// Path of the folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Path of a file in the folder.
    pub fn file(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// Writes a file as a whole, durably.
    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) -> Result<(), FileError> {
        replace(&self.file(name), content.as_ref())
    }

    /// Writes a document as a TOML file.
    pub fn write_toml(&self, name: &str, document: &impl Serialize) -> Result<(), FileError> {
        self.write(name, toml_text(&self.file(name), document)?)
    }

    /// Writes a document as a JSON file.
    pub fn write_json(&self, name: &str, document: &impl Serialize) -> Result<(), FileError> {
        let text = serde_json::to_string_pretty(document).map_err(io::Error::from);
        self.write(name, text.map_err(file_error("write", &self.file(name)))? + "\n")
    }

    /// Renames a journal that the run will not resume. Does nothing when there is none; replaces
    /// one that was put aside before.
    pub fn put_aside(&self, name: &str) -> Result<(), FileError> {
        let path = self.file(name);
        if !path.exists() {
            return Ok(());
        }
        let aside = beside(&path, BEFORE_EXTENDED);
        fs::rename(&path, &aside).map_err(file_error("rename", &path))?;
        sync_folder_of(&path)
    }

    /// Points the link `latest` in the parent folder here. Without links, a file holds the name.
    pub fn become_latest(&self) -> Result<(), FileError> {
        let (Some(runs), Some(name)) = (self.path.parent(), self.path.file_name()) else {
            return Ok(());
        };
        let latest = runs.join(LATEST);
        check_latest(&latest)?;
        point_at(&latest, Path::new(name))
    }
}

/// Link to the newest run.
const LATEST: &str = "latest";

/// Refuses anything at `latest` but a link, which may be replaced.
#[cfg(unix)]
fn check_latest(latest: &Path) -> Result<(), FileError> {
    match fs::symlink_metadata(latest) {
        Ok(found) if !found.is_symlink() => {
            let problem = "it is no link, and a run would have to replace it";
            Err(file_error("link", latest)(io::Error::other(problem)))
        }
        _ => Ok(()),
    }
}

#[cfg(not(unix))]
fn check_latest(latest: &Path) -> Result<(), FileError> {
    is_free_for_a_file(latest)
}

/// Links beside the place and renames, so that there is a `latest` at any time.
#[cfg(unix)]
fn point_at(latest: &Path, name: &Path) -> Result<(), FileError> {
    let part = beside(latest, &format!("{PART}{}", std::process::id()));
    std::os::unix::fs::symlink(name, &part).map_err(file_error("link", &part))?;
    fs::rename(&part, latest).map_err(file_error("link", latest))
}

#[cfg(not(unix))]
fn point_at(latest: &Path, name: &Path) -> Result<(), FileError> {
    replace(latest, name.to_string_lossy().as_bytes())
}

/// Highest number of a run in the folder, plus one.
fn next_number(runs: &Path) -> Result<u32, FileError> {
    let entries = fs::read_dir(runs).map_err(file_error("read the folder", runs))?;
    let numbers = entries.filter_map(|entry| {
        let name = entry.ok()?.file_name();
        name.to_str()?.split('-').next()?.parse::<u32>().ok()
    });
    Ok(numbers.max().unwrap_or(0).saturating_add(1))
}

const FILES: &str = "\
What is in this folder
======================

config.toml    every value the run depends on; `echoloop tune --config config.toml` repeats it
history.jsonl  the journal: one JSON line a generation, on the disk before the next begins; \
`echoloop tune --resume .`
               goes on from it; `check` is a CRC-64/XZ of the line's text before it, and of the \
check before that
front.jsonl    of `--pareto`: the journal of the search for a front
tuned.toml     config.toml with the tuned parameters to start with: `echoloop scan --config \
tuned.toml`
result.json    parameters before and after, the final choice, and every held-out pair; no times, \
so equal runs are equal
about.json     the commands that made the run: version, build, date; what result.json leaves out
report.html    the same to look at: one file, no network needed; `echoloop report .` writes it again
before.ply     one held-out pair with the default parameters: target, and source laid on it \
(target's frame, metres)
after.ply      the same pair with the tuned parameters

Poses: first_from_second maps points of the second scan into the frame of the first; x ahead, y \
left, z up.
Units are in the names: _m metres, _deg degrees, _pct percent. Those of the sensor's parameters, \
and the numbers of choices in
result.json and history.jsonl:

";

/// Text of README.txt: the files, and the unit of every parameter of the sensor.
fn readme() -> String {
    let line = |p: &Parameter| {
        let unit = match p.kind {
            Kind::Choice { names } => {
                let numbered: Vec<String> =
                    names.iter().zip(0..).map(|(name, code)| format!("{code} {name}")).collect();
                numbered.join(", ")
            }
            _ if p.unit.is_empty() => "a number".into(),
            _ => p.unit.into(),
        };
        let follows =
            if p.default.is_none() { "; left out, it follows the pulse width" } else { "" };
        format!("lidar.{:<20} {unit}{follows}\n", p.name)
    };
    FILES.to_owned() + &PARAMETERS.iter().map(line).collect::<String>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_are_numbered_and_the_last_is_the_latest() {
        let runs = tempfile::tempdir().unwrap();
        let first = RunFolder::create(runs.path(), "a").unwrap();
        let second = RunFolder::create(runs.path(), "b").unwrap();
        [&first, &second].into_iter().for_each(|folder| folder.become_latest().unwrap());
        assert!(first.path().ends_with("0001-a") && second.path().ends_with("0002-b"));
        assert_eq!(fs::read_link(runs.path().join("latest")).unwrap(), Path::new("0002-b"));
    }

    #[test]
    fn the_readme_has_the_unit_of_every_parameter_and_the_numbers_of_choices() {
        let text = readme();
        for p in &PARAMETERS {
            let line = text
                .lines()
                .find(|line| line.starts_with(&format!("lidar.{} ", p.name)))
                .expect(p.name);
            assert!(line.contains(p.unit) && line.len() > 27, "{line}");
        }
        assert!(
            text.contains("lidar.denoise              0 none, 1 gaussian, 2 matched\n"),
            "{text}"
        );
        assert!(
            text.contains("lidar.min_separation       m; left out, it follows the pulse width\n"),
            "{text}"
        );
    }

    #[test]
    fn a_file_in_the_way_is_noticed_before_anything_is_made() {
        let runs = tempfile::tempdir().unwrap();
        let file = runs.path().join("file");
        fs::write(&file, "").unwrap();
        for path in [file.clone(), file.join("below")] {
            let checked = RunFolder::check(&path).unwrap_err();
            for error in [checked, RunFolder::create(&path, "a").unwrap_err()] {
                assert!(error.to_string().contains(&path.display().to_string()), "{error}");
            }
        }
        let free = runs.path().join("a/b");
        RunFolder::check(&free).unwrap();
        assert!(!free.exists());
    }

    #[cfg(unix)]
    #[test]
    fn a_latest_that_is_no_link_is_named_and_kept() {
        let runs = tempfile::tempdir().unwrap();
        let latest = runs.path().join("latest");
        fs::write(&latest, "mine").unwrap();
        assert!(RunFolder::check(runs.path()).unwrap_err().to_string().contains("latest"));
        fs::remove_file(&latest).unwrap();
        fs::create_dir(&latest).unwrap();
        assert!(RunFolder::check(runs.path()).unwrap_err().to_string().contains("latest"));
        assert!(fs::read_dir(runs.path()).unwrap().count() == 1);
    }

    #[test]
    fn a_folder_is_locked_by_one_process_and_an_obstacle_is_named() {
        let runs = tempfile::tempdir().unwrap();
        let folder = RunFolder::create(runs.path(), "a").unwrap();
        folder.write(CONFIG, "").unwrap();
        let path = folder.path().to_owned();
        let error = RunFolder::open(&path).unwrap_err().to_string();
        assert!(error.contains(LOCK) && error.contains("another process"), "{error}");
        drop(folder);
        drop(RunFolder::open(&path).unwrap());
        for name in [RESULT, "report.html.part", HISTORY] {
            fs::create_dir(path.join(name)).unwrap();
            let error = RunFolder::open(&path).unwrap_err().to_string();
            assert!(error.contains(name) && error.contains("a folder is in the way"), "{error}");
            fs::remove_dir(path.join(name)).unwrap();
        }
    }
}
