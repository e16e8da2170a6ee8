//! How points are thinned and described for global registration.

use super::convention::Convention;
use super::table::FeatureConfig;

/// Voxels in the normals' radius, where it follows the voxel.
pub(crate) const NORMAL_VOXELS: f64 = 3.0;

/// Voxels in the features' radius, where it follows the voxel.
pub(crate) const FEATURE_VOXELS: f64 = 5.0;

impl FeatureConfig {
    /// Radii of 3 and 5 voxels, normals towards the sensor.
    pub fn from_voxel(voxel_m: f64) -> Self {
        Self {
            voxel_m,
            normal_radius_m: NORMAL_VOXELS * voxel_m,
            feature_radius_m: FEATURE_VOXELS * voxel_m,
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
