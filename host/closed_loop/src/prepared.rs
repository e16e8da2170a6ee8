//! What `tune`, `evaluate` and `pairs` do first: meet the sensor, trace the scans.

use std::sync::atomic::AtomicBool;

use clap::ValueEnum;
use echoloop_dsp::Hardware;
use echoloop_keys::{Kind, Must};

use super::choice::{SensorChoice, described, introduce};
use super::exit::Failure;
use super::method_choice::toml_name;
use super::number::{flag, read};
use super::progress::Progress;
use echoloop_closed_loop::config::RunConfig;
use echoloop_closed_loop::config::preset::Strategy;
use echoloop_closed_loop::dataset::{Dataset, DatasetError, Facts};
use echoloop_closed_loop::evaluation::objective::Bench;
use echoloop_closed_loop::evaluation::summary::{NoisyPairs, Summary};
use echoloop_closed_loop::parameters::{Parameters, Space};
use echoloop_closed_loop::search::{Stage, TuneSearch, stages};
use echoloop_closed_loop::seed::Purpose;
use echoloop_sensors::sensor::{Model, Sensors};

/// Which pairs.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(super) enum PairSet {
    /// Those that a search sees.
    Train,
    /// Those that it is judged on: other viewpoints of the same towns.
    Test,
}

impl PairSet {
    /// As in `--pairs`.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Train => "train",
            Self::Test => "test",
        }
    }
}

/// A sensor that was met, and a start that its hardware takes. Nothing is traced yet.
pub(super) struct Met {
    pub(super) config: RunConfig,
    /// Where the configuration starts.
    pub(super) start: Parameters,
    /// Where a search may begin instead; none, unless it is to be searched.
    warm_starts: Vec<Parameters>,
    space: Space,
    /// As the sensor says.
    pub(super) hardware: Hardware,
    sensors: Sensors,
    sensor: String,
}

impl Met {
    /// Meets the sensor, checks the start against its hardware.
    pub(super) fn new(
        config: RunConfig,
        choice: &SensorChoice,
        progress: &Progress,
    ) -> Result<Self, Failure> {
        let model = Model::from(&config);
        let sensors = choice.sensors(model.clone())?;
        let identity = introduce(&sensors, &model, progress)?;
        let (hardware, sensor) = (identity.hardware, described(&sensors, &identity));
        let start = Parameters::start(&config, &hardware).map_err(Failure::usage)?;
        let space = space(&config, start, hardware)?;
        Ok(Self { config, start, warm_starts: Vec::new(), space, hardware, sensors, sensor })
    }

    /// The same, to be searched: with the configuration's warm starts, which only a search takes.
    pub(super) fn for_a_search(self) -> Result<Self, Failure> {
        self.expect_a_cost_that_changes()?;
        let each = self.config.tune.warm_starts.iter().enumerate();
        let taken = each.map(|(i, values)| {
            let refused = |error| Failure::usage(format!("tune.warm_starts, {}: {error}", i + 1));
            self.space.warm_start(values, &self.config).map_err(refused)
        });
        let warm_starts = taken.collect::<Result<_, _>>()?;
        Ok(Self { warm_starts, ..self })
    }

    /// What is made small, or drawn, must hang on what is searched.
    fn expect_a_cost_that_changes(&self) -> Result<(), Failure> {
        let RunConfig { tune, front, .. } = &self.config;
        for (key, cost) in [("tune.minimise", tune.minimise), ("front.cost", front.cost)] {
            if let Some(cost) = cost.filter(|&cost| !self.space.changes(cost)) {
                let by = match cost.changed_by() {
                    [] => "a parameter of the sensor".to_owned(),
                    some => some.join(" or "),
                };
                return Err(Failure::usage(format!(
                    "{key} = {}: nothing that is searched changes it; expected {by} among what \
                     is searched (--protocol, --tune)",
                    toml_name(cost)
                )));
            }
        }
        Ok(())
    }

    /// Traces the scans.
    pub(super) fn traced(self, progress: &Progress) -> Result<Prepared, DatasetError> {
        self.traced_by(Dataset::build, progress)
    }

    /// Traces the scans, with those of the check where a search has use for them.
    pub(super) fn traced_for_a_search(self, progress: &Progress) -> Result<Prepared, DatasetError> {
        match TuneSearch::is_checked(&self.stages(), &self.config) {
            true => self.traced_by(Dataset::build_with_check, progress),
            false => self.traced(progress),
        }
    }

