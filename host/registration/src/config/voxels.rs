//! Radii in voxels, for settings that follow the voxel.
//!
//! The defaults in `table.rs` are lengths. They keep these ratios to their voxel, but for the
//! radius of features.

use super::table::{FeatureConfig, GicpConfig, IcpConfig};

impl IcpConfig {
    /// Voxels in the normals' radius: rings of a scan lie far apart. KISS-Matcher has 3.
    pub const NORMAL_VOXELS: f64 = 3.0;
}

impl GicpConfig {
    /// Voxels in the normals' radius. The covariance of both points counts here, so both have to
    /// find their plane: the nearest 20 within 5 voxels succeeded on 60, 75 and 70 % of simulated
    /// pairs where the nearest 30 within 3 did on 50, 57.5 and 52.5 %. With settings chosen from
    /// the clouds, the nearest 20 within 5 on 95, 95 and 55 %, within 3 on 80, 85 and 32.5 %.
    pub const NORMAL_VOXELS: f64 = 5.0;
}

impl FeatureConfig {
    /// Voxels in the normals' radius, as KISS-Matcher has it.
    pub const NORMAL_VOXELS: f64 = 3.0;

    /// Voxels in the features' radius, where it follows the voxel: as Open3D and KISS-Matcher have
    /// it. [`crate::suggest_features`] widens the voxel until so large a radius holds neighbours
    /// enough.
    pub const RADIUS_VOXELS: f64 = 5.0;

    /// The same of the defaults. Their voxel of 0.5 m is that of any cloud: nothing widens it where
    /// points are few, and 5 voxels were worse there in three of four runs of FGR.
    pub const DEFAULT_RADIUS_VOXELS: f64 = 7.0;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_defaults_keep_these_ratios_to_their_voxel() {
        let (icp, gicp) = (IcpConfig::outdoor(), GicpConfig::outdoor());
        let features = FeatureConfig::outdoor();
        let table = [
            (icp.normal_radius_m, IcpConfig::NORMAL_VOXELS, icp.voxel_m),
            (gicp.normal_radius_m, GicpConfig::NORMAL_VOXELS, gicp.voxel_m),
            (features.normal_radius_m, FeatureConfig::NORMAL_VOXELS, features.voxel_m),
            (features.feature_radius_m, FeatureConfig::DEFAULT_RADIUS_VOXELS, features.voxel_m),
        ];
        for (radius_m, voxels, voxel_m) in table {
            // 0.9 is not the number nearest to 3 · 0.3.
            assert!((radius_m - voxels * voxel_m).abs() < 1e-12, "{radius_m} of {voxel_m}");
        }
    }
}
