//! How points are thinned and described for global registration.

use super::method::Slot;
use super::{ConfigError, require, require_feature_neighbours, require_lengths};

/// Settings of FPFH features: the first half of Θ_reg (Sec. 3.3). Lengths in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FeatureConfig {
    /// Edge of the voxels that thin both clouds, φ_v.
    pub voxel_m: f64,
    /// Neighbours within this make a normal, φ_rad1.
    pub normal_radius_m: f64,
    /// At most so many neighbours make a normal, the point included.
    pub normal_neighbours: usize,
    /// Neighbours within this make a feature, φ_rad2; not less than `normal_radius_m`.
    pub feature_radius_m: f64,
    /// At most so many neighbours make a feature, the point included, φ_knn.
    pub feature_neighbours: usize,
    /// Where the voxel grid starts, and which way normals face.
    pub convention: Convention,
}

/// Choices on which published implementations differ, and which change the result.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Convention {
    /// The grid starts at the frame's origin; normals face the sensor; points without a normal have
    /// no feature.
    #[default]
    Sensor,
    /// As Open3D 0.20 has it: the grid starts half a voxel below the least point, normals have the
    /// sign that its eigenvector solver leaves, and a point with fewer than 3 neighbours has the
    /// normal (0, 0, 1).
    Open3d,
}

impl FeatureConfig {
    /// Where the setting of that name is kept.
    pub(super) fn slot(&mut self, key: &str) -> Option<Slot<'_>> {
        Some(match key {
            "voxel_m" => Slot::Real(&mut self.voxel_m),
            "normal_radius_m" => Slot::Real(&mut self.normal_radius_m),
            "normal_neighbours" => Slot::Count(&mut self.normal_neighbours),
            "feature_radius_m" => Slot::Real(&mut self.feature_radius_m),
            "feature_neighbours" => Slot::Count(&mut self.feature_neighbours),
            _ => return None,
        })
    }

    /// Radii of 3 and 5 voxels with 30 and 100 neighbours, normals towards the sensor.
    pub fn of_voxel(voxel_m: f64) -> Self {
        Self {
            voxel_m,
            normal_radius_m: 3.0 * voxel_m,
            normal_neighbours: 30,
            feature_radius_m: 5.0 * voxel_m,
            feature_neighbours: 100,
            convention: Convention::Sensor,
        }
    }

    /// Open3D's global registration example: radii of 2 and 5 voxels with 30 and 100 neighbours.
    pub fn open3d(voxel_m: f64) -> Self {
        Self {
            normal_radius_m: 2.0 * voxel_m,
            convention: Convention::Open3d,
            ..Self::of_voxel(voxel_m)
        }
    }

    /// Whether each setting can run.
    ///
    /// # Errors
    ///
    /// [`ConfigError`] names the first field that cannot, and its bound.
    pub fn check(&self) -> Result<(), ConfigError> {
        require_lengths(&[
            ("voxel_m", self.voxel_m),
            ("normal_radius_m", self.normal_radius_m),
            ("feature_radius_m", self.feature_radius_m),
        ])?;
        let wide = self.feature_radius_m >= self.normal_radius_m;
        require(
            "feature_radius_m",
            self.feature_radius_m,
            wide,
            "normal_radius_m or more (Sec. 3.3)",
        )?;
        require_feature_neighbours("normal_neighbours", self.normal_neighbours)?;
        require_feature_neighbours("feature_neighbours", self.feature_neighbours)
    }
}