    fn traced_by(self, build: Build, progress: &Progress) -> Result<Prepared, DatasetError> {
        let dataset = traced(build, &self.config, progress)?;
        progress.say(&Facts::new(&dataset).to_string());
        Ok(self.with(dataset))
    }

    /// Takes scans that were traced before.
    pub(super) fn with(self, dataset: Dataset) -> Prepared {
        let Self { config, start, warm_starts, space, hardware, sensors, sensor } = self;
        Prepared { config, dataset, start, warm_starts, space, hardware, sensors, sensor }
    }

    /// Registrations that a search takes about: those of its stages, and some at the end of each.
    pub(super) fn registrations(&self) -> usize {
        let (tune, pairs) = (&self.config.tune, self.config.data.train_pairs);
        let stages = self.stages();
        let raced = if tune.strategy == Strategy::Fast { tune.shortlist + 2 } else { 0 };
        let of_stages: usize = stages.iter().map(Stage::registrations).sum();
        let warm = if stages.is_empty() { 0 } else { self.warm_starts.len() };
        let check = usize::from(TuneSearch::is_checked(&stages, &self.config))
            * 2
            * self.config.data.check_pairs;
        of_stages + (stages.len() * raced + warm) * pairs + check
    }

    fn stages(&self) -> Vec<Stage> {
        stages(&self.config.tune, &self.space, self.config.data.train_pairs)
    }
}

/// [`Dataset::build`], or [`Dataset::build_with_check`].
type Build = fn(&RunConfig, &dyn Fn(f64, &str)) -> Result<Dataset, DatasetError>;

/// Traces the scans of a configuration.
pub(super) fn traced(
    build: Build,
    config: &RunConfig,
    progress: &Progress,
) -> Result<Dataset, DatasetError> {
    progress.begin("scanning", 1000);
    build(config, &|fraction, what| progress.at_what(fraction, what))
}

/// Everything a search needs, made from a configuration.
pub(super) struct Prepared {
    pub(super) config: RunConfig,
    pub(super) dataset: Dataset,
    pub(super) start: Parameters,
    /// Where a search may begin instead; none, unless it was met to be searched.
    warm_starts: Vec<Parameters>,
    /// What a search of this configuration moves.
    pub(super) space: Space,
    /// As the sensor says.
    pub(super) hardware: Hardware,
    pub(super) sensors: Sensors,
    /// Which sensor, and its firmware.
    pub(super) sensor: String,
}

impl Prepared {
    /// Meets the sensor, checks the start against its hardware, then traces the scans.
    pub(super) fn new(
        config: RunConfig,
        choice: &SensorChoice,
        progress: &Progress,
    ) -> Result<Self, Failure> {
        Ok(Met::new(config, choice, progress)?.traced(progress)?)
    }

    pub(super) fn bench(&self) -> Bench<'_> {
        Bench { dataset: &self.dataset, sensors: &self.sensors }
    }

    /// Which pairs, and the noise that they always get.
    pub(super) fn pairs(&self, which: PairSet) -> NoisyPairs<'_> {
        let (pairs, purpose) = match which {
            PairSet::Train => (&self.dataset.train, Purpose::ShortlistNoise),
            PairSet::Test => (&self.dataset.test, Purpose::TestNoise),
        };
        NoisyPairs { pairs, seed: self.config.seed, purpose }
    }

    pub(super) fn search<'a>(&'a self, stop: &'a AtomicBool) -> TuneSearch<'a> {
        TuneSearch {
            config: &self.config,
            bench: self.bench(),
            space: self.space.clone(),
            start: self.start,
            warm_starts: self.warm_starts.clone(),
            stop,
        }
    }
}

/// The axes of a configuration, with those that the user chose.
pub(super) fn space(
    config: &RunConfig,
    start: Parameters,
    hardware: Hardware,
) -> Result<Space, Failure> {
    let (tune, preset) = (&config.tune, config.registration.preset);
    let space = Space::new(tune.protocol, tune.lidar, preset, start, hardware);
    space.with_own(&tune.axes).map_err(Failure::usage)
}

/// Reads `--require-recall`.
pub(super) fn percent(text: &str) -> Result<f64, String> {
    read(&flag(Kind::Number, Must::between(0.0, 100.0)), text)
}

/// Fails with exit code 4 when the recall is below what was asked, percent.
pub(super) fn require_recall(asked_pct: Option<f64>, summary: &Summary) -> Result<(), Failure> {
    match asked_pct {
        Some(asked) if summary.recall_pct < asked => Err(Failure::new(
            4,
            format!("recall {:.1} % is below the {asked} % asked", summary.recall_pct),
        )),
        _ => Ok(()),
    }
}
