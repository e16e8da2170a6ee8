//! Θ_reg: the axes of each method, and its settings as the search has them.

use super::axis::Axis;
use super::error::ValueError;
use crate::experiment::config::RegistrationConfig;
use crate::experiment::preset::Preset;
use echoloop_registration::{
    ConfigError, FgrConfig, FgrMode, GicpConfig, IcpConfig, MacConfig, Method, MethodConfig,
    Registration, build, current_key,
};

/// The prefix of these parameters' names.
pub(super) const SECTION: &str = "registration.";

/// Today's name of a parameter, whether it was given by that or by a former one.
pub(super) fn current_name(name: &str) -> String {
    match name.strip_prefix(SECTION) {
        Some(key) => format!("{SECTION}{}", current_key(key)),
        None => name.to_owned(),
    }
}

/// Θ_reg of one method, and whether ICP finishes what it finds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThetaReg {
    /// The method's settings.
    pub method: MethodConfig,
    /// Whether point-to-plane ICP goes on from a global method's result.
    pub refine: bool,
}

impl ThetaReg {
    /// Where a configuration starts: the preset's defaults, then what it chooses.
    ///
    /// # Errors
    ///
    /// [`ValueError`] of the first value outside its axis, or that the method does not have.
    pub fn start(config: &RegistrationConfig) -> Result<Self, ValueError> {
        let axes = axes(config.method, config.preset);
        let mut theta = Self { method: base(config), refine: config.refine };
        if config.refine && !config.method.is_global() {
            return Err(ValueError::NotRefined(config.method.name()));
        }
        if config.mode != FgrMode::Annealed && config.method != Method::Fgr {
            return Err(ValueError::NotOfMethod {
                key: "mode".into(),
                method: config.method.name(),
            });
        }
        // Open3D's own example has its own radii and counts; only the voxel is the preset's.
        let own =
            |axis: &&Axis| config.mode == FgrMode::Annealed || axis.name == "registration.voxel_m";
        for axis in axes.iter().filter(own) {
            theta.set(axis.name, axis.default);
            if let (FgrMode::Open3d, MethodConfig::Fgr(fgr)) = (config.mode, &mut theta.method) {
                *fgr = FgrConfig::open3d(axis.default);
            }
        }
        for (key, value) in config.chosen() {
            let Some(axis) = axes.iter().find(|axis| axis.name.strip_prefix(SECTION) == Some(key))
            else {
                return Err(ValueError::NotOfMethod {
                    key: key.into(),
                    method: config.method.name(),
                });
            };
            axis.require(value)?;
            theta.set(axis.name, value);
        }
        theta.check()?;
        Ok(theta)
    }

    /// The value of a named axis, in its unit.
    pub fn get(&self, name: &str) -> Option<f64> {
        name.strip_prefix(SECTION).and_then(|key| self.method.get(key))
    }

    /// Sets a named axis; false when the method has none of that name.
    pub fn set(&mut self, name: &str, value: f64) -> bool {
        name.strip_prefix(SECTION).is_some_and(|key| self.method.set(key, value))
    }

    /// Whether the settings go together.
    ///
    /// # Errors
    ///
    /// [`ConfigError`] names the first that does not.
    pub fn check(&self) -> Result<(), ConfigError> {
        self.method.check()
    }

    /// Brings settings whose values are each in range within what they owe each other; names what
    /// was changed.
    ///
    /// A feature's neighbourhood narrower than a normal's is widened to it (Sec. 3.3: φ_rad2 ≥
    /// φ_rad1).
    pub fn repair(&mut self) -> Vec<&'static str> {
        let radii = (self.method.get("normal_radius_m"), self.method.get("feature_radius_m"));
        match radii {
            (Some(normal), Some(feature)) if feature < normal => {
                self.method.set("feature_radius_m", normal);
                vec!["feature_radius_m"]
            }
            _ => Vec::new(),
        }
    }

    /// The method, ready to run.
    ///
    /// # Errors
    ///
    /// [`ConfigError`] names the setting that cannot run.
    pub fn build(&self) -> Result<Box<dyn Registration>, ConfigError> {
        let finish = self.method.get("voxel_m").filter(|_| self.refine).map(IcpConfig::finishing);
        build(&self.method, finish)
    }
}

