//! Preparation with progress on standard error, and the recall that a command may require.

use echoloop_parameters::{Bounds, Kind};

use super::choice::SensorChoice;
use super::exit::Failure;
use super::number::{flag, read};
use super::progress::Progress;
use echoloop_closed_loop::config::RunConfig;
use echoloop_closed_loop::dataset::{Dataset, DatasetError, Facts};
use echoloop_closed_loop::evaluation::summary::Summary;
use echoloop_closed_loop::prepared::{PairSet, Preparation, Prepared};
use echoloop_sensors::sensor::Model;

/// Connects to the sensor of the flags, and checks the configuration's start against it.
pub(super) fn connect(
    config: RunConfig,
    choice: &SensorChoice,
    progress: &Progress,
) -> Result<Preparation, Failure> {
    let sensors = choice.sensors(Model::from(&config))?;
    Ok(Preparation::new(config, sensors, &|sensor| progress.say(&format!("sensor {sensor}")))?)
}

/// [`connect`], then traces the pairs.
pub(super) fn prepare(
    config: RunConfig,
    choice: &SensorChoice,
    progress: &Progress,
) -> Result<Prepared, Failure> {
    Ok(traced(connect(config, choice, progress)?, Preparation::traced, progress)?)
}

/// Traces pairs and prints facts about them. `trace` is [`Preparation::traced`] or one of its
/// kind.
pub(super) fn traced(
    preparation: Preparation,
    trace: impl FnOnce(Preparation, &dyn Fn(f64, &str)) -> Result<Prepared, DatasetError>,
    progress: &Progress,
) -> Result<Prepared, DatasetError> {
    let prepared = trace(preparation, &progress.scanning())?;
    progress.say(&Facts::new(&prepared.dataset).to_string());
    Ok(prepared)
}

/// [`traced`] for the sake of one set of pairs: [`Preparation::traced_for`].
pub(super) fn traced_for(
    preparation: Preparation,
    set: PairSet,
    progress: &Progress,
) -> Result<Prepared, DatasetError> {
    traced(preparation, |preparation, fraction| preparation.traced_for(set, fraction), progress)
}

/// Traces all pairs of a configuration, those of the check too.
pub(super) fn all_pairs(config: &RunConfig, progress: &Progress) -> Result<Dataset, DatasetError> {
    Dataset::build_with_check(config, &progress.scanning())
}

/// Reads `--require-recall`.
pub(super) fn percent(text: &str) -> Result<f64, String> {
    read(&flag(Kind::Number, Bounds::between(0.0, 100.0)), text)
}

/// Fails with exit code 4 when the recall is below the one required, percent.
pub(super) fn require_recall(required_pct: Option<f64>, summary: &Summary) -> Result<(), Failure> {
    match required_pct {
        Some(required) if summary.recall_pct < required => Err(Failure::new(
            4,
            format!("recall {:.1} % is below the {required} % asked", summary.recall_pct),
        )),
        _ => Ok(()),
    }
}
