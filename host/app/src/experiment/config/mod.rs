//! The configuration of a run: TOML file, then `--set a.b=v`, then flags; unknown keys are errors.

mod data;
mod default;
mod emitter;
mod error;
mod lidar;
mod load;
mod motion;
mod scanner;
mod scene;
mod tune;

use std::path::PathBuf;

use echoloop_dsp::Hardware;
use echoloop_frontend::{Receiver, Weather};
use echoloop_sim::board::hardware_for;
use serde::{Deserialize, Serialize};

use crate::experiment::preset::Preset;
use crate::link::sensor::Model;
use default::is_default;
use error::require;

pub use data::DataConfig;
pub use echoloop_registration::{FgrMode, Method};
pub use emitter::EmitterConfig;
pub use error::RunConfigError;
pub use lidar::Lidar;
pub use load::{LoadError, Override, load};
pub use motion::{JitterPer, Motion};
pub use scanner::ScannerConfig;
pub use scene::SceneConfig;
pub use tune::TuneConfig;

/// Everything a run depends on. The same configuration gives the same result, on any number of
/// threads.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RunConfig {
    /// Decides every random choice.
    pub seed: u64,
    /// Where to scan.
    pub scene: SceneConfig,
    /// How the sensor looks around.
    pub scanner: ScannerConfig,
    /// What the laser may emit.
    pub emitter: EmitterConfig,
    /// Which pairs of scans to register.
    pub data: DataConfig,
    /// Θ_lidar to start from.
    pub lidar: Lidar,
    /// Θ_reg to start from.
    pub registration: RegistrationConfig,
    /// How to search.
    pub tune: TuneConfig,
    /// Optics, detector and converter.
    pub receiver: Receiver,
    /// What is in the air.
    pub weather: Weather,
    /// How the sensor moves while it scans.
    pub motion: Motion,
}

impl Default for RunConfig {
    fn default() -> Self {
        Self {
            seed: 1,
            scene: SceneConfig::default(),
            scanner: ScannerConfig::default(),
            emitter: EmitterConfig::default(),
            data: DataConfig::default(),
            lidar: Lidar::default(),
            registration: RegistrationConfig::default(),
            tune: TuneConfig::default(),
            receiver: Receiver::default(),
            weather: Weather::default(),
            motion: Motion::default(),
        }
    }
}

/// Θ_reg to start from. What is left out is the preset's default.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RegistrationConfig {
    /// The method.
    pub method: Method,
    /// Ranges and defaults: `outdoor`, or `paper` (Sec. 3.3, made for indoor spacing).
    pub preset: Preset,
    /// Of FGR: `annealed`, or `open3d` (as Open3D 0.20 runs it, the paper's baseline).
    #[serde(skip_serializing_if = "is_default")]
    pub mode: FgrMode,
    /// Whether point-to-plane ICP finishes what a global method finds.
    #[serde(skip_serializing_if = "is_default")]
    pub refine: bool,
    /// Edge of the voxels, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub voxel_m: Option<f64>,
    /// Radius of the normals' neighbourhood, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub normal_radius_m: Option<f64>,
    /// Neighbours of a normal at most.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub normal_neighbours: Option<f64>,
    /// Radius of the features' neighbourhood, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub feature_radius_m: Option<f64>,
    /// Neighbours of a feature at most.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub feature_neighbours: Option<f64>,
    /// Greatest distance of a pair, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_pair_distance_m: Option<f64>,
    /// Of MAC: matches agree when their distances differ by less than this, m.
    #[serde(skip_serializing_if = "Option::is_none", alias = "max_stretch_m")]
    pub length_tolerance_m: Option<f64>,
    /// Iterations at most.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_iterations: Option<f64>,
}

impl RegistrationConfig {
    /// What reports call it: the method, Open3D's way of it, ICP at its end.
    pub fn name(&self) -> String {
        let mode = if self.mode == FgrMode::Open3d { " as Open3D runs it" } else { "" };
        let refine = if self.refine { ", then icp" } else { "" };
        format!("{}{mode}{refine}", self.method.name())
    }

