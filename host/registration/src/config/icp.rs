//! How point-to-plane ICP runs.

use super::method::Slot;
use super::{ConfigError, require, require_lengths, require_neighbours};

/// Settings of [`crate::Icp`]. Lengths in metres, angles in radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IcpConfig {
    /// Edge of the voxels that thin both clouds, φ_v.
    pub voxel_m: f64,
    /// Neighbours within this make a normal, φ_rad1.
    pub normal_radius_m: f64,
    /// At most so many neighbours, the point included.
    pub normal_neighbours: usize,
    /// Points farther apart are no pair, φ_d.
    pub max_pair_distance_m: f64,
    /// Coarse to fine: pairs may be this far apart at first; the distance then shrinks by 0.7 an
    /// iteration to `max_pair_distance_m`. Absent: plain ICP, as in the paper and in Open3D.
    pub first_pair_distance_m: Option<f64>,
    /// Steps at most.
    pub max_iterations: usize,
    /// A step shorter than this…
    pub translation_tolerance_m: f64,
    /// …that turns less than this ends the run.
    pub rotation_tolerance_rad: f64,
    /// So does a step that changes the share of paired points by less than this…
    pub fitness_tolerance: f64,
    /// …and the root mean square distance of the pairs by less than this.
    pub rmse_tolerance_m: f64,
    /// A direction whose share of the information is below this is unobservable: see
    /// [`crate::Observability`]. Normals at the edges of a bare corridor leave up to 2e-3 along it;
    /// real streets have 0.04 to 0.12.
    pub degeneracy_threshold: f64,
}

impl IcpConfig {
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
        "fitness_tolerance",
        "rmse_tolerance_m",
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
            "fitness_tolerance" => Slot::Real(&mut self.fitness_tolerance),
            "rmse_tolerance_m" => Slot::Real(&mut self.rmse_tolerance_m),
            "degeneracy_threshold" => Slot::Real(&mut self.degeneracy_threshold),
            _ => return None,
        })
    }

    /// For scans of a street or a field, some tens of metres wide, that nearly overlap: a motion
    /// below about half a metre and 5°. [`crate::suggest()`] fits it to the clouds at hand.
    ///
    /// Normals reach over 3 voxels, as KISS-Matcher has it: rings of a scan lie far apart.
    /// Stillness is 0.5 mm and 0.1 mrad, far below the error of such scans (small_gicp stops at 1
    /// mm and 1.7 mrad).
    pub fn outdoor() -> Self {
        Self {
            voxel_m: 0.3,
            normal_radius_m: 0.9,
            normal_neighbours: 30,
            max_pair_distance_m: 1.0,
            first_pair_distance_m: None,
            max_iterations: 50,
            translation_tolerance_m: 5e-4,
            rotation_tolerance_rad: 1e-4,
            fitness_tolerance: 1e-6,
            rmse_tolerance_m: 1e-6,
            degeneracy_threshold: 3e-3,
        }
    }

    /// What finishes a global method's motion: the first pairs are four voxels apart at most, which
    /// covers that method's error of about one, and its turn's at the rim; the last two.
    pub fn finishing(voxel_m: f64) -> Self {
        Self {
            voxel_m,
            normal_radius_m: 3.0 * voxel_m,
            max_pair_distance_m: 2.0 * voxel_m,
            first_pair_distance_m: Some(4.0 * voxel_m),
            translation_tolerance_m: voxel_m / 600.0,
            ..Self::outdoor()
        }
    }

    /// Open3D's defaults: normals from 30 neighbours within 2 voxels (its tutorial), 30 iterations,
    /// an end when both fitness and RMSE change by less than 1e-6; it has no test of the step, and
    /// none of degeneracy (1e-9 here only refuses what cannot be solved). It has no default for the
    /// distance, so the caller gives it.
    pub fn open3d(voxel_m: f64, max_pair_distance_m: f64) -> Self {
        Self {
            voxel_m,
            normal_radius_m: 2.0 * voxel_m,
            normal_neighbours: 30,
            max_pair_distance_m,
            first_pair_distance_m: None,
            max_iterations: 30,
            translation_tolerance_m: 0.0,
            rotation_tolerance_rad: 0.0,
            fitness_tolerance: 1e-6,
            rmse_tolerance_m: 1e-6,
            degeneracy_threshold: 1e-9,
        }
    }

    /// Whether each setting can run.
    ///
    /// # Errors
    ///
    /// [`ConfigError`] names the first field that cannot, and its bound.
    pub fn check(&self) -> Result<(), ConfigError> {
        let first = self.first_pair_distance_m.unwrap_or(self.max_pair_distance_m);
        let lengths = [
            ("voxel_m", self.voxel_m),
            ("normal_radius_m", self.normal_radius_m),
            ("max_pair_distance_m", self.max_pair_distance_m),
        ];
        require_lengths(&lengths)?;
        let far_enough = first >= self.max_pair_distance_m && first <= 1e6;
        require(
            "first_pair_distance_m",
            first,
            far_enough,
            "max_pair_distance_m or more, at most 1e6 m",
        )?;
        let thresholds = [
            ("translation_tolerance_m", self.translation_tolerance_m),
            ("rotation_tolerance_rad", self.rotation_tolerance_rad),
            ("fitness_tolerance", self.fitness_tolerance),
            ("rmse_tolerance_m", self.rmse_tolerance_m),
        ];
        for (field, value) in thresholds {
            require(field, value, value >= 0.0 && value.is_finite(), "0 or more")?;
        }
        require_neighbours("normal_neighbours", self.normal_neighbours)?;
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_defaults_can_run() {
        assert_eq!(IcpConfig::outdoor().check(), Ok(()));
        assert_eq!(IcpConfig::open3d(0.05, 0.1).check(), Ok(()));
    }

    #[test]
    fn a_setting_that_cannot_run_is_named_with_its_bound() {
        let with = |change: fn(&mut IcpConfig)| {
            let mut config = IcpConfig::outdoor();
            change(&mut config);
            config.check().map_err(|error| error.to_string())
        };
        type Change = fn(&mut IcpConfig);
        let table: [(Change, &str); 9] = [
            (|c| c.voxel_m = 0.0, "voxel_m is 0, expected a length above 0 m, at most 1e6 m"),
            (
                |c| c.normal_radius_m = f64::NAN,
                "normal_radius_m is NaN, expected a length above 0 m, at most 1e6 m",
            ),
            (
                |c| c.max_pair_distance_m = -1.0,
                "max_pair_distance_m is -1, expected a length above 0 m, at most 1e6 m",
            ),
            (
                |c| c.first_pair_distance_m = Some(0.5),
                "first_pair_distance_m is 0.5, expected max_pair_distance_m or more, at most 1e6 m",
            ),
            (
                |c| c.rotation_tolerance_rad = -1e-9,
                "rotation_tolerance_rad is -0.000000001, expected 0 or more",
            ),
            (|c| c.normal_neighbours = 2, "normal_neighbours is 2, expected 3 to 1000"),
            (|c| c.normal_neighbours = 10_001, "normal_neighbours is 10001, expected 3 to 1000"),
            (|c| c.max_iterations = 0, "max_iterations is 0, expected 1 or more"),
            (
                |c| c.degeneracy_threshold = 0.5,
                "degeneracy_threshold is 0.5, expected 0 or more, below 1/3",
            ),
        ];
        for (change, expected) in table {
            assert_eq!(with(change), Err(expected.to_string()));
        }
    }
}
