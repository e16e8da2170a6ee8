//! How ICP runs: Θ_reg.

/// More neighbours make no better normal, and take their time: some tens are usual.
const MAX_NEIGHBOURS: usize = 10_000;

/// Settings of [`super::Icp`]. Lengths in metres, angles in radians.
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
    /// Coarse to fine: pairs may be this far apart at first; the distance then shrinks by 0.7 an iteration to
    /// `max_pair_distance_m`. Absent: plain ICP, as in the paper and in Open3D.
    pub first_pair_distance_m: Option<f64>,
    /// Steps at most.
    pub max_iterations: usize,
    /// A step shorter than this…
    pub still_m: f64,
    /// …that turns less than this ends the run.
    pub still_rad: f64,
    /// So does a step that changes the share of paired points by less than this…
    pub still_fraction: f64,
    /// …and the root mean square distance of the pairs by less than this.
    pub still_rmse_m: f64,
    /// A direction whose share of the information is below this is unobservable: see [`super::Observability`].
    /// Normals at the edges of a bare corridor leave up to 2e-3 along it; real streets have 0.04 to 0.12.
    pub least_information: f64,
}

/// A setting that cannot run: which one, what it is, what it must be.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{field} is {value}, expected {bound}")]
pub struct ConfigError {
    /// The field of [`IcpConfig`].
    pub field: &'static str,
    /// Its value.
    pub value: f64,
    /// What it must be.
    pub bound: &'static str,
}

impl IcpConfig {
    /// For scans of a street or a field, some tens of metres wide, that nearly overlap: a motion below about half a
    /// metre and 5°. [`super::suggest()`] fits it to the clouds at hand.
    ///
    /// Normals reach over 3 voxels, as KISS-Matcher has it: rings of a scan lie far apart. Stillness is 0.5 mm and
    /// 0.1 mrad, far below the error of such scans (small_gicp stops at 1 mm and 1.7 mrad).
    pub fn outdoor() -> Self {
        Self {
            voxel_m: 0.3,
            normal_radius_m: 0.9,
            normal_neighbours: 30,
            max_pair_distance_m: 1.0,
            first_pair_distance_m: None,
            max_iterations: 50,
            still_m: 5e-4,
            still_rad: 1e-4,
            still_fraction: 1e-6,
            still_rmse_m: 1e-6,
            least_information: 3e-3,
        }
    }

    /// Open3D's defaults: normals from 30 neighbours within 2 voxels (its tutorial), 30 iterations, an end when both
    /// fitness and RMSE change by less than 1e-6; it has no test of the step, and none of degeneracy (1e-9 here only
    /// refuses what cannot be solved). It has no default for the distance, so the caller gives it.
    pub fn open3d(voxel_m: f64, max_pair_distance_m: f64) -> Self {
        Self {
            voxel_m,
            normal_radius_m: 2.0 * voxel_m,
            normal_neighbours: 30,
            max_pair_distance_m,
            first_pair_distance_m: None,
            max_iterations: 30,
            still_m: 0.0,
            still_rad: 0.0,
            still_fraction: 1e-6,
            still_rmse_m: 1e-6,
            least_information: 1e-9,
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
        for (field, value) in lengths {
            require(field, value, value > 0.0 && value <= 1e6, "a length above 0 m, at most 1e6 m")?;
        }
        let far_enough = first >= self.max_pair_distance_m && first <= 1e6;
        require("first_pair_distance_m", first, far_enough, "max_pair_distance_m or more, at most 1e6 m")?;
        let thresholds = [
            ("still_m", self.still_m),
            ("still_rad", self.still_rad),
            ("still_fraction", self.still_fraction),
            ("still_rmse_m", self.still_rmse_m),
        ];
        for (field, value) in thresholds {
            require(field, value, value >= 0.0 && value.is_finite(), "0 or more")?;
        }
        let neighbours = self.normal_neighbours as f64;
        require("normal_neighbours", neighbours, (3..=MAX_NEIGHBOURS).contains(&self.normal_neighbours), "3 to 10000")?;
        require("max_iterations", self.max_iterations as f64, self.max_iterations >= 1, "1 or more")?;
        let least = self.least_information;
        require("least_information", least, (0.0..1.0 / 3.0).contains(&least), "0 or more, below 1/3")
    }
}

fn require(field: &'static str, value: f64, holds: bool, bound: &'static str) -> Result<(), ConfigError> {
    if holds { Ok(()) } else { Err(ConfigError { field, value, bound }) }
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
            (|c| c.normal_radius_m = f64::NAN, "normal_radius_m is NaN, expected a length above 0 m, at most 1e6 m"),
            (|c| c.max_pair_distance_m = -1.0, "max_pair_distance_m is -1, expected a length above 0 m, at most 1e6 m"),
            (
                |c| c.first_pair_distance_m = Some(0.5),
                "first_pair_distance_m is 0.5, expected max_pair_distance_m or more, at most 1e6 m",
            ),
            (|c| c.still_rad = -1e-9, "still_rad is -0.000000001, expected 0 or more"),
            (|c| c.normal_neighbours = 2, "normal_neighbours is 2, expected 3 to 10000"),
            (|c| c.normal_neighbours = 10_001, "normal_neighbours is 10001, expected 3 to 10000"),
            (|c| c.max_iterations = 0, "max_iterations is 0, expected 1 or more"),
            (|c| c.least_information = 0.5, "least_information is 0.5, expected 0 or more, below 1/3"),
        ];
        for (change, expected) in table {
            assert_eq!(with(change), Err(expected.to_string()));
        }
    }
}
