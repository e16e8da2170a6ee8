//! Reader of a run's folder.

use std::borrow::Cow;
use std::fmt::Display;
use std::io;
use std::path::{Path, PathBuf};

use echoloop_clouds::{Cloud, CloudError, read_cloud};
use echoloop_files::{MOST_TEXT, one_line, read_text};
use serde::Deserialize;
use serde_json::Value;
use thiserror::Error;

use echoloop_closed_loop::beams::Beams;
use echoloop_closed_loop::budget::Usage;
use echoloop_closed_loop::config::{
    Budget, DataConfig, RegistrationConfig, ScannerConfig, TuneConfig,
};
use echoloop_closed_loop::dataset::source::Source;
use echoloop_closed_loop::evaluation::summary::Summary;
use echoloop_closed_loop::parameters::{Values, settings_of};
use echoloop_closed_loop::run_folder::journal::{Generation, Header, Journal};
use echoloop_closed_loop::run_folder::provenance::About;
use echoloop_closed_loop::run_folder::run::{
    AFTER, AxisRecord, BEFORE, Background, CONFIG, HISTORY, RESULT, RESULT_FORMAT, RunResult,
};

/// Greatest size of a result, bytes.
const MAX_RESULT_BYTES: u64 = 64 << 20;

/// Reason why a run cannot be read.
#[derive(Debug, Error)]
pub enum RunError {
    /// The folder holds no result.
    #[error(
        "{}: no {RESULT} there, so this is no run that came to its end (one that was interrupted \
         goes on with `echoloop tune --resume`)",
        path.display()
    )]
    Unfinished {
        /// The folder.
        path: PathBuf,
    },
    /// A file cannot be read or contradicts another.
    #[error("{0}")]
    File(String),
}

fn file_error(path: &Path, what: impl Display) -> RunError {
    RunError::File(format!("{}: {what}", path.display()))
}

fn run_error(error: impl Display) -> RunError {
    RunError::File(error.to_string())
}

/// Keys of a configuration that the page reads. It shows the others as text.
#[derive(Clone, Debug, Deserialize)]
pub struct Known {
    /// Seed of every random choice.
    pub seed: u64,
    /// The scene, as in the file.
    pub scene: toml::Table,
    /// The scanner, as in the file.
    pub scanner: toml::Table,
    /// Budget; none in a run from before there were any.
    #[serde(default)]
    pub budget: Budget,
    /// Pairs of scans.
    pub data: DataConfig,
    /// Registration of the pairs.
    pub registration: RegistrationConfig,
    /// The search.
    pub tune: TuneConfig,
}

impl Known {
    /// Beams as named values aim them. `None` of a scanner or an aim that is refused, of a table
    /// that is gone, and of recorded scans, whose beams are not here.
    pub fn aimed(&self, values: &Values) -> Option<Beams> {
        let source = self.scene.get("source").and_then(toml::Value::as_str).unwrap_or_default();
        let scanner: ScannerConfig = self.scanner.clone().try_into().ok()?;
        let own = (!Source::is_recording(source)).then(|| scanner.checked_beams()).flatten()?;
        own.aimed(&settings_of(values)).ok().map(Cow::into_owned)
    }

    /// What named values use of the budget; `None` as of [`Self::aimed`].
    pub fn usage(&self, values: &Values) -> Option<Usage> {
        let beams = self.aimed(values)?;
        Some(self.budget.usage(beams.pattern(), &settings_of(values)))
    }
}

/// A finished run.
#[derive(Clone, Debug)]
pub struct FinishedRun {
    /// Folder of the run.
    pub path: PathBuf,
    /// Configuration as text, with every value.
    pub config_text: String,
    /// Configuration, as far as the page reads it.
    pub config: Known,
    /// Provenance.
    pub about: About,
    /// Result.
    pub result: RunResult,
}

impl FinishedRun {
    /// Reads configuration and result.
    ///
    /// # Errors
    ///
    /// [`RunError`] names the file.
    pub fn read(path: &Path) -> Result<Self, RunError> {
        let result = result(path)?;
        let config_path = path.join(CONFIG);
        let config_text =
            read_text(&config_path, MOST_TEXT).map_err(|e| file_error(&config_path, e))?;
        let config = toml::from_str(&config_text)
            .map_err(|error| file_error(&config_path, one_line(&error.to_string())))?;
        let about = About::read(path).map_err(run_error)?;
        Ok(Self { path: path.to_owned(), config_text, config, about, result })
    }

