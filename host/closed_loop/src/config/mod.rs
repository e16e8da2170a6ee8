//! The configuration of a run: TOML file, then `--set a.b=v`, then flags; unknown keys are errors.

mod axes;
mod choices;
mod data;
mod detector;
mod emitter;
mod front;
pub mod key_reference;
mod keys;
mod lidar;
mod load;
mod motion;
pub mod preset;
mod registration;
mod scanner;
mod scene;
mod tune;
mod weights;

use std::path::PathBuf;

use echoloop_dsp::Hardware;
use echoloop_files::one_line;
use echoloop_frontend::{Mode, Receiver, Weather};
use echoloop_parameters::Refused;
use echoloop_sensors::boards::pc::hardware_for;
use serde::{Deserialize, Serialize};

pub use crate::budget::Budget;
use crate::config::preset::LidarPreset;
use crate::dataset::source::Source;
use crate::parameters::Device;
pub use axes::{AxisChoice, OwnAxes};
pub use data::DataConfig;
pub use detector::DetectorConfig;
pub use echoloop_registration::{FgrMode, Method};
use echoloop_sensors::sensor::Model;
pub use emitter::EmitterConfig;
pub use front::FrontConfig;
pub use keys::{key, keys};
pub use lidar::Lidar;
pub use load::{LoadError, Override, changed, load, parse, written};
pub use motion::{JitterPer, Motion};
pub use registration::RegistrationConfig;
pub use scanner::ScannerConfig;
pub use scene::{Interference, Mirrors, Retroreflectors, SceneConfig};
pub use tune::TuneConfig;
pub use weights::Weights;

/// Everything a run depends on. The same configuration gives the same result, on any number of
/// threads.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default = "RunConfig::left_out")]
pub struct RunConfig {
    /// Seed of every random choice.
    pub seed: u64,
    /// Scene to scan.
    pub scene: SceneConfig,
    /// Beams of the sensor.
    pub scanner: ScannerConfig,
    /// Limits of the laser.
    pub emitter: EmitterConfig,
    /// What a scan may use.
    pub budget: Budget,
    /// Program that finds the echoes.
    pub detector: DetectorConfig,
    /// Pairs of scans to register.
    pub data: DataConfig,
    /// Θ_lidar to start from.
    pub lidar: Lidar,
    /// Θ_reg to start from.
    pub registration: RegistrationConfig,
    /// The search.
    pub tune: TuneConfig,
    /// Search for a front of error against a cost.
    pub front: FrontConfig,
    /// Optics, detector and converter.
    pub receiver: Receiver,
    /// Weather.
    pub weather: Weather,
    /// Motion of the sensor during a scan.
    pub motion: Motion,
}

/// A configuration without keys.
impl Default for RunConfig {
    fn default() -> Self {
        let mut config = Self { budget: Budget::UNITREE_L2, ..Self::left_out() };
        for (id, value) in load::STEERED {
            config.lidar.0.set(id, Some(id.parameter().to_code(value)));
        }
        config
    }
}

impl RunConfig {
    /// Every key left out. Those that depend on others are filled in later ([`load`]).
    fn left_out() -> Self {
        Self {
            seed: 1,
            scene: SceneConfig::default(),
            scanner: ScannerConfig::default(),
            emitter: EmitterConfig::default(),
            budget: Budget::default(),
            detector: DetectorConfig::default(),
            data: DataConfig::default(),
            lidar: Lidar::default(),
            registration: RegistrationConfig::default(),
            tune: TuneConfig::default(),
            front: FrontConfig::default(),
            receiver: Receiver::default(),
            weather: Weather::default(),
            motion: Motion::default(),
        }
    }
}

/// The sensor of a configuration.
impl From<&RunConfig> for Model {
    fn from(config: &RunConfig) -> Self {
        Self {
            receiver: config.front_end(),
            pattern: config.scanner.pattern(),
            hardware: config.hardware(),
            detector: config.detector.kind,
        }
    }
}

impl RunConfig {
    /// Constants of the front end: the receiver in this weather, with this scanner's channels.
    pub fn front_end(&self) -> Receiver {
        let list = self.scanner.list();
        Receiver {
            weather: self.weather,
            rows: self.scanner.pattern().channels(),
            channels: list.map(|list| list.channels()).unwrap_or_default(),
            ..self.receiver.clone()
        }
    }

    /// Fixed constants of the sensor's hardware.
    pub fn hardware(&self) -> Hardware {
        let energy_limit_pj = (self.emitter.energy_limit_nj * 1e3).round() as u32; // `as` saturates
        Hardware { energy_limit_pj, ..hardware_for(&self.receiver) }
    }

    /// Hardware and scan pattern of the sensor.
    pub fn device(&self) -> Device {
        let (hardware, pattern) = (self.hardware(), self.scanner.pattern());
        Device { hardware, pattern, budget: self.budget }
    }

