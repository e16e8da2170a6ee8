//! Preparation of a run: a sensor that takes the configured start, the axes, the traced pairs.
//!
//! [`Preparation::new`] asks the sensor, [`Preparation::traced`] traces the pairs,
//! [`Prepared::search`] is the search of both.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use echoloop_parameters::choice;
use echoloop_sim::viewpoint::Split;
use thiserror::Error;

use crate::beams::Beams;
use crate::config::RunConfig;
use crate::config::preset::Strategy;
use crate::cost::CostKind;
use crate::dataset::{Dataset, DatasetError};
use crate::evaluation::objective::Bench;
use crate::evaluation::scan_cloud::recorded_from_scan;
use crate::evaluation::summary::NoisyPairs;
use crate::parameters::{Device, Parameters, Space, ValueError};
use crate::search::{Stage, TuneSearch, stages};
use crate::seed::{Purpose, scan_noise};
use echoloop_clouds::Recorded;
use echoloop_frontend::SceneResponse;
use echoloop_sensors::sensor::{Model, SensorError, Sensors, View};

/// A run that cannot begin.
#[derive(Debug, Error)]
pub enum PrepareError {
    /// There is no sensor, or it is not as configured.
    #[error(transparent)]
    Sensor(#[from] SensorError),
    /// The sensor's hardware or the search refuses a parameter.
    #[error(transparent)]
    Value(#[from] ValueError),
    /// A warm start is refused.
    #[error("tune.warm_starts, {number}: {source}")]
    WarmStart {
        /// Its number, from 1.
        number: usize,
        /// Reason.
        source: ValueError,
    },
    /// A cost is to be made small, or drawn, that the search does not change.
    #[error(
        "{key} = {}: nothing that is searched changes it; expected {} among what is searched \
         (--protocol, --tune)",
        cost.key(),
        changed_by(*cost)
    )]
    FixedCost {
        /// The key.
        key: &'static str,
        /// The cost.
        cost: CostKind,
    },
}

fn changed_by(cost: CostKind) -> String {
    match cost.changed_by() {
        [] => "a parameter of the sensor".to_owned(),
        some => some.join(" or "),
    }
}

choice! {
    /// One of the two sets of pairs.
    pub enum PairSet by default Test {
        /// Pairs that a search sees.
        Train = "train",
        /// Held-out pairs that judge it: other viewpoints of the same towns.
        Test = "test",
    }
}

/// Sensors that are as configured, and a start that they take.
pub struct ConfiguredSensor {
    /// The sensors.
    pub sensors: Sensors,
    /// Name and firmware, as in `serial:/dev/ttyACM0@115200, echoloop-sensor 0.1.0`.
    pub name: String,
    /// Hardware and scan pattern, as the sensor reports them.
    pub device: Device,
    /// Start of the configuration.
    pub start: Parameters,
}

impl ConfiguredSensor {
    /// Opens the first sensor and compares it with the configuration. `heard` gets its name before.
    pub fn new(
        config: &RunConfig,
        sensors: Sensors,
        heard: &dyn Fn(&str),
    ) -> Result<Self, PrepareError> {
        let identity = sensors.identity()?;
        let name = sensors.described(&identity);
        heard(&name);
        sensors.check(&identity, &Model::from(config))?;
        let (hardware, pattern) = (identity.hardware, identity.pattern);
        let device = Device { hardware, pattern, budget: config.budget };
        let start = Parameters::start(config, &device)?;
        Ok(Self { sensors, name, device, start })
    }

    /// Scan number 1 of viewpoint 1 with the start's settings: hash of the settings, and the points
    /// with all that the sensor tells of them. `beams` have the aim of the settings.
    ///
    /// # Errors
    ///
    /// [`SensorError`].
    pub fn scan(
        &self,
        config: &RunConfig,
        beams: &Beams,
        scene: &Arc<SceneResponse>,
    ) -> Result<(u32, Recorded), SensorError> {
        let view = View { scene, noise_seed: scan_noise(config.seed), scan: 1, viewpoint: 1 };
        let settings = &self.start.settings;
        let (hash, scan) =
            self.sensors.with(|sensor| Ok((sensor.configure(settings)?, sensor.scan(&view)?)))?;
        let duration_s = config.motion.scan_s(beams.pattern());
        Ok((hash, recorded_from_scan(&scan, beams, view.viewpoint, duration_s)))
    }
}

/// A sensor that was asked, and a start and axes that its hardware takes. Nothing is traced yet.
pub struct Preparation {
    /// The configuration.
    pub config: RunConfig,
    /// Start of the configuration.
    pub start: Parameters,
    /// Hardware and scan pattern, as the sensor reports them.
    pub device: Device,
    /// Other starts; none unless it is to be searched.
    warm_starts: Vec<Parameters>,
    space: Space,
    sensors: Sensors,
    sensor: String,
}

impl Preparation {
    /// Asks the sensor and checks start and axes against its hardware. `heard` gets the sensor's
    /// name.
    pub fn new(
        config: RunConfig,
        sensors: Sensors,
        heard: &dyn Fn(&str),
    ) -> Result<Self, PrepareError> {
        let sensor = ConfiguredSensor::new(&config, sensors, heard)?;
        let ConfiguredSensor { sensors, name: sensor, device, start } = sensor;
        let space = space(&config, start, device)?;
        Ok(Self { config, start, warm_starts: Vec::new(), space, device, sensors, sensor })
    }

