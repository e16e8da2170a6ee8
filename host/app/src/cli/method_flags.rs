//! One flag for every setting of every registration method.

use clap::Args;

use super::exit::Failure;
use super::method_choice::mode_parser;
use echoloop_registration::cloud::Cloud;
use echoloop_registration::{FgrMode, Method, MethodConfig, suggest_method};

/// What the user says of a method's settings; the rest is chosen from the clouds.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Settings; those left out are chosen from the clouds")]
pub(super) struct MethodFlags {
    /// Edge of the voxels that thin both clouds, m, above 0. Lengths left out follow it.
    #[arg(long, value_name = "M")]
    voxel_m: Option<f64>,
    /// Radius of the normals' neighbourhood, m, above 0.
    #[arg(long, value_name = "M")]
    normal_radius_m: Option<f64>,
    /// Neighbours of a normal at most, 3 to 1000 (fgr, mac: 500).
    #[arg(long, value_name = "N")]
    normal_neighbours: Option<usize>,
    /// fgr, mac: radius of the features' neighbourhood, m, not less than that of the normals'.
    #[arg(long, value_name = "M")]
    feature_radius_m: Option<f64>,
    /// fgr, mac: neighbours of a feature at most, 3 to 500.
    #[arg(long, value_name = "N")]
    feature_neighbours: Option<usize>,
    /// Points farther apart are no pair, m, above 0.
    #[arg(long, value_name = "M")]
    max_pair_distance_m: Option<f64>,
    /// icp, gicp: pairs may be this far apart at first, then less and less, m.
    #[arg(long, value_name = "M")]
    first_pair_distance_m: Option<f64>,
    /// mac: matches are compatible when their distances differ by less than this, m.
    #[arg(long, alias = "max-stretch-m", value_name = "M")]
    length_tolerance_m: Option<f64>,
    /// Iterations at most, 1 or more.
    #[arg(long, value_name = "N")]
    max_iterations: Option<usize>,
    /// icp, gicp: a step shorter than this, m, …
    #[arg(long, alias = "still-m", value_name = "M")]
    translation_tolerance_m: Option<f64>,
    /// icp, gicp: … that turns less than this, rad, ends the run.
    #[arg(long, alias = "still-rad", value_name = "RAD")]
    rotation_tolerance_rad: Option<f64>,
    /// icp: so does a change of the share of paired points below this, …
    #[arg(long, alias = "still-fraction", value_name = "SHARE")]
    fitness_tolerance: Option<f64>,
    /// icp: … with one of their root mean square distance below this, m.
    #[arg(long, alias = "still-rmse-m", value_name = "M")]
    rmse_tolerance_m: Option<f64>,
    /// icp, gicp: a direction with less than this share of the information counts as unobservable.
    #[arg(long, alias = "least-information", value_name = "SHARE")]
    degeneracy_threshold: Option<f64>,
    /// fgr: triples of matches that the tuple test keeps at most.
    #[arg(long, value_name = "N")]
    max_tuples: Option<usize>,
    /// mac: more matches than this are thinned, 3 to 20000.
    #[arg(long, value_name = "N")]
    max_matches: Option<usize>,
    /// mac: cliques of fewer matches propose no motion, 3 to 20000.
    #[arg(long, value_name = "N")]
    least_clique: Option<usize>,
    /// mac: the search for cliques ends at so many.
    #[arg(long, value_name = "N")]
    max_cliques: Option<usize>,
    /// fgr: as published, or as Open3D 0.20 runs it from Python.
    #[arg(long, value_name = "MODE", value_parser = mode_parser())]
    mode: Option<FgrMode>,
    /// fgr: seed of its draws [default: 0].
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
}

impl MethodFlags {
    /// The numbers that were given, by the setting's name.
    fn given(&self) -> Vec<(&'static str, f64)> {
        let count = |value: Option<usize>| value.map(|n| n as f64);
        let all = [
            ("voxel_m", self.voxel_m),
            ("normal_radius_m", self.normal_radius_m),
            ("normal_neighbours", count(self.normal_neighbours)),
            ("feature_radius_m", self.feature_radius_m),
            ("feature_neighbours", count(self.feature_neighbours)),
            ("max_pair_distance_m", self.max_pair_distance_m),
            ("first_pair_distance_m", self.first_pair_distance_m),
            ("length_tolerance_m", self.length_tolerance_m),
            ("max_iterations", count(self.max_iterations)),
            ("translation_tolerance_m", self.translation_tolerance_m),
            ("rotation_tolerance_rad", self.rotation_tolerance_rad),
            ("fitness_tolerance", self.fitness_tolerance),
            ("rmse_tolerance_m", self.rmse_tolerance_m),
            ("degeneracy_threshold", self.degeneracy_threshold),
            ("max_tuples", count(self.max_tuples)),
            ("max_matches", count(self.max_matches)),
            ("least_clique", count(self.least_clique)),
            ("max_cliques", count(self.max_cliques)),
        ];
        all.into_iter().filter_map(|(key, value)| value.map(|value| (key, value))).collect()
    }

    /// Whether the method has what was given.
    pub(super) fn check(&self, method: Method) -> Result<(), Failure> {
        let keys = method.keys();
        let numbers = self.given().into_iter().map(|(key, _)| key).find(|key| !keys.contains(key));
        let own = [("mode", self.mode.is_some()), ("seed", self.seed.is_some())];
        let own =
            own.into_iter().find(|(_, given)| *given && method != Method::Fgr).map(|(key, _)| key);
        match numbers.or(own) {
            Some(key) => {
                let flag = key.replace('_', "-");
                Err(Failure::usage(format!("--{flag} is no setting of {}", method.name())))
            }
            None => Ok(()),
        }
    }

    /// Settings for two clouds: chosen from them, then as given.
    pub(super) fn config(
        &self,
        method: Method,
        target: &Cloud,
        source: &Cloud,
    ) -> Result<MethodConfig, Failure> {
        let mode = self.mode.unwrap_or_default();
        let mut config = suggest_method(method, mode, self.voxel_m, target, source);
        if let (MethodConfig::Fgr(fgr), Some(seed)) = (&mut config, self.seed) {
            fgr.seed = seed;
        }
        self.keep_distance(&mut config);
        for (key, value) in self.given() {
            config.set(key, value);
        }
        self.widen_features(&mut config);
        config.check().map_err(Failure::usage)?;
        Ok(config)
    }

    /// A normal radius of one's own widens the features' when that was left to us.
    fn widen_features(&self, config: &mut MethodConfig) {
        if let (Some(normal_m), None) = (self.normal_radius_m, self.feature_radius_m)
            && config.get("feature_radius_m").is_some_and(|feature_m| feature_m < normal_m)
        {
            config.set("feature_radius_m", normal_m);
        }
    }

    /// A pair distance of one's own is meant as it stands: no coarse start above it.
    fn keep_distance(&self, config: &mut MethodConfig) {
        if self.max_pair_distance_m.is_some() {
            match config {
                MethodConfig::Icp(config) => config.first_pair_distance_m = None,
                MethodConfig::Gicp(config) => config.first_pair_distance_m = None,
                MethodConfig::Fgr(_) | MethodConfig::Mac(_) => {}
            }
        }
    }
}
