//! Settings of fast global registration for a purpose.

use super::mode::FgrMode;
use super::table::{FeatureConfig, FgrConfig};

impl FgrConfig {
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
    pub fn from_features(features: FeatureConfig) -> Self {
        let outdoor = Self::outdoor();
        let scale = features.voxel_m / outdoor.features.voxel_m;
        Self { features, max_pair_distance_m: scale * outdoor.max_pair_distance_m, ..outdoor }
    }
}