    /// The same, to be searched: with the configuration's warm starts, which only a search takes.
    ///
    /// # Errors
    ///
    /// [`PrepareError::WarmStart`], [`PrepareError::FixedCost`].
    pub fn for_a_search(self) -> Result<Self, PrepareError> {
        let RunConfig { tune, front, .. } = &self.config;
        for (key, cost) in [("tune.minimise", tune.minimise), ("front.cost", front.cost)] {
            if let Some(cost) = cost.filter(|&cost| !self.space.changes(cost)) {
                return Err(PrepareError::FixedCost { key, cost });
            }
        }
        let taken = (1..).zip(&tune.warm_starts).map(|(number, values)| {
            let start = self.space.warm_start(values, &self.config);
            start.map_err(|source| PrepareError::WarmStart { number, source })
        });
        let warm_starts = taken.collect::<Result<_, _>>()?;
        Ok(Self { warm_starts, ..self })
    }

    /// Traces the pairs: [`Dataset::build`].
    pub fn traced(self, progress: &dyn Fn(f64, &str)) -> Result<Prepared, DatasetError> {
        let dataset = Dataset::build(&self.config, progress)?;
        Ok(self.with(dataset))
    }

    /// Traces the pairs for the sake of one set: [`Dataset::build_for`].
    pub fn traced_for(
        self,
        set: PairSet,
        progress: &dyn Fn(f64, &str),
    ) -> Result<Prepared, DatasetError> {
        let split = match set {
            PairSet::Train => Split::Train,
            PairSet::Test => Split::Test,
        };
        let dataset = Dataset::build_for(&self.config, split, progress)?;
        Ok(self.with(dataset))
    }

    /// Traces the pairs, with those of the check where a search has use for them.
    pub fn traced_for_a_search(
        self,
        progress: &dyn Fn(f64, &str),
    ) -> Result<Prepared, DatasetError> {
        if !TuneSearch::is_checked(&self.stages(), &self.config) {
            return self.traced(progress);
        }
        let dataset = Dataset::build_with_check(&self.config, progress)?;
        Ok(self.with(dataset))
    }

    /// Takes pairs that were traced before.
    pub fn with(self, dataset: Dataset) -> Prepared {
        let Self { config, start, warm_starts, space, device, sensors, sensor } = self;
        Prepared { config, dataset, start, warm_starts, space, device, sensors, sensor }
    }

    /// About as many registrations as a search takes: those of its stages, and some at the end of
    /// each.
    pub fn registrations(&self) -> usize {
        let (tune, pairs) = (&self.config.tune, self.config.data.train_pairs);
        let stages = self.stages();
        let raced = if tune.strategy == Strategy::Fast { tune.shortlist + 2 } else { 0 };
        let of_stages: usize = stages.iter().map(Stage::registrations).sum();
        let warm = if stages.is_empty() { 0 } else { self.warm_starts.len() };
        // The start, either half, both put together, three more and the choice; of a half, fewer.
        let compared = if stages.len() > 2 { 7 } else { 2 };
        let check = usize::from(TuneSearch::is_checked(&stages, &self.config))
            * compared
            * self.config.data.check_pairs;
        of_stages + (stages.len() * raced + warm) * pairs + check
    }

    fn stages(&self) -> Vec<Stage> {
        stages(&self.config.tune, &self.space, self.config.data.train_pairs)
    }
}

/// Everything that an evaluation or a search needs.
pub struct Prepared {
    /// The configuration.
    pub config: RunConfig,
    /// The traced pairs.
    pub dataset: Dataset,
    /// Start of the configuration.
    pub start: Parameters,
    warm_starts: Vec<Parameters>,
    /// Axes of a search of this configuration.
    pub space: Space,
    /// Hardware and scan pattern, as the sensor reports them.
    pub device: Device,
    /// The sensors.
    pub sensors: Sensors,
    /// Name and firmware of the first.
    pub sensor: String,
}

impl Prepared {
    /// Pairs and sensors.
    pub fn bench(&self) -> Bench<'_> {
        Bench { dataset: &self.dataset, sensors: &self.sensors }
    }

    /// A set of pairs with the noise that it always gets.
    pub fn pairs(&self, which: PairSet) -> NoisyPairs<'_> {
        let (pairs, purpose) = match which {
            PairSet::Train => (&self.dataset.train, Purpose::ShortlistNoise),
            PairSet::Test => (&self.dataset.test, Purpose::TestNoise),
        };
        NoisyPairs { pairs, seed: self.config.seed, purpose }
    }

    /// The search, which ends early once `stop` is set.
    pub fn search<'a>(&'a self, stop: &'a AtomicBool) -> TuneSearch<'a> {
        TuneSearch {
            config: &self.config,
            bench: self.bench(),
            space: self.space.clone(),
            start: self.start,
            warm_starts: self.warm_starts.clone(),
            stop,
            elsewhere: None,
        }
    }
}

/// Axes of a configuration, with those that the user chose.
///
/// # Errors
///
/// [`ValueError::Axis`].
pub fn space(config: &RunConfig, start: Parameters, device: Device) -> Result<Space, ValueError> {
    let (tune, preset) = (&config.tune, config.registration.preset);
    let mut space = Space::new(tune.protocol, tune.lidar, preset, start, device);
    if config.has_one_aim() {
        space = space.with_one_aim();
    }
    space.with_own(&tune.axes)
}