    /// Journal of the search.
    ///
    /// # Errors
    ///
    /// [`RunError::File`]; also when it is longer than the result says.
    pub fn journal(&self) -> Result<(Header, Vec<Generation>), RunError> {
        let (header, generations) = Journal::read(&self.path.join(HISTORY)).map_err(run_error)?;
        match generations.len() == self.result.generations {
            true => Ok((header, generations)),
            false => Err(file_error(
                &self.path,
                format_args!(
                    "its journal is not as long as its {RESULT} says: it was extended and \
                     interrupted, and goes on with `echoloop tune --resume`"
                ),
            )),
        }
    }

    /// Axes, stages, correlations and places of the search.
    ///
    /// # Errors
    ///
    /// [`RunError::File`] of a result of an earlier version, which kept none, or of an impossible
    /// axis.
    pub fn background(&self) -> Result<&Background, RunError> {
        let background = self.result.background.as_ref();
        let background = background.ok_or_else(|| {
            self.result_error(
                "it keeps no background: an earlier version wrote it, and what its page needs is \
                 lost; `echoloop tune --config` with the run's config.toml makes it anew",
            )
        })?;
        // An axis has two ends and not too many values for memory.
        let is_possible = |axis: &&AxisRecord| axis.min < axis.max && axis.max - axis.min < 1e9;
        match background.axes.iter().find(|axis| !is_possible(axis)) {
            Some(AxisRecord { name, min, max, .. }) => Err(self.result_error(format_args!(
                "background.axes: {} goes from {min} to {max}",
                one_line(name)
            ))),
            None => Ok(background),
        }
    }

    /// Error that names the result's file.
    pub(crate) fn result_error(&self, what: impl Display) -> RunError {
        file_error(&self.path.join(RESULT), what)
    }

    /// Target and source of the shown pair, both in the target's frame: with the default, then with
    /// the tuned parameters.
    ///
    /// # Errors
    ///
    /// [`RunError::File`].
    pub fn clouds(&self) -> Result<[[Cloud; 2]; 2], RunError> {
        let RunResult { default_summary, tuned_summary, .. } = &self.result;
        let scans = |file: &str, summary: &Summary| {
            let pair = self.result.shown_pair();
            let shown = summary.errors.iter().find(|error| error.pair == pair);
            two_scans(&self.path.join(file), shown.map_or([0; 2], |error| error.points))
        };
        Ok([scans(BEFORE, default_summary)?, scans(AFTER, tuned_summary)?])
    }
}

fn result(folder: &Path) -> Result<RunResult, RunError> {
    let path = folder.join(RESULT);
    let text = read_text(&path, MAX_RESULT_BYTES).map_err(|error| match error.kind() {
        io::ErrorKind::NotFound | io::ErrorKind::NotADirectory => {
            RunError::Unfinished { path: folder.to_owned() }
        }
        _ => file_error(&path, error),
    })?;
    let fail = |error: serde_json::Error| file_error(&path, one_line(&error.to_string()));
    let document: Value = serde_json::from_str(&text).map_err(fail)?;
    match document.get("format").and_then(Value::as_u64) {
        Some(RESULT_FORMAT) => serde_json::from_value(document).map_err(fail),
        Some(other) => Err(file_error(
            &path,
            format_args!("of format {other}, and this program reads format {RESULT_FORMAT} alone"),
        )),
        None => Err(file_error(&path, "no result of a run: it has no format")),
    }
}

/// Splits a file with the points of two scans, one after the other. Either may be empty.
fn two_scans(path: &Path, points: [usize; 2]) -> Result<[Cloud; 2], RunError> {
    let (both, dropped) = match read_cloud(path) {
        Err(CloudError::Empty { dropped, .. }) => (Cloud::default(), dropped),
        read => read.map_err(run_error)?,
    };
    let (found, expected) =
        (both.points.len() + dropped.total(), points[0].saturating_add(points[1]));
    if found != expected {
        let what = format!("holds {found} points, and {RESULT} says {expected}");
        return Err(file_error(path, what));
    }
    let (target, source) = both.points.split_at(points[0].min(both.points.len()));
    Ok([target, source].map(|half| Cloud::new(half.to_vec())))
}