/// What the axes do not reach: seeds, bounds of memory, conventions.
fn base(config: &RegistrationConfig) -> MethodConfig {
    match (config.method, config.mode) {
        (Method::Icp, _) => MethodConfig::Icp(IcpConfig::outdoor()),
        (Method::Gicp, _) => MethodConfig::Gicp(GicpConfig::outdoor()),
        (Method::Fgr, FgrMode::Annealed) => MethodConfig::Fgr(FgrConfig::outdoor()),
        (Method::Fgr, FgrMode::Open3d) => MethodConfig::Fgr(FgrConfig::open3d(0.3)),
        (Method::Mac, _) => MethodConfig::Mac(MacConfig::outdoor()),
    }
}

/// Θ_reg of a method: every axis once.
///
/// Ranges of `paper` are those of Sec. 3.3, its defaults those of Open3D's global registration
/// example; φ_d, half a voxel there, is the least of its range, and for ICP, which has no default
/// there, the middle. Ranges of iterations, and of the stretch that MAC allows, are ours.
pub fn axes(method: Method, preset: Preset) -> Vec<Axis> {
    match (method, preset) {
        (Method::Icp | Method::Gicp, Preset::Outdoor) => vec![
            Axis::log("registration.voxel_m", "m", 0.05, 1.0, 0.3), // φ_v
            Axis::log("registration.normal_radius_m", "m", 0.1, 3.0, 0.9), // φ_rad1
            Axis::integer("registration.normal_neighbours", "", 10.0, 100.0, 30.0), // φ_knn
            Axis::log("registration.max_pair_distance_m", "m", 0.05, 3.0, 1.0), // φ_d
            Axis::integer("registration.max_iterations", "", 8.0, 128.0, 30.0), // φ_icp
        ],
        (Method::Icp | Method::Gicp, Preset::Paper) => vec![
            Axis::linear("registration.voxel_m", "m", 0.01, 0.1, 0.05),
            Axis::linear("registration.normal_radius_m", "m", 0.01, 0.1, 0.1),
            Axis::integer("registration.normal_neighbours", "", 10.0, 100.0, 30.0),
            Axis::linear("registration.max_pair_distance_m", "m", 0.1, 2.0, 1.0),
            Axis::integer("registration.max_iterations", "", 8.0, 128.0, 30.0),
        ],
        (Method::Fgr, Preset::Outdoor) => with_features(
            &OUTDOOR_FEATURES,
            &[
                Axis::log("registration.max_pair_distance_m", "m", 0.05, 3.0, 0.5), // φ_d
                Axis::integer("registration.max_iterations", "", 8.0, 512.0, 256.0), // φ_fgr
            ],
        ),
        (Method::Fgr, Preset::Paper) => with_features(
            &PAPER_FEATURES,
            &[
                Axis::linear("registration.max_pair_distance_m", "m", 0.1, 2.0, 0.1),
                Axis::integer("registration.max_iterations", "", 8.0, 128.0, 64.0),
            ],
        ),
        (Method::Mac, Preset::Outdoor) => with_features(
            &OUTDOOR_FEATURES,
            &[
                Axis::log("registration.max_pair_distance_m", "m", 0.05, 3.0, 0.6), // φ_d
                Axis::log("registration.length_tolerance_m", "m", 0.02, 1.0, 0.2),
            ],
        ),
        (Method::Mac, Preset::Paper) => with_features(
            &PAPER_FEATURES,
            &[
                Axis::linear("registration.max_pair_distance_m", "m", 0.1, 2.0, 0.1),
                Axis::linear("registration.length_tolerance_m", "m", 0.01, 0.2, 0.03),
            ],
        ),
    }
}