    /// The values that are given, by key.
    pub fn chosen(&self) -> impl Iterator<Item = (&'static str, f64)> {
        let all = [
            ("voxel_m", self.voxel_m),
            ("normal_radius_m", self.normal_radius_m),
            ("normal_neighbours", self.normal_neighbours),
            ("feature_radius_m", self.feature_radius_m),
            ("feature_neighbours", self.feature_neighbours),
            ("max_pair_distance_m", self.max_pair_distance_m),
            ("length_tolerance_m", self.length_tolerance_m),
            ("max_iterations", self.max_iterations),
        ];
        all.into_iter().filter_map(|(key, value)| value.map(|value| (key, value)))
    }
}

/// The sensor of a configuration.
impl From<&RunConfig> for Model {
    fn from(config: &RunConfig) -> Self {
        Self {
            receiver: config.front_end(),
            pattern: config.scanner.pattern(),
            hardware: config.hardware(),
        }
    }
}

impl RunConfig {
    /// The receiver in this weather and with this scanner's rows: all that a front end is made of.
    pub fn front_end(&self) -> Receiver {
        Receiver { weather: self.weather, rows: self.scanner.rows, ..self.receiver.clone() }
    }

    /// What the hardware of a sensor of this configuration fixes.
    pub fn hardware(&self) -> Hardware {
        let energy_limit_pj = (self.emitter.energy_limit_nj * 1e3).round() as u32; // `as` saturates
        Hardware { energy_limit_pj, ..hardware_for(&self.receiver) }
    }

    /// Checks every value that its own type does not.
    ///
    /// # Errors
    ///
    /// [`RunConfigError`] names the first key out of bounds.
    pub fn check(&self) -> Result<(), RunConfigError> {
        self.receiver.check()?;
        if let Some((field, value, expected)) = self.weather.fault() {
            return Err(RunConfigError::Bound { field, value: value.to_string(), expected });
        }
        self.motion.check()?;
        self.scanner.check()?;
        self.emitter.check()?;
        self.data.check()?;
        self.tune.check()?;
        let towns = &self.scene.towns;
        require(
            "scene.towns",
            format!("{towns:?}"),
            !towns.is_empty() && towns.len() <= 100,
            "1 to 100 seeds",
        )
    }
}

/// Where a run's files go.
pub fn default_runs_folder() -> PathBuf {
    PathBuf::from("runs")
}

#[cfg(test)]
mod tests {
    use echoloop_dsp::{PARAMETERS, ParameterId};

    use super::*;

    #[test]
    fn the_energy_limit_of_the_hardware_is_the_configured_one() {
        let mut config = RunConfig::default();
        assert_eq!(config.hardware(), Hardware::REFERENCE);
        config.emitter.energy_limit_nj = 512.5;
        assert_eq!(config.hardware(), Hardware { energy_limit_pj: 512_500, ..Hardware::REFERENCE });
    }

    #[test]
    fn every_energy_limit_leaves_each_pulse_width_a_power_and_the_greatest_all() {
        let of = |id: ParameterId| &PARAMETERS[id as usize];
        let (power, width) = (of(ParameterId::Power), of(ParameterId::PulseWidth));
        let with = |energy_limit_nj| RunConfig {
            emitter: EmitterConfig { energy_limit_nj },
            ..RunConfig::default()
        };
        let bounds =
            [power.min, power.max].map(|code| power.to_unit(code) * width.to_unit(width.max));
        assert_eq!(bounds, [100.0, 2000.0]);
        for limit_nj in bounds {
            with(limit_nj).check().unwrap();
        }
        for limit_nj in [0.0, -1.0, 99.9, 2000.1, f64::NAN, f64::INFINITY] {
            let problem = with(limit_nj).check().unwrap_err().to_string();
            assert_eq!(
                problem,
                format!("emitter.energy_limit_nj = {limit_nj} must be 100 to 2000")
            );
        }
    }
}
