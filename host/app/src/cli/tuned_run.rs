//! What a run tuned, as a configuration to begin with.

use std::path::Path;

use echoloop_files::{read_text, shown};
use serde::Deserialize;

use super::exit::Failure;
use crate::experiment::config::{RunConfig, load};
use crate::experiment::params::{Parameters, Values};
use crate::experiment::run::{CONFIG, RESULT};

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
    let path = run.join(RESULT);
    let named = |problem: &dyn std::fmt::Display| {
        Failure::usage(format!("{}: {}", path.display(), shown(&problem.to_string())))
    };
    let text = read_text(&path, MOST_RESULT).map_err(|error| {
        Failure::usage(format!(
            "cannot read {}: {error} (a run that was interrupted goes on with `echoloop tune \
             --resume`)",
            path.display()
        ))
    })?;
    let earlier: Earlier = serde_json::from_str(&text).map_err(|error| named(&error))?;
    let hardware = config.hardware();
    let start = Parameters::start(&config, &hardware).map_err(Failure::usage)?;
    let tuned = start.with_values(&earlier.tuned, &config, &hardware).map_err(|e| named(&e))?;
    Ok(tuned.as_start_of(&config))
}
