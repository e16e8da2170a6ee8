//! How registration with maximal cliques runs.

use super::method::Slot;
use super::{ConfigError, FeatureConfig, require, require_lengths};

/// Settings of [`crate::Mac`]. Lengths in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MacConfig {
    /// How points are thinned and described.
    pub features: FeatureConfig,
    /// Matches this near each other in the end agree with the motion: the inlier threshold, φ_d,
    /// and the τ of all scores.
    pub max_pair_distance_m: f64,
    /// Two matches are compatible when the distances between their points differ by less than this,
    /// `d < length_tolerance_m`. The published code asks that `1 - (d / τ)²` be above 0.9 on KITTI,
    /// where τ = 0.6 m: 0.19 m.
    pub length_tolerance_m: f64,
    /// Steps of the final refinement at most; 0 leaves the motion of the best clique.
    pub max_iterations: usize,
    /// More matches than this are thinned first: the graph takes `n²/8` bytes and `n²/2` tests.
    pub max_matches: usize,
    /// Cliques of fewer matches propose no motion.
    pub least_clique: usize,
    /// The search for cliques ends here.
    pub max_cliques: usize,
}

impl MacConfig {
    /// The settings that have a name on the command line and in files, in the order of their use.
    pub const KEYS: &[&str] = &[
        "voxel_m",
        "normal_radius_m",
        "normal_neighbours",
        "feature_radius_m",
        "feature_neighbours",
        "max_pair_distance_m",
        "length_tolerance_m",
        "max_iterations",
        "max_matches",
        "least_clique",
        "max_cliques",
    ];

    /// Where the setting of that name is kept.
    pub(super) fn slot(&mut self, key: &str) -> Option<Slot<'_>> {
        Some(match key {
            "max_pair_distance_m" => Slot::Real(&mut self.max_pair_distance_m),
            "length_tolerance_m" => Slot::Real(&mut self.length_tolerance_m),
            "max_iterations" => Slot::Count(&mut self.max_iterations),
            "max_matches" => Slot::Count(&mut self.max_matches),
            "least_clique" => Slot::Count(&mut self.least_clique),
            "max_cliques" => Slot::Count(&mut self.max_cliques),
            _ => return self.features.slot(key),
        })
    }

    /// For outdoor scans some tens of metres wide. [`crate::suggest()`] fits it to the clouds at
    /// hand.
    pub fn outdoor() -> Self {
        Self {
            features: FeatureConfig::of_voxel(0.3),
            max_pair_distance_m: 0.6,
            length_tolerance_m: 0.19,
            max_iterations: 20,
            max_matches: 10_000,
            least_clique: 3,
            max_cliques: 1_000_000,
        }
    }

    /// As [`MacConfig::outdoor`], with lengths in proportion to the features' voxel.
    pub fn of_features(features: FeatureConfig) -> Self {
        let outdoor = Self::outdoor();
        let scale = features.voxel_m / outdoor.features.voxel_m;
        Self {
            features,
            max_pair_distance_m: scale * outdoor.max_pair_distance_m,
            length_tolerance_m: scale * outdoor.length_tolerance_m,
            ..outdoor
        }
    }

    /// As the published demonstration runs on indoor matches a few metres apart: τ = 0.1 m, scores
    /// above 0.999.
    pub fn indoor() -> Self {
        Self {
            features: FeatureConfig::of_voxel(0.05),
            max_pair_distance_m: 0.1,
            length_tolerance_m: 0.1 * f64::sqrt(1.0 - 0.999),
            ..Self::outdoor()
        }
    }

    /// Whether each setting can run.
    ///
    /// # Errors
    ///
    /// [`ConfigError`] names the first field that cannot, and its bound.
    pub fn check(&self) -> Result<(), ConfigError> {
        self.features.check()?;
        require_lengths(&[
            ("max_pair_distance_m", self.max_pair_distance_m),
            ("length_tolerance_m", self.length_tolerance_m),
        ])?;
        let iterations = self.max_iterations;
        require("max_iterations", iterations as f64, iterations <= 100_000, "at most 100000")?;
        let matches = self.max_matches;
        require("max_matches", matches as f64, (3..=20_000).contains(&matches), "3 to 20000")?;
        let least = self.least_clique;
        require("least_clique", least as f64, (3..=20_000).contains(&least), "3 to 20000")?;
        let cliques = self.max_cliques;
        require(
            "max_cliques",
            cliques as f64,
            (1..=100_000_000).contains(&cliques),
            "1 to 100000000",
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_defaults_can_run() {
        assert_eq!(MacConfig::outdoor().check(), Ok(()));
        assert_eq!(MacConfig::indoor().check(), Ok(()));
    }

    #[test]
    fn a_setting_that_cannot_run_is_named_with_its_bound() {
        type Change = fn(&mut MacConfig);
        let table: [(Change, &str); 6] = [
            (
                |c| c.max_pair_distance_m = 0.0,
                "max_pair_distance_m is 0, expected a length above 0 m, at most 1e6 m",
            ),
            (
                |c| c.length_tolerance_m = f64::NAN,
                "length_tolerance_m is NaN, expected a length above 0 m, at most 1e6 m",
            ),
            (|c| c.max_iterations = 100_001, "max_iterations is 100001, expected at most 100000"),
            (|c| c.max_matches = 2, "max_matches is 2, expected 3 to 20000"),
            (|c| c.least_clique = 2, "least_clique is 2, expected 3 to 20000"),
            (|c| c.max_cliques = 0, "max_cliques is 0, expected 1 to 100000000"),
        ];
        for (change, expected) in table {
            let mut config = MacConfig::outdoor();
            change(&mut config);
            assert_eq!(
                config.check().map_err(|error| error.to_string()),
                Err(expected.to_string())
            );
        }
    }
}
