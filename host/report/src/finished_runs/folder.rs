//! Reader of a run's folder.

use std::io;
use std::path::{Path, PathBuf};

use echoloop_clouds::{Cloud, CloudError, read_cloud};
use echoloop_files::{MOST_TEXT, one_line, read_text};
use serde::Deserialize;
use serde_json::Value;
use thiserror::Error;

use echoloop_closed_loop::config::{DataConfig, RegistrationConfig, TuneConfig};
use echoloop_closed_loop::evaluation::objective::PairError;
use echoloop_closed_loop::run_folder::files::FileError;
use echoloop_closed_loop::run_folder::journal::{Generation, Header, Journal, JournalError};
use echoloop_closed_loop::run_folder::provenance::About;
use echoloop_closed_loop::run_folder::run::{
    AFTER, AxisRecord, BEFORE, Background, CONFIG, HISTORY, RESULT, RESULT_FORMAT, RunResult,
};

/// Greatest size of a result, bytes.
const MOST_RESULT: u64 = 64 << 20;

/// Reason why a run cannot be read.
#[derive(Debug, Error)]
pub enum RunError {
    /// A file cannot be read.
    #[error("{}: {what}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Reason.
        what: String,
    },
    /// The provenance cannot be read.
    #[error(transparent)]
    About(#[from] FileError),
    /// The journal cannot be read.
    #[error(transparent)]
    Journal(#[from] JournalError),
    /// A cloud cannot be read.
    #[error(transparent)]
    Cloud(#[from] CloudError),
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
    /// Journal and result differ in length.
    #[error(
        "{}: its journal is not as long as its {RESULT} says: it was extended and interrupted, and \
         goes on with `echoloop tune --resume`",
        path.display()
    )]
    GoesOn {
        /// The folder.
        path: PathBuf,
    },
    /// The result is of an earlier version, which kept no background.
    #[error(
        "{}: it keeps no background: an earlier version wrote it, and what its page needs is lost; \
         `echoloop tune --config` with the run's config.toml makes it anew",
        path.display()
    )]
    Earlier {
        /// The result.
        path: PathBuf,
    },
}

fn file_fault(path: &Path, what: impl ToString) -> RunError {
    RunError::File { path: path.to_owned(), what: what.to_string() }
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
    /// Pairs of scans.
    pub data: DataConfig,
    /// Registration of the pairs.
    pub registration: RegistrationConfig,
    /// The search.
    pub tune: TuneConfig,
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
            read_text(&config_path, MOST_TEXT).map_err(|e| file_fault(&config_path, e))?;
        let config = toml::from_str(&config_text)
            .map_err(|error| file_fault(&config_path, one_line(&error.to_string())))?;
        let about = About::read(path)?;
        Ok(Self { path: path.to_owned(), config_text, config, about, result })
    }

    /// Journal of the search.
    ///
    /// # Errors
    ///
    /// [`RunError::Journal`]; [`RunError::GoesOn`] when it is longer than the result says.
    pub fn journal(&self) -> Result<(Header, Vec<Generation>), RunError> {
        let (header, generations) = Journal::read(&self.path.join(HISTORY))?;
        match generations.len() == self.result.generations {
            true => Ok((header, generations)),
            false => Err(RunError::GoesOn { path: self.path.clone() }),
        }
    }

    /// Axes, stages, correlations and places of the search.
    ///
    /// # Errors
    ///
    /// [`RunError::Earlier`]; [`RunError::File`] of an impossible axis.
    pub fn background(&self) -> Result<&Background, RunError> {
        let path = self.path.join(RESULT);
        let background = self.result.background.as_ref();
        let background = background.ok_or_else(|| RunError::Earlier { path: path.clone() })?;
        match background.axes.iter().find(|axis| !is_possible(axis)) {
            Some(AxisRecord { name, min, max, .. }) => Err(file_fault(
                &path,
                format_args!("background.axes: {} goes from {min} to {max}", one_line(name)),
            )),
            None => Ok(background),
        }
    }

    /// Index of the held-out pair to show: the one the default parameters did worst on.
    pub fn shown_pair(&self) -> usize {
        self.result.shown_pair()
    }

    /// Target and source of the shown pair, both in the target's frame: with the default, then with
    /// the tuned parameters.
    ///
    /// # Errors
    ///
    /// [`RunError::File`].
    pub fn clouds(&self) -> Result<[[Cloud; 2]; 2], RunError> {
        let RunResult { default_summary, tuned_summary, .. } = &self.result;
        let points = |errors: &[PairError]| {
            let shown = errors.iter().find(|error| error.pair == self.shown_pair());
            shown.map_or([0; 2], |error| error.points)
        };
        Ok([
            two_scans(&self.path.join(BEFORE), points(&default_summary.errors))?,
            two_scans(&self.path.join(AFTER), points(&tuned_summary.errors))?,
        ])
    }
}

/// True when an axis has two ends and not too many values for memory.
fn is_possible(axis: &AxisRecord) -> bool {
    axis.min < axis.max && axis.max - axis.min < 1e9
}

fn result(folder: &Path) -> Result<RunResult, RunError> {
    let path = folder.join(RESULT);
    let text = read_text(&path, MOST_RESULT).map_err(|error| match error.kind() {
        io::ErrorKind::NotFound | io::ErrorKind::NotADirectory => {
            RunError::Unfinished { path: folder.to_owned() }
        }
        _ => file_fault(&path, error),
    })?;
    let fail = |error: serde_json::Error| file_fault(&path, one_line(&error.to_string()));
    let document: Value = serde_json::from_str(&text).map_err(fail)?;
    match document.get("format").and_then(Value::as_u64) {
        Some(RESULT_FORMAT) => serde_json::from_value(document).map_err(fail),
        Some(other) => Err(file_fault(
            &path,
            format_args!("of format {other}, and this program reads format {RESULT_FORMAT} alone"),
        )),
        None => Err(file_fault(&path, "no result of a run: it has no format")),
    }
}

/// Splits a file with the points of two scans, one after the other. Either may be empty.
fn two_scans(path: &Path, points: [usize; 2]) -> Result<[Cloud; 2], RunError> {
    let (both, dropped) = match read_cloud(path) {
        Err(CloudError::Empty { dropped, .. }) => (Cloud::default(), dropped),
        read => read?,
    };
    let (found, expected) =
        (both.points.len() + dropped.total(), points[0].saturating_add(points[1]));
    if found != expected {
        let what = format!("holds {found} points, and {RESULT} says {expected}");
        return Err(file_fault(path, what));
    }
    let (target, source) = both.points.split_at(points[0].min(both.points.len()));
    Ok([target, source].map(|half| Cloud::new(half.to_vec())))
}
