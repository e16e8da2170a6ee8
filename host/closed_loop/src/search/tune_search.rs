//! A search: its inputs, its observers, its errors and its result.

use std::fmt;
use std::sync::atomic::AtomicBool;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::batch::{ScanTimes, Task};
use super::elsewhere::{Elsewhere, PairsOf, ScanTask};
use super::stage::{Stage, stages};
use crate::config::RunConfig;
use crate::config::preset::Strategy;
use crate::cost::{ScanCost, Scanner};
use crate::dataset::fingerprint::{Content, build};
use crate::evaluation::objective::Bench;
use crate::evaluation::summary::{NoisyPairs, Summary, evaluate_and_cost};
use crate::parameters::{Parameters, Space, Values, written_values};
use crate::run_folder::journal::{FORMAT, Generation, Header, JournalError};
use crate::seed::Purpose;
use echoloop_sensors::sensor::SensorError;

/// Reason that a search did not finish.
#[derive(Debug, Error)]
pub enum TuneError {
    /// The sensor failed.
    #[error(transparent)]
    Sensor(#[from] SensorError),
    /// The journal failed.
    #[error(transparent)]
    Journal(#[from] JournalError),
    /// The optimiser cannot run.
    #[error("the optimiser: {0}")]
    Optimizer(#[from] echoloop_cmaes::ConfigError),
    /// The search for a front cannot run.
    #[error("the search for a front: {0}")]
    Front(echoloop_cmaes::ConfigError),
    /// The journal's candidates differ from those that this search asks for.
    #[error(
        "line {} of the journal is not of this search: its {field} is not what the configuration \
         gives in this version; begin anew with `echoloop tune --config` and the run's config.toml",
        generation + 2
    )]
    Diverged {
        /// Number of the generation; its line follows the header's.
        generation: usize,
        /// First field that differs.
        field: String,
    },
    /// No registration of the search found a motion.
    #[error(
        "none of the {registrations} registrations of the search found a motion, the last for \
         this: {stop}; so nothing can be chosen. The journal is kept; look at what is scanned \
         with `echoloop scan` and this configuration"
    )]
    NothingFound {
        /// Registrations made.
        registrations: usize,
        /// Stop reason of the last of them, as in the journal.
        stop: String,
    },
    /// The start registers no pair, so no error can be held to a multiple of its error.
    #[error(
        "minimise: expected a start that registers a training pair, found one that registers none \
         of {pairs}, so that any error is within its limit; tune for the least error first, and \
         begin there with `--run`"
    )]
    NothingToKeep {
        /// Number of training pairs.
        pairs: usize,
    },
    /// Interrupted; the journal holds each whole generation.
    #[error("interrupted after {generations} generations")]
    Interrupted {
        /// Whole generations in the journal.
        generations: usize,
    },
}

/// Observer of the progress of a search.
pub trait Observer: Sync {
    /// A registration is done.
    fn evaluated(&self) {}
    /// A generation is done.
    fn generation(&self, _generation: &Generation, _of: u32) {}
    /// Another part of the work begins, of `registrations` registrations.
    fn stage(&self, _name: &str, _registrations: usize) {}
    /// Registrations made at once are done; the search waits for all of them.
    fn batch(&self, _times: &[ScanTimes]) {}
}

/// Observer that ignores everything.
pub struct Silent;
impl Observer for Silent {}

/// A candidate of the final selection.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Finalist {
    /// Its [`Origin`](super::Origin) as text.
    pub origin: String,
    /// Its parameters.
    #[serde(serialize_with = "written_values")]
    pub values: Values,
    /// Fitness on the training pairs that it was evaluated on.
    pub fitness: f64,
    /// Number of those pairs: all, unless it was eliminated before.
    pub pairs: usize,
}

/// Comparison of the choice, on pairs that no search has seen, with what stood there before it: of
/// the start, the halves, both put together, and those next to the choice.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Check {
    /// Pairs that both were evaluated on: all, unless the choice was eliminated before.
    pub pairs: usize,
    /// Lead of the choice in standard errors of the paired difference; 99 at most.
    pub ahead: f64,
    /// True when the choice stands; else what it was compared with is chosen.
    pub holds: bool,
    /// What it was compared with: its [`Origin`](super::Origin) as text.
    #[serde(default)]
    pub of: String,
}

impl fmt::Display for Check {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { pairs, ahead, holds, of } = self;
        let end = if *holds { "stands" } else { "does not stand: that is chosen" };
        write!(
            f,
            "on {pairs} pairs that no search saw, the choice is {ahead:.1} standard errors ahead \
             of {of} and {end}"
        )
    }
}

