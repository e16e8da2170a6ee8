//! The configuration of a run: TOML file, then `--set a.b=v`, then flags; unknown keys are errors.

mod error;
mod lidar;
mod load;
mod motion;

use std::path::PathBuf;

use echoloop_dsp::{Hardware, ScanPattern};
use echoloop_sim::board::hardware_for;
use serde::{Deserialize, Serialize};

use error::require;

use crate::experiment::preset::{LidarPreset, Preset, Protocol};
use echoloop_frontend::{Receiver, Weather};
pub use echoloop_registration::{FgrMode, Method};

pub use error::RunConfigError;
pub use lidar::Lidar;
pub use load::{LoadError, Override, load};
pub use motion::{JitterPer, Motion};

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

/// Where to scan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SceneConfig {
    /// `structured`, `semi-structured`, `unstructured`, or a mesh: PLY or OBJ, metres, z up.
    pub source: String,
    /// Seeds of the generated towns; the pairs are shared out among them.
    pub towns: Vec<u64>,
    /// Ground below a mesh: `auto` (fitted when the mesh has none), `none`, or the plane z = a·x +
    /// b·y + c as `a,b,c`.
    pub ground: String,
}

impl Default for SceneConfig {
    fn default() -> Self {
        Self { source: "structured".into(), towns: vec![1, 2, 3], ground: "auto".into() }
    }
}

/// How the sensor looks around.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ScannerConfig {
    /// Beams along azimuth.
    pub columns: u16,
    /// Beams along elevation.
    pub rows: u16,
    /// Full azimuth range, degrees.
    pub azimuth_deg: f64,
    /// Full elevation range, degrees.
    pub elevation_deg: f64,
    /// Height above the ground, m.
    pub height_m: f64,
}

impl Default for ScannerConfig {
    fn default() -> Self {
        Self { columns: 192, rows: 64, azimuth_deg: 180.0, elevation_deg: 180.0, height_m: 2.0 }
    }
}

impl ScannerConfig {
    /// The firmware's form.
    pub fn pattern(&self) -> ScanPattern {
        let centi = |degrees: f64| (degrees * 100.0).round() as u16;
        ScanPattern {
            columns: self.columns,
            rows: self.rows,
            azimuth_cdeg: centi(self.azimuth_deg),
            elevation_cdeg: centi(self.elevation_deg),
        }
    }
}

/// What the laser may emit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct EmitterConfig {
    /// Greatest energy of a pulse, power times width, nJ: the sensor refuses settings above it. It
    /// keeps a search from buying signal with power. A board on a serial line has a limit of its
    /// own.
    pub energy_limit_nj: f64,
}

impl Default for EmitterConfig {
    fn default() -> Self {
        Self { energy_limit_nj: f64::from(Hardware::REFERENCE.energy_limit_pj) / 1e3 }
    }
}

impl EmitterConfig {
    fn check(&self) -> Result<(), RunConfigError> {
        // 100 nJ is the least power, 5 W, in the longest pulse, 20 ns; 2000 nJ the greatest, 100 W.
        let limit_nj = self.energy_limit_nj;
        require(
            "emitter.energy_limit_nj",
            limit_nj,
            (100.0..=2000.0).contains(&limit_nj),
            "100 to 2000",
        )
    }
}

/// Which pairs of scans to register.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DataConfig {
    /// Pairs to tune on.
    pub train_pairs: usize,
    /// Pairs to judge on, in other places.
    pub test_pairs: usize,
    /// Distance of a pair's scans, m: the paper's 2 for local methods, 5 for global ones.
    pub baseline_m: f64,
    /// The second scan's heading differs by at most this, degrees.
    pub heading_range_deg: f64,
    /// Roll and pitch of each scan, at most, degrees.
    pub tilt_range_deg: f64,
    /// A registration succeeds within this translation, m, …
    pub success_translation_m: f64,
    /// … and this rotation, degrees.
    pub success_rotation_deg: f64,
}

impl Default for DataConfig {
    fn default() -> Self {
        Self {
            train_pairs: 30,
            test_pairs: 40,
            baseline_m: 2.0,
            heading_range_deg: 10.0,
            tilt_range_deg: 2.0,
            success_translation_m: 0.5,
            success_rotation_deg: 2.5,
        }
    }
}

