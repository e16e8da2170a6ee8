//! How fast global registration runs.

use serde::{Deserialize, Serialize};

use super::method::Slot;
use super::{ConfigError, FeatureConfig, require, require_lengths};

/// Settings of [`crate::Fgr`]. Lengths in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FgrConfig {
    /// How points are thinned and described.
    pub features: FeatureConfig,
    /// The method as published, or as Open3D runs it.
    pub mode: FgrMode,
    /// Matches this near each other in the end agree with the motion: δ of the method, φ_d.
    pub max_pair_distance_m: f64,
    /// Steps at most, φ_fgr.
    pub max_iterations: usize,
    /// Triples of matches kept by the tuple test, at most; so three times as many matches. (Ours
    /// keeps 1024 matches at most.)
    pub max_tuples: usize,
    /// Seed of the tuple test's draws: of triples in Open3D's mode, of the matches that all are
    /// compared with in ours.
    pub seed: u64,
}

/// Whose fast global registration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FgrMode {
    /// As the paper of Zhou, Park and Koltun (ECCV 2016) has it, μ falling from the squared size of
    /// the matches to δ²; with triples counted instead of drawn, by an absolute bound, and a last
    /// fit to all matches.
    #[default]
    Annealed,
    /// As Open3D 0.20 runs it from Python with its defaults: μ starts at the clouds' radius in
    /// metres on points scaled to radius 1, and never falls. The paper's baseline; poor on outdoor
    /// scans.
    Open3d,
}

impl FgrMode {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Annealed, Self::Open3d];

    /// Name on the command line, in files and in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Annealed => "annealed",
            Self::Open3d => "open3d",
        }
    }

    /// What it is, in a line of help.
    pub fn summary(self) -> &'static str {
        match self {
            Self::Annealed => {
                "As the paper of Zhou, Park and Koltun (ECCV 2016) has it, μ falling from the squared size of the matches \
                 to δ²; with triples counted instead of drawn, by an absolute bound, and a last fit to all matches"
            }
            Self::Open3d => {
                "As Open3D 0.20 runs it from Python with its defaults: μ starts at the clouds' radius in metres on points \
                 scaled to radius 1, and never falls. The paper's baseline; poor on outdoor scans"
            }
        }
    }
}

impl FgrConfig {
    /// The settings that have a name on the command line and in files, in the order of their use.
    pub const KEYS: &[&str] = &[
        "voxel_m",
        "normal_radius_m",
        "normal_neighbours",
        "feature_radius_m",
        "feature_neighbours",
        "max_pair_distance_m",
        "max_iterations",
        "max_tuples",
    ];

    /// Where the setting of that name is kept.
    pub(super) fn slot(&mut self, key: &str) -> Option<Slot<'_>> {
        Some(match key {
            "max_pair_distance_m" => Slot::Real(&mut self.max_pair_distance_m),
            "max_iterations" => Slot::Count(&mut self.max_iterations),
            "max_tuples" => Slot::Count(&mut self.max_tuples),
            _ => return self.features.slot(key),
        })
    }

    /// For outdoor scans some tens of metres wide. [`crate::suggest()`] fits it to the clouds at
    /// hand.
    pub fn outdoor() -> Self {
        Self {
            features: FeatureConfig::of_voxel(0.3),
            mode: FgrMode::Annealed,
            max_pair_distance_m: 0.3,
            max_iterations: 256,
            max_tuples: 1000,
            seed: 0,
        }
    }

    /// Open3D 0.20's defaults from Python for a voxel: its tutorial's radii, pairs within half a
    /// voxel, 64 iterations.
    pub fn open3d(voxel_m: f64) -> Self {
        Self {
            features: FeatureConfig::open3d(voxel_m),
            mode: FgrMode::Open3d,
            max_pair_distance_m: 0.5 * voxel_m,
            max_iterations: 64,
            ..Self::outdoor()
        }
    }

    /// As [`FgrConfig::outdoor`], with lengths in proportion to the features' voxel.
    pub fn of_features(features: FeatureConfig) -> Self {
        let outdoor = Self::outdoor();
        let scale = features.voxel_m / outdoor.features.voxel_m;
        Self { features, max_pair_distance_m: scale * outdoor.max_pair_distance_m, ..outdoor }
    }

    /// Whether each setting can run.
    ///
    /// # Errors
    ///
    /// [`ConfigError`] names the first field that cannot, and its bound.
    pub fn check(&self) -> Result<(), ConfigError> {
        self.features.check()?;
        require_lengths(&[("max_pair_distance_m", self.max_pair_distance_m)])?;
        let (iterations, tuples) = (self.max_iterations, self.max_tuples);
        require(
            "max_iterations",
            iterations as f64,
            (1..=100_000).contains(&iterations),
            "1 to 100000",
        )?;
        require("max_tuples", tuples as f64, (1..=1_000_000).contains(&tuples), "1 to 1000000")
    }
}
