//! Settings of maximal cliques for a purpose.

use super::table::{FeatureConfig, MacConfig};

impl MacConfig {
    /// As [`MacConfig::outdoor`], with lengths in proportion to the features' voxel.
    pub fn from_features(features: FeatureConfig) -> Self {
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
            features: FeatureConfig::from_voxel(0.05),
            max_pair_distance_m: 0.1,
            length_tolerance_m: 0.1 * f64::sqrt(1.0 - 0.999),
            ..Self::outdoor()
        }
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
