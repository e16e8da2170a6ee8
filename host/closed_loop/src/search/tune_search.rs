//! A search, what it needs and what comes of it.

use std::fmt;
use std::sync::atomic::AtomicBool;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::stage::{Stage, stages};
use crate::config::RunConfig;
use crate::cost::Scanner;
use crate::dataset::fingerprint::{Content, build};
use crate::evaluation::objective::Bench;
use crate::evaluation::summary::{NoisyPairs, Summary, evaluate_and_cost};
use crate::parameters::{Parameters, Space, Values, written_values};
use crate::run_folder::journal::{FORMAT, Generation, Header, JournalError};
use crate::seed::Purpose;
use echoloop_sensors::sensor::SensorError;

/// Why a search did not end.
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
    Optimizer(#[from] echoloop_cmaes::CmaEsConfigError),
    /// The search for a front cannot run.
    #[error("the search for a front: {0}")]
    Front(#[from] echoloop_cmaes::ParetoConfigError),
    /// The journal's candidates are not those that this search asks for.
    #[error(
        "line {} of the journal is not of this search: its {field} is not what the configuration \
         gives in this version; begin anew with `echoloop tune --config` and the run's config.toml",
        generation + 2
    )]
    Diverged {
        /// The generation, which has a line after the header's.
        generation: usize,
        /// What differs first.
        field: String,
    },
    /// There was nothing to choose by.
    #[error(
        "none of the {registrations} registrations of the search found a motion, the last for \
         this: {stop}; so nothing can be chosen. The journal is kept; look at what is scanned \
         with `echoloop scan` and this configuration"
    )]
    NothingFound {
        /// How many there were.
        registrations: usize,
        /// Why the last of them stopped, as it is in the journal.
        stop: String,
    },
    /// The start finds nothing, so no error can be held to a multiple of its.
    #[error(
        "minimise: expected a start that registers a training pair, found one that registers none \
         of {pairs}, so that any error is within its limit; tune for the least error first, and \
         begin there with `--run`"
    )]
    NothingToKeep {
        /// How many training pairs there are.
        pairs: usize,
    },
    /// Someone asked to stop. What was done is in the journal.
    #[error("interrupted after {generations} generations")]
    Interrupted {
        /// Whole generations in the journal.
        generations: usize,
    },
}

/// Hears how far a search is.
pub trait Observer: Sync {
    /// A registration is done.
    fn evaluated(&self) {}
    /// A generation is done.
    fn generation(&self, _generation: &Generation, _of: u32) {}
    /// Another part of the work begins, with so many registrations.
    fn stage(&self, _name: &str, _registrations: usize) {}
}

/// An observer that hears nothing.
pub struct Silent;
impl Observer for Silent {}

/// One of those that were judged on all training pairs at the end.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Finalist {
    /// Where it comes from: an [`Origin`](super::Origin), written.
    pub origin: String,
    /// Its parameters.
    #[serde(serialize_with = "written_values")]
    pub values: Values,
    /// Its fitness on the training pairs that it was judged on.
    pub fitness: f64,
    /// How many those are: all, unless it fell behind before.
    pub pairs: usize,
}

/// How the choice did beside registration's winner on pairs that no search has seen.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Check {
    /// Pairs that both were judged on: all, unless the choice fell behind before.
    pub pairs: usize,
    /// By how many standard errors the choice was ahead, pair by pair; 99 at most.
    pub ahead: f64,
    /// Whether that is enough; else registration's winner is what is chosen.
    pub holds: bool,
}

impl fmt::Display for Check {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { pairs, ahead, holds } = self;
        let end = if *holds { "stands" } else { "does not stand: registration's half is chosen" };
        write!(
            f,
            "on {pairs} pairs that no search saw, the choice is {ahead:.1} standard errors ahead \
             of registration's half alone and {end}"
        )
    }
}

/// The end of a search.
#[derive(Clone, Debug, PartialEq)]
pub struct Tuned {
    /// The parameters chosen.
    pub parameters: Parameters,
    /// Where they come from: an [`Origin`](super::Origin), written.
    pub origin: String,
    /// All that were in the choice, best first.
    pub finalists: Vec<Finalist>,
    /// What the last choice was held to; none where registration's winner was the choice.
    pub check: Option<Check>,
    /// Every generation.
    pub generations: Vec<Generation>,
    /// Registrations made, those of the races included.
    pub registrations: usize,
    /// Why the last one stopped, if none found a motion and all errors are the initial guess's.
    pub nothing_found: Option<String>,
    /// Correlations of the last stage's axes at its end.
    pub correlations: Vec<Vec<f64>>,
    /// How much of them can have been learned, 0 to 1.
    pub covariance_learned: f64,
}

/// A search, ready to run.
pub struct TuneSearch<'a> {
    /// The configuration.
    pub config: &'a RunConfig,
    /// Pairs, receiver, hardware.
    pub bench: Bench<'a>,
    /// The axes.
    pub space: Space,
    /// Where it starts.
    pub start: Parameters,
    /// Where it may begin instead, if that is better.
    pub warm_starts: Vec<Parameters>,
    /// Set from outside to stop.
    pub stop: &'a AtomicBool,
}

impl TuneSearch<'_> {
    /// The searches of this run, in their order; none when there is nothing to search.
    pub fn stages(&self) -> Vec<Stage> {
        stages(&self.config.tune, &self.space, self.bench.dataset.train.len())
    }

    /// The first line of this search's journal.
    pub fn header(&self) -> Header {
        Header {
            journal: FORMAT,
            program: format!("echoloop {}", env!("CARGO_PKG_VERSION")),
            build: build(),
            link_schema: format!("{:#018x}", echoloop_link::SCHEMA),
            config: serde_json::to_value(self.config).unwrap_or_default(),
            axes: self.space.axes().iter().map(|axis| axis.name.to_owned()).collect(),
            content: Content::of(self.config, self.bench.dataset),
        }
    }

    /// Whether a check has something to decide: where the sensor is searched besides registration,
    /// and not for the least of a cost.
    pub fn is_checked(stages: &[Stage], config: &RunConfig) -> bool {
        stages.iter().any(|stage| !stage.is_from_the_start()) && config.tune.minimise.is_none()
    }

    /// Registrations that the stages take; a race takes some more.
    pub fn registrations(&self) -> usize {
        self.stages().iter().map(Stage::registrations).sum()
    }

    /// The searched parameters by name.
    pub fn searched_values(&self, parameters: &Parameters) -> Values {
        self.space.values(parameters)
    }

    /// What the costs of its scans hang on.
    pub fn scanner(&self) -> Scanner {
        self.bench.scanner(self.config.hardware(), self.config.motion.duration_s)
    }

    /// Judges parameters on the held-out pairs.
    ///
    /// # Errors
    ///
    /// [`SensorError`].
    pub fn judge(
        &self,
        parameters: &Parameters,
        observer: &dyn Observer,
    ) -> Result<Summary, SensorError> {
        let pairs = &self.bench.dataset.test;
        let noisy = NoisyPairs { pairs, seed: self.config.seed, purpose: Purpose::TestNoise };
        let (bench, scanner) = (&self.bench, &self.scanner());
        let done = || observer.evaluated();
        evaluate_and_cost(bench, parameters, &noisy, scanner, &self.config.data, &done)
    }
}
