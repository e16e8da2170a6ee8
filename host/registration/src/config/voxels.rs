//! Radii that depend on the voxel.
//!
//! The defaults in `table.rs` are lengths. They are those of their voxel, but for the radius of
//! features.

use super::table::{FeatureConfig, IcpConfig};

impl IcpConfig {
    /// Radius of the normals of a voxel: so far that the nearest 20 points decide. Where rings lie
    /// apart, a shorter radius holds points of one ring, on a line, whose normal may be any; a
    /// longer one than 3 m, of both sides of a corner.
    pub fn normal_radius_m(voxel_m: f64) -> f64 {
        (20.0 * voxel_m).min(3.0).max(3.0 * voxel_m)
    }
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
    use super::super::table::GicpConfig;
    use super::*;

    #[test]
    fn the_defaults_keep_these_ratios_to_their_voxel() {
        let (icp, gicp) = (IcpConfig::outdoor(), GicpConfig::outdoor());
        assert_eq!(icp.normal_radius_m, IcpConfig::normal_radius_m(icp.voxel_m));
        assert_eq!(gicp.normal_radius_m, IcpConfig::normal_radius_m(gicp.voxel_m));
        let features = FeatureConfig::outdoor();
        let table = [
            (features.normal_radius_m, FeatureConfig::NORMAL_VOXELS, features.voxel_m),
            (features.feature_radius_m, FeatureConfig::DEFAULT_RADIUS_VOXELS, features.voxel_m),
        ];
        for (radius_m, voxels, voxel_m) in table {
            // 0.9 is not the number nearest to 3 · 0.3.
            assert!((radius_m - voxels * voxel_m).abs() < 1e-12, "{radius_m} of {voxel_m}");
        }
    }
}