/// Result of a search.
#[derive(Clone, Debug, PartialEq)]
pub struct Tuned {
    /// The parameters chosen.
    pub parameters: Parameters,
    /// Their [`Origin`](super::Origin) as text.
    pub origin: String,
    /// Candidates of the final selection, best first.
    pub finalists: Vec<Finalist>,
    /// Check of the choice on unseen pairs; none where the start is the choice.
    pub check: Option<Check>,
    /// Every generation.
    pub generations: Vec<Generation>,
    /// Registrations made, including those of the final selection.
    pub registrations: usize,
    /// Stop reason of the last registration, if none found a motion.
    pub nothing_found: Option<String>,
    /// Correlations of the last stage's axes at its end, `[axes][axes]`.
    pub correlations: Vec<Vec<f64>>,
    /// Share of the covariance that can have been learned, 0 to 1.
    pub covariance_learned: f64,
}

/// A search, ready to run.
pub struct TuneSearch<'a> {
    /// The configuration.
    pub config: &'a RunConfig,
    /// Pairs and sensors.
    pub bench: Bench<'a>,
    /// The axes.
    pub space: Space,
    /// Start of the search.
    pub start: Parameters,
    /// Parameters to begin at instead, where they are better.
    pub warm_starts: Vec<Parameters>,
    /// Set from outside to interrupt.
    pub stop: &'a AtomicBool,
    /// Those who scan and register; `None`: this process, on the threads of the pool.
    pub elsewhere: Option<&'a dyn Elsewhere>,
}

impl TuneSearch<'_> {
    /// Stages of this run in their order; none when there is nothing to search.
    pub fn stages(&self) -> Vec<Stage> {
        stages(&self.config.tune, &self.space, self.bench.dataset.train.len())
    }

    /// Header of this search's journal.
    pub fn header(&self) -> Header {
        Header {
            journal: FORMAT,
            program: format!("echoloop {}", env!("CARGO_PKG_VERSION")),
            build: build(),
            link_schema: format!("{:#018x}", echoloop_link::SCHEMA),
            sensor: self.bench.sensors.kind(),
            config: serde_json::to_value(self.config).unwrap_or_default(),
            axes: self.space.axes().iter().map(|axis| axis.name.to_owned()).collect(),
            content: Content::of(self.config, self.bench.dataset),
        }
    }

    /// True when the choice is checked on unseen pairs: where something is searched, in our way,
    /// and no cost is minimised.
    pub fn is_checked(stages: &[Stage], config: &RunConfig) -> bool {
        let RunConfig { tune, .. } = config;
        !stages.is_empty() && tune.strategy == Strategy::Fast && tune.minimise.is_none()
    }

    /// Registrations of the stages; the final selection takes some more.
    pub fn registrations(&self) -> usize {
        self.stages().iter().map(Stage::registrations).sum()
    }

    /// Cost model of its scans.
    pub fn scanner(&self) -> Scanner {
        self.bench.scanner(self.config.hardware(), self.config.motion.duration_s)
    }

    /// Evaluates parameters on the held-out pairs.
    ///
    /// # Errors
    ///
    /// [`TuneError::Sensor`]; [`TuneError::Interrupted`], if others do the work and have ended it.
    pub fn judge(
        &self,
        parameters: &Parameters,
        observer: &dyn Observer,
    ) -> Result<Summary, TuneError> {
        self.summary(parameters, PairsOf::Test, Purpose::TestNoise, observer)
    }

    /// Evaluates parameters on a set of pairs with the noise of a purpose.
    pub(crate) fn summary(
        &self,
        parameters: &Parameters,
        set: PairsOf,
        purpose: Purpose,
        observer: &dyn Observer,
    ) -> Result<Summary, TuneError> {
        let pairs = set.pairs(self.bench.dataset);
        let noisy = NoisyPairs { pairs, seed: self.config.seed, purpose };
        let data = &self.config.data;
        if let Some(others) = self.elsewhere {
            let noise = |pair| noisy.noise_seed(pair);
            let task = |pair| Task { parameters, pair, noise: noise(pair) };
            let tasks = (0..pairs.len()).filter_map(|pair| ScanTask::of(set, &[task(pair)]));
            let results = others.results(tasks.collect());
            let results = results.ok_or(TuneError::Interrupted { generations: 0 })?;
            let costs: Vec<ScanCost> = results.iter().flat_map(|result| result.costs).collect();
            let errors = results.into_iter().flat_map(|result| result.errors).collect();
            let cost = ScanCost::mean(&costs);
            return Ok(Summary { cost, ..Summary::from_errors(errors, data) });
        }
        let (bench, scanner) = (&self.bench, &self.scanner());
        let done = || observer.evaluated();
        Ok(evaluate_and_cost(bench, parameters, &noisy, scanner, data, &done)?)
    }
}