    /// True of pairs whose beams do not follow the settings: recorded or stored ones.
    pub fn has_one_aim(&self) -> bool {
        !self.scene.stored.is_empty() || Source::is_recording(&self.scene.source)
    }

    /// Refuses a steered sensor in a recording, and the search of an aim that there is none of.
    fn check_aim(&self) -> Result<(), Refused> {
        let is_steered = self.device().steered().is_some();
        let refused = |key, value: &str, problem: &str| {
            Err(Refused { key, value: value.into(), problem: problem.into() })
        };
        let aim = self.tune.lidar;
        if is_steered && Source::is_recording(&self.scene.source) {
            let problem = ": recorded scans have beams of their own";
            return refused("scanner.pattern", "steered", problem);
        }
        match aim {
            LidarPreset::Aim if !is_steered => refused(
                "tune.lidar",
                aim.name(),
                ": the scan pattern is not steered (scanner.pattern = steered)",
            ),
            LidarPreset::Aim if self.has_one_aim() => {
                refused("tune.lidar", aim.name(), ": stored pairs have the beams of one aim")
            }
            _ => Ok(()),
        }
    }

    /// Checks every value that its own type does not.
    ///
    /// # Errors
    ///
    /// [`Refused`] names the first key out of bounds, with as much of its value as a message can
    /// hold.
    pub fn check(&self) -> Result<(), Refused> {
        let shortened = |refused: Refused| Refused { value: one_line(&refused.value), ..refused };
        self.check_sections().map_err(shortened)
    }

    fn check_sections(&self) -> Result<(), Refused> {
        self.receiver.check()?;
        self.weather.check()?;
        self.motion.check_keys()?;
        self.scanner.check()?;
        self.scanner.check_times(self.motion.duration_s)?;
        self.emitter.check_keys()?;
        self.budget.check_keys()?;
        self.data.check()?;
        self.tune.check()?;
        self.check_aim()?;
        self.front.check_keys()?;
        self.check_surroundings()?;
        self.check_interference()?;
        self.scene.check()
    }

    /// Refuses surroundings of a recording, whose scans have those that were there.
    fn check_surroundings(&self) -> Result<(), Refused> {
        let SceneConfig { mirrors, retroreflectors, interference, source, .. } = &self.scene;
        let usual = SceneConfig::default();
        let asked = [
            ("scene.mirrors", mirrors.name(), usual.mirrors.name()),
            ("scene.retroreflectors", retroreflectors.name(), usual.retroreflectors.name()),
            ("scene.interference", interference.name(), usual.interference.name()),
        ];
        let other = asked.into_iter().find(|(_, value, usual)| value != usual);
        match other.filter(|_| Source::is_recording(source)) {
            None => Ok(()),
            Some((key, value, _)) => Err(Refused {
                key,
                value: value.into(),
                problem: ": recorded scans have the surroundings they were taken in".into(),
            }),
        }
    }

    fn check_interference(&self) -> Result<(), Refused> {
        let both =
            self.scene.interference != Interference::None && self.receiver.mode == Mode::LitlCompat;
        match both {
            false => Ok(()),
            true => Err(Refused {
                key: "scene.interference",
                value: self.scene.interference.name().into(),
                problem: ": receiver.mode = litl-compat has no watts".into(),
            }),
        }
    }
}

/// Folder of the runs.
pub fn default_runs_folder() -> PathBuf {
    PathBuf::from("runs")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_lidar_is_refused_where_light_has_no_watts() {
        let mut config = RunConfig::default();
        config.receiver.mode = Mode::LitlCompat;
        assert_eq!(config.check(), Ok(()));
        config.scene.interference = Interference::Flash;
        let said = config.check().unwrap_err().to_string();
        let expected = "scene.interference = flash: receiver.mode = litl-compat has no watts";
        assert_eq!(said, expected);
    }

    #[test]
    fn recorded_scans_take_no_other_surroundings() {
        let folder = tempfile::tempdir().unwrap();
        let source = folder.path().to_str().unwrap();
        for set in ["mirrors=glass", "retroreflectors=bright", "interference=flash"] {
            let own: Vec<_> = [format!("scene.source={source}"), format!("scene.{set}")]
                .map(|set| set.parse().unwrap())
                .to_vec();
            let said = load(None, &own).unwrap_err().to_string();
            let key = set.replace('=', " = ");
            let expected = ": recorded scans have the surroundings they were taken in";
            assert_eq!(said, format!("scene.{key}{expected}"));
        }
    }

    #[test]
    fn the_energy_limit_of_the_hardware_is_the_configured_one() {
        let mut config = RunConfig::default();
        assert_eq!(config.hardware(), Hardware::REFERENCE);
        config.emitter.energy_limit_nj = 512.5;
        assert_eq!(config.hardware(), Hardware { energy_limit_pj: 512_500, ..Hardware::REFERENCE });
    }
}