impl DataConfig {
    /// As in the paper: local methods get scans 2 m apart and succeed within 0.5 m and 2.5°, global
    /// ones 5 m, 1 m and 5°.
    pub fn for_method(method: Method) -> Self {
        let local = Self::default();
        match method.is_global() {
            true => Self {
                baseline_m: 5.0,
                success_translation_m: 1.0,
                success_rotation_deg: 5.0,
                ..local
            },
            false => local,
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

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// How to search.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TuneConfig {
    /// What is tuned.
    pub protocol: Protocol,
    /// Which of the sensor's parameters are tuned: the paper's eight, or `full`, all fifteen.
    #[serde(skip_serializing_if = "is_default")]
    pub lidar: LidarPreset,
    /// Generations.
    pub generations: u32,
    /// Candidates a generation; 0: as many as there are parameters, as in the paper.
    pub population: usize,
    /// Training pairs a generation sees, drawn anew each time and shared by its candidates; 0: all,
    /// as in the paper.
    pub pairs_per_generation: usize,
    /// No pair counts for more than this, ‖T_est − T*‖_F; 0: no cap, as in the paper.
    pub error_cap: f64,
    /// Whether the candidates of a generation meet the same noise.
    pub common_noise: bool,
    /// Start of the step size, in the unit cube.
    pub sigma: f64,
    /// Candidates judged again on all training pairs at the end, besides the mean and the start.
    pub shortlist: usize,
}

impl Default for TuneConfig {
    fn default() -> Self {
        Self {
            protocol: Protocol::Joint,
            lidar: LidarPreset::Paper,
            generations: 30,
            population: 0,
            pairs_per_generation: 3,
            error_cap: 1.0,
            common_noise: true,
            sigma: 0.2,
            shortlist: 4,
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

impl ScannerConfig {
    fn check(&self) -> Result<(), RunConfigError> {
        let within = |v: u16, max| (1..=max).contains(&v);
        require("scanner.columns", self.columns, within(self.columns, 4096), "1 to 4096")?;
        require("scanner.rows", self.rows, within(self.rows, 1024), "1 to 1024")?;
        let full = |v: f64, max: f64| v >= 0.01 && v <= max;
        require(
            "scanner.azimuth_deg",
            self.azimuth_deg,
            full(self.azimuth_deg, 360.0),
            "0.01 to 360",
        )?;
        require(
            "scanner.elevation_deg",
            self.elevation_deg,
            full(self.elevation_deg, 180.0),
            "0.01 to 180",
        )?;
        require(
            "scanner.height_m",
            self.height_m,
            (0.1..=100.0).contains(&self.height_m),
            "0.1 to 100",
        )
    }
}

impl DataConfig {
    fn check(&self) -> Result<(), RunConfigError> {
        let some = |n: usize| (1..=10_000).contains(&n);
        require("data.train_pairs", self.train_pairs, some(self.train_pairs), "1 to 10000")?;
        require("data.test_pairs", self.test_pairs, some(self.test_pairs), "1 to 10000")?;
        require(
            "data.baseline_m",
            self.baseline_m,
            (0.0..=100.0).contains(&self.baseline_m),
            "0 to 100",
        )?;
        let angle = |v: f64| (0.0..=180.0).contains(&v);
        require(
            "data.heading_range_deg",
            self.heading_range_deg,
            angle(self.heading_range_deg),
            "0 to 180",
        )?;
        require(
            "data.tilt_range_deg",
            self.tilt_range_deg,
            (0.0..=45.0).contains(&self.tilt_range_deg),
            "0 to 45",
        )?;
        let success = self.success_translation_m;
        require(
            "data.success_translation_m",
            success,
            success > 0.0 && success <= 100.0,
            "above 0, at most 100",
        )?;
        let success = self.success_rotation_deg;
        require(
            "data.success_rotation_deg",
            success,
            success > 0.0 && success <= 180.0,
            "above 0, at most 180",
        )
    }
}

impl TuneConfig {
    fn check(&self) -> Result<(), RunConfigError> {
        let generations = self.generations;
        require(
            "tune.generations",
            generations,
            (1..=100_000).contains(&generations),
            "1 to 100000",
        )?;
        let population = self.population;
        require(
            "tune.population",
            population,
            population != 1 && population <= 10_000,
            "0 (automatic) or 2 to 10000",
        )?;
        require(
            "tune.error_cap",
            self.error_cap,
            self.error_cap >= 0.0 && self.error_cap.is_finite(),
            "0 or more",
        )?;
        require(
            "tune.sigma",
            self.sigma,
            self.sigma > 0.0 && self.sigma <= 1.0,
            "above 0, at most 1",
        )?;
        require("tune.shortlist", self.shortlist, self.shortlist <= 1000, "at most 1000")
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
