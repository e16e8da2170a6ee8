//! How generalised ICP runs.

use super::method::Slot;
use super::{ConfigError, require, require_lengths, require_neighbours};

/// Settings of [`crate::Gicp`]. Lengths in metres, angles in radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GicpConfig {
    /// Edge of the voxels that thin both clouds, φ_v.
    pub voxel_m: f64,
    /// Neighbours within this make a covariance, φ_rad1.
    pub normal_radius_m: f64,
    /// At most so many neighbours, the point included, φ_knn.
    pub normal_neighbours: usize,
    /// Points farther apart are no pair, φ_d.
    pub max_pair_distance_m: f64,
    /// Coarse to fine, as for [`super::IcpConfig`].
    pub first_pair_distance_m: Option<f64>,
    /// Steps at most.
    pub max_iterations: usize,
    /// A step shorter than this…
    pub translation_tolerance_m: f64,
    /// …that turns less than this ends the run.
    pub rotation_tolerance_rad: f64,
    /// A direction whose share of the information is below this is unobservable.
    pub degeneracy_threshold: f64,
}

impl GicpConfig {
    /// The settings that have a name on the command line and in files, in the order of their use.
    pub const KEYS: &[&str] = &[
        "voxel_m",
        "normal_radius_m",
        "normal_neighbours",
        "max_pair_distance_m",
        "first_pair_distance_m",
        "max_iterations",
        "translation_tolerance_m",
        "rotation_tolerance_rad",
        "degeneracy_threshold",
    ];

    /// Where the setting of that name is kept.
    pub(super) fn slot(&mut self, key: &str) -> Option<Slot<'_>> {
        Some(match key {
            "voxel_m" => Slot::Real(&mut self.voxel_m),
            "normal_radius_m" => Slot::Real(&mut self.normal_radius_m),
            "normal_neighbours" => Slot::Count(&mut self.normal_neighbours),
            "max_pair_distance_m" => Slot::Real(&mut self.max_pair_distance_m),
            "first_pair_distance_m" => Slot::Optional(&mut self.first_pair_distance_m),
            "max_iterations" => Slot::Count(&mut self.max_iterations),
            "translation_tolerance_m" => Slot::Real(&mut self.translation_tolerance_m),
            "rotation_tolerance_rad" => Slot::Real(&mut self.rotation_tolerance_rad),
            "degeneracy_threshold" => Slot::Real(&mut self.degeneracy_threshold),
            _ => return None,
        })
    }

    /// For scans of a street or a field, some tens of metres wide, that nearly overlap.
    pub fn outdoor() -> Self {
        Self {
            voxel_m: 0.3,
            normal_radius_m: 1.5,
            normal_neighbours: 20,
            max_pair_distance_m: 1.0,
            first_pair_distance_m: None,
            max_iterations: 50,
            translation_tolerance_m: 5e-4,
            rotation_tolerance_rad: 1e-4,
            degeneracy_threshold: 3e-3,
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
            ("max_pair_distance_m", self.max_pair_distance_m),
        ])?;
        let first = self.first_pair_distance_m.unwrap_or(self.max_pair_distance_m);
        let far_enough = first >= self.max_pair_distance_m && first <= 1e6;
        require(
            "first_pair_distance_m",
            first,
            far_enough,
            "max_pair_distance_m or more, at most 1e6 m",
        )?;
        require_neighbours("normal_neighbours", self.normal_neighbours)?;
        for (field, value) in [
            ("translation_tolerance_m", self.translation_tolerance_m),
            ("rotation_tolerance_rad", self.rotation_tolerance_rad),
        ] {
            require(field, value, value >= 0.0 && value.is_finite(), "0 or more")?;
        }
        require(
            "max_iterations",
            self.max_iterations as f64,
            self.max_iterations >= 1,
            "1 or more",
        )?;
        let least = self.degeneracy_threshold;
        require(
            "degeneracy_threshold",
            least,
            (0.0..1.0 / 3.0).contains(&least),
            "0 or more, below 1/3",
        )
    }
}
