//! Settings of ICP, point to plane and generalised, for a purpose.

use super::table::{GicpConfig, IcpConfig, SETTINGS};

impl IcpConfig {
    /// Refinement of a global method's motion. The first pairs are at most four voxels apart, which
    /// covers the motion's error of about one voxel and that of its rotation far from the sensor;
    /// the last pairs two.
    pub fn refinement(voxel_m: f64) -> Self {
        Self {
            voxel_m,
            normal_radius_m: Self::normal_radius_m(voxel_m),
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
            max_iterations: 30,
            translation_tolerance_m: 0.0,
            rotation_tolerance_rad: 0.0,
            fitness_tolerance: 1e-6,
            rmse_tolerance_m: 1e-6,
            degeneracy_threshold: 1e-9,
            first_pair_distance_m: None,
            kernel_width: None,
            max_normal_angle_rad: None,
        }
    }
}

impl From<&IcpConfig> for GicpConfig {
    /// The lengths that depend on the voxel, normals over [`IcpConfig::normal_radius_m`]; the rest
    /// is generalised ICP's own.
    fn from(icp: &IcpConfig) -> Self {
        Self {
            voxel_m: icp.voxel_m,
            normal_radius_m: IcpConfig::normal_radius_m(icp.voxel_m),
            max_pair_distance_m: icp.max_pair_distance_m,
            first_pair_distance_m: icp.first_pair_distance_m,
            translation_tolerance_m: icp.translation_tolerance_m,
            ..Self::outdoor()
        }
    }
}

impl From<&GicpConfig> for IcpConfig {
    /// The same settings without a test of fitness and RMSE, which generalised ICP does not have.
    fn from(gicp: &GicpConfig) -> Self {
        let mut gicp = *gicp;
        let mut icp = Self { fitness_tolerance: 0.0, rmse_tolerance_m: 0.0, ..Self::outdoor() };
        for setting in SETTINGS {
            let (Some(to), Some(from)) = (icp.slot(setting.key), gicp.slot(setting.key)) else {
                continue;
            };
            to.set(from.get());
        }
        icp
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Method, MethodConfig};
    use super::*;

    #[test]
    fn settings_that_generalised_icp_leaves_out_stay_out() {
        let gicp = GicpConfig {
            first_pair_distance_m: None,
            kernel_width: None,
            max_normal_angle_rad: None,
            ..GicpConfig::outdoor()
        };
        let icp = IcpConfig::from(&gicp);
        let absent = [icp.first_pair_distance_m, icp.kernel_width, icp.max_normal_angle_rad];
        assert_eq!(absent, [None; 3]);
    }

    #[test]
    fn the_defaults_can_run() {
        assert_eq!(IcpConfig::outdoor().check(), Ok(()));
        assert_eq!(IcpConfig::open3d(0.05, 0.1).check(), Ok(()));
    }

    #[test]
    fn settings_made_from_those_of_icp_have_the_radius_and_neighbours_of_generalised_icp() {
        let gicp = GicpConfig::from(&IcpConfig::refinement(0.2));
        let outdoor = GicpConfig::outdoor();
        assert_eq!(gicp.normal_radius_m, outdoor.normal_radius_m);
        assert_eq!(gicp.normal_neighbours, outdoor.normal_neighbours);
        assert_eq!(GicpConfig::from(&IcpConfig::refinement(0.1)).normal_radius_m, 2.0);
    }

    #[test]
    fn the_loop_of_generalised_icp_runs_with_its_own_settings() {
        let gicp = GicpConfig {
            voxel_m: 0.7,
            normal_neighbours: 11,
            first_pair_distance_m: Some(9.0),
            max_iterations: 7,
            ..GicpConfig::outdoor()
        };
        let icp = IcpConfig::from(&gicp);
        assert_eq!((icp.fitness_tolerance, icp.rmse_tolerance_m), (0.0, 0.0));
        let (icp, gicp) = (MethodConfig::Icp(icp), MethodConfig::Gicp(gicp));
        for (setting, _) in Method::Gicp.settings() {
            assert_eq!(icp.get(setting.key), gicp.get(setting.key), "{}", setting.key);
        }
    }

    #[test]
    fn a_setting_that_cannot_run_is_named_with_its_bound() {
        let with = |change: fn(&mut IcpConfig)| {
            let mut config = IcpConfig::outdoor();
            change(&mut config);
            config.check().map_err(|error| error.to_string())
        };
        type Change = fn(&mut IcpConfig);
        let table: [(Change, &str); 10] = [
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
                |c| c.first_pair_distance_m = Some(0.25),
                "first_pair_distance_m is 0.25, expected max_pair_distance_m or more, at most 1e6 \
                 m",
            ),
            (
                |c| c.rotation_tolerance_rad = -1e-9,
                "rotation_tolerance_rad is -0.000000001, expected 0 or more",
            ),
            (|c| c.normal_neighbours = 2, "normal_neighbours is 2, expected 3 to 1000"),
            (|c| c.normal_neighbours = 10_001, "normal_neighbours is 10001, expected 3 to 1000"),
            (|c| c.kernel_width = Some(0.0), "kernel_width is 0, expected above 0"),
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
