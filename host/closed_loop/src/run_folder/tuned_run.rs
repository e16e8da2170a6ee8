//! Tuned parameters of a finished run, as a configuration to begin with.

use std::io;
use std::path::{Path, PathBuf};

use echoloop_files::{one_line, read_text};
use serde::Deserialize;
use thiserror::Error;

use crate::config::{LoadError, RunConfig, load};
use crate::parameters::{Parameters, ValueError, Values};
use crate::run_folder::run::{CONFIG, RESULT};

/// A run whose tuned parameters cannot be used.
#[derive(Debug, Error)]
pub enum TunedRunError {
    /// Its configuration cannot be read.
    #[error(transparent)]
    Config(#[from] LoadError),
    /// Its configuration starts with parameters that its hardware refuses.
    #[error(transparent)]
    Start(#[from] ValueError),
    /// Its result cannot be read.
    #[error(
        "cannot read {}: {source} (a run that was interrupted goes on with `echoloop tune \
         --resume`)",
        path.display()
    )]
    Read {
        /// The result.
        path: PathBuf,
        /// Reason.
        source: io::Error,
    },
    /// Its result is malformed, or holds parameters that the configuration refuses.
    #[error("{}: {problem}", path.display())]
    Result {
        /// The result.
        path: PathBuf,
        /// Reason.
        problem: String,
    },
}

/// Largest result that is read, bytes.
const MOST_RESULT: u64 = 16 << 20;

/// The one member of a result that is used here.
#[derive(Deserialize)]
struct Earlier {
    tuned: Values,
}

/// The configuration of a run, starting with the parameters that it tuned.
///
/// # Errors
///
/// [`TunedRunError`] names the file.
pub fn tuned_config(run: &Path) -> Result<RunConfig, TunedRunError> {
    let config = load(Some(&run.join(CONFIG)), &[])?;
    let values = tuned_values(run)?;
    let device = config.device();
    let start = Parameters::start(&config, &device)?;
    let tuned = start.with_values(&values, &config, &device).map_err(|e| malformed(run, &e))?;
    Ok(tuned.as_start_of(&config))
}

/// The parameters that a run tuned, by name.
///
/// # Errors
///
/// [`TunedRunError`] names the file.
pub fn tuned_values(run: &Path) -> Result<Values, TunedRunError> {
    let path = run.join(RESULT);
    let text = read_text(&path, MOST_RESULT)
        .map_err(|source| TunedRunError::Read { path: path.clone(), source })?;
    let earlier: Earlier = serde_json::from_str(&text).map_err(|e| malformed(run, &e))?;
    Ok(earlier.tuned)
}

fn malformed(run: &Path, problem: &impl ToString) -> TunedRunError {
    TunedRunError::Result { path: run.join(RESULT), problem: one_line(&problem.to_string()) }
}