/// The features' half of Θ_reg for outdoor spacing.
const OUTDOOR_FEATURES: [Axis; 4] = [
    Axis::log("registration.voxel_m", "m", 0.05, 1.0, 0.5), // φ_v
    Axis::log("registration.normal_radius_m", "m", 0.1, 3.0, 1.5), // φ_rad1
    Axis::log("registration.feature_radius_m", "m", 0.1, 8.0, 3.5), // φ_rad2, from φ_rad1 up
    Axis::integer("registration.feature_neighbours", "", 10.0, 100.0, 100.0), // φ_knn
];

/// The features' half of Θ_reg as in Sec. 3.3.
const PAPER_FEATURES: [Axis; 4] = [
    Axis::linear("registration.voxel_m", "m", 0.01, 0.1, 0.05),
    Axis::linear("registration.normal_radius_m", "m", 0.01, 0.1, 0.1),
    Axis::linear("registration.feature_radius_m", "m", 0.01, 1.0, 0.25),
    Axis::integer("registration.feature_neighbours", "", 10.0, 100.0, 100.0),
];

fn with_features(features: &[Axis], own: &[Axis]) -> Vec<Axis> {
    [features, own].concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    const METHODS: [Method; 4] = [Method::Icp, Method::Gicp, Method::Fgr, Method::Mac];

    fn config(method: Method, preset: Preset) -> RegistrationConfig {
        RegistrationConfig { method, preset, ..RegistrationConfig::default() }
    }

    #[test]
    fn every_method_has_all_its_axes_in_both_presets_and_starts_at_their_defaults() {
        for method in METHODS {
            for preset in [Preset::Outdoor, Preset::Paper] {
                let theta = ThetaReg::start(&config(method, preset)).unwrap();
                for axis in axes(method, preset) {
                    assert_eq!(
                        theta.get(axis.name),
                        Some(axis.default),
                        "{} of {method:?}",
                        axis.name
                    );
                    axis.require(axis.default).unwrap();
                }
                theta.check().unwrap();
            }
        }
    }

    #[test]
    fn open3ds_way_starts_at_its_own_example() {
        let open3d =
            RegistrationConfig { mode: FgrMode::Open3d, ..config(Method::Fgr, Preset::Paper) };
        assert_eq!(
            ThetaReg::start(&open3d).unwrap().method,
            MethodConfig::Fgr(FgrConfig::open3d(0.05))
        );
    }

    #[test]
    fn both_presets_search_the_same_axes() {
        for method in METHODS {
            let names =
                |preset| axes(method, preset).iter().map(|axis| axis.name).collect::<Vec<_>>();
            assert_eq!(names(Preset::Outdoor), names(Preset::Paper));
        }
    }

    #[test]
    fn a_feature_radius_below_the_normal_radius_is_widened_and_says_so() {
        let mut theta = ThetaReg::start(&config(Method::Fgr, Preset::Outdoor)).unwrap();
        theta.set("registration.feature_radius_m", 1.0);
        assert_eq!(theta.check().map_err(|e| e.field), Err("feature_radius_m"));
        assert_eq!(theta.repair(), ["feature_radius_m"]);
        assert_eq!(
            theta.get("registration.feature_radius_m"),
            theta.get("registration.normal_radius_m")
        );
        assert_eq!((theta.check(), theta.repair()), (Ok(()), Vec::new()));
    }

    #[test]
    fn what_a_method_does_not_have_is_refused_by_name() {
        let error = |config: RegistrationConfig| {
            ThetaReg::start(&config).map_err(|e| e.to_string()).unwrap_err()
        };
        let icp = config(Method::Icp, Preset::Outdoor);
        let wide = RegistrationConfig { feature_radius_m: Some(2.0), ..icp };
        assert_eq!(error(wide), "registration.feature_radius_m is no setting of icp");
        let mode = RegistrationConfig { mode: FgrMode::Open3d, ..icp };
        assert_eq!(error(mode), "registration.mode is no setting of icp");
        let refine = RegistrationConfig { refine: true, ..icp };
        assert_eq!(error(refine), "registration.refine goes with a global method, not with icp");
    }
}
