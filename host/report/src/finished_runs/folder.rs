//! A run's folder, read back.

use std::io;
use std::path::{Path, PathBuf};

use echoloop_files::{MOST_TEXT, read_text, shown};
use echoloop_registration::cloud::{Cloud, CloudError, read_cloud};
use serde::Deserialize;
use serde_json::Value;
use thiserror::Error;

use echoloop_closed_loop::config::{DataConfig, RegistrationConfig, TuneConfig};
use echoloop_closed_loop::run_folder::files::FileError;
use echoloop_closed_loop::run_folder::journal::{Generation, Header, Journal, JournalError};
use echoloop_closed_loop::run_folder::provenance::About;
use echoloop_closed_loop::run_folder::run::{
    AFTER, AxisRecord, BEFORE, Background, CONFIG, HISTORY, RESULT, RESULT_FORMAT, RunResult,
};

/// Bytes that are read at most of a run's result.
const MOST_RESULT: u64 = 64 << 20;

/// Why a run cannot be told.
#[derive(Debug, Error)]
pub enum RunError {
    /// A file of it cannot be read.
    #[error("{}: {what}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Why not.
        what: String,
    },
    /// What it says of itself cannot be read.
    #[error(transparent)]
    About(#[from] FileError),
    /// Its journal cannot be read.
    #[error(transparent)]
    Journal(#[from] JournalError),
    /// A cloud of it cannot be read.
    #[error(transparent)]
    Cloud(#[from] CloudError),
    /// There is no result.
    #[error(
        "{}: no {RESULT} there, so this is no run that came to its end (one that was interrupted \
         goes on with `echoloop tune --resume`)",
        path.display()
    )]
    Unfinished {
        /// The folder.
        path: PathBuf,
    },
    /// Its journal and its result are of different lengths.
    #[error(
        "{}: its journal is not as long as its {RESULT} says: it was extended and interrupted, and \
         goes on with `echoloop tune --resume`",
        path.display()
    )]
    GoesOn {
        /// The folder.
        path: PathBuf,
    },
    /// Its result is of an earlier version, which kept less.
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

/// What of a configuration its page needs. The rest is told as it stands in the file.
#[derive(Clone, Debug, Deserialize)]
pub struct Known {
    /// Decides every random choice.
    pub seed: u64,
    /// The scene, as in the file.
    pub scene: toml::Table,
    /// How the sensor looks around, as in the file.
    pub scanner: toml::Table,
    /// Which pairs of scans.
    pub data: DataConfig,
    /// How they are registered.
    pub registration: RegistrationConfig,
    /// How was searched.
    pub tune: TuneConfig,
}

/// A run that came to its end.
#[derive(Clone, Debug)]
pub struct FinishedRun {
    /// Its folder.
    pub path: PathBuf,
    /// Its configuration as it is written there, every value.
    pub config_text: String,
    /// Its configuration.
    pub config: Known,
    /// Who made it, when and how.
    pub about: About,
    /// What came out.
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
            .map_err(|error| file_fault(&config_path, shown(&error.to_string())))?;
        let about = About::read(path)?;
        Ok(Self { path: path.to_owned(), config_text, config, about, result })
    }

    /// Its journal.
    ///
    /// # Errors
    ///
    /// [`RunError::Journal`]; [`RunError::GoesOn`] of one that has got beyond the result.
    pub fn journal(&self) -> Result<(Header, Vec<Generation>), RunError> {
        let (header, generations) = Journal::read(&self.path.join(HISTORY))?;
        match generations.len() == self.result.generations {
            true => Ok((header, generations)),
            false => Err(RunError::GoesOn { path: self.path.clone() }),
        }
    }

    /// What its search has left besides figures.
    ///
    /// # Errors
    ///
    /// [`RunError::Earlier`]; [`RunError::File`] of an axis that no search can have had.
    pub fn background(&self) -> Result<&Background, RunError> {
        let path = self.path.join(RESULT);
        let background = self.result.background.as_ref();
        let background = background.ok_or_else(|| RunError::Earlier { path: path.clone() })?;
        match background.axes.iter().find(|axis| !is_possible(axis)) {
            Some(AxisRecord { name, min, max, .. }) => Err(file_fault(
                &path,
                format_args!("background.axes: {} goes from {min} to {max}", shown(name)),
            )),
            None => Ok(background),
        }
    }

    /// The held-out pair that is shown: the one the default parameters did worst on.
    pub fn shown_pair(&self) -> usize {
        self.result.shown_pair()
    }

    /// Target and source of the shown pair, both in the target's frame: with default and with tuned
    /// parameters.
    ///
    /// # Errors
    ///
    /// [`RunError::File`].
    pub fn clouds(&self) -> Result<[[Cloud; 2]; 2], RunError> {
        let RunResult { default_summary, tuned_summary, .. } = &self.result;
        let points = |errors: &[echoloop_closed_loop::evaluation::objective::PairError]| {
            let shown = errors.iter().find(|error| error.pair == self.shown_pair());
            shown.map_or([0; 2], |error| error.points)
        };
        Ok([
            halves(&self.path.join(BEFORE), points(&default_summary.errors))?,
            halves(&self.path.join(AFTER), points(&tuned_summary.errors))?,
        ])
    }
}

/// An axis has two ends, and fewer values than memory has bytes.
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
    let fail = |error: serde_json::Error| file_fault(&path, shown(&error.to_string()));
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

/// A cloud that holds the points of two scans, one after the other. A scan may have seen nothing.
fn halves(path: &Path, points: [usize; 2]) -> Result<[Cloud; 2], RunError> {
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
