//! What a run tuned, as a configuration to begin with.

use std::fmt::Display;
use std::path::Path;

use echoloop_files::{read_text, shown};
use serde::Deserialize;

use super::exit::Failure;
use echoloop_closed_loop::config::{RunConfig, load};
use echoloop_closed_loop::parameters::{Parameters, Values};
use echoloop_closed_loop::run_folder::run::{CONFIG, RESULT};

/// Bytes that are read at most of a run's result, of which one part is kept.
const MOST_RESULT: u64 = 16 << 20;

/// The part of a run's result that is used again.
#[derive(Deserialize)]
struct Earlier {
    tuned: Values,
}

/// The configuration of a run, starting with the parameters that it tuned.
pub(super) fn tuned_config(run: &Path) -> Result<RunConfig, Failure> {
    let config = load(Some(&run.join(CONFIG)), &[]).map_err(Failure::usage)?;
    let values = tuned_values(run)?;
    let hardware = config.hardware();
    let start = Parameters::start(&config, &hardware).map_err(Failure::usage)?;
    let refused = |error| of_result(&run.join(RESULT), &error);
    let tuned = start.with_values(&values, &config, &hardware).map_err(refused)?;
    Ok(tuned.as_start_of(&config))
}

/// The parameters that a run tuned, by name.
pub(super) fn tuned_values(run: &Path) -> Result<Values, Failure> {
    let path = run.join(RESULT);
    let text = read_text(&path, MOST_RESULT).map_err(|error| {
        Failure::usage(format!(
            "cannot read {}: {error} (a run that was interrupted goes on with `echoloop tune \
             --resume`)",
            path.display()
        ))
    })?;
    let earlier: Earlier = serde_json::from_str(&text).map_err(|error| of_result(&path, &error))?;
    Ok(earlier.tuned)
}

/// What is wrong with a run's result.
fn of_result(path: &Path, problem: &impl Display) -> Failure {
    Failure::usage(format!("{}: {}", path.display(), shown(&problem.to_string())))
}
