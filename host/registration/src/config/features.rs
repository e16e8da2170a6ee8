//! Settings of features for a purpose.

use super::convention::Convention;
use super::table::FeatureConfig;

impl FeatureConfig {
    /// Radii of [`Self::NORMAL_VOXELS`] and [`Self::RADIUS_VOXELS`], normals towards the sensor.
    pub fn from_voxel(voxel_m: f64) -> Self {
        Self {
            voxel_m,
            normal_radius_m: Self::NORMAL_VOXELS * voxel_m,
            feature_radius_m: Self::RADIUS_VOXELS * voxel_m,
            ..Self::outdoor()
        }
    }

    /// Open3D's global registration example: radii of 2 and 5 voxels with 30 and 100 neighbours.
    pub fn open3d(voxel_m: f64) -> Self {
        Self {
            normal_radius_m: 2.0 * voxel_m,
            normal_neighbours: 30,
            feature_neighbours: 100,
            convention: Convention::Open3d,
            ..Self::from_voxel(voxel_m)
        }
    }
}
