//! Covariance of a motion.

use echoloop_clouds::Pose;
use nalgebra::{Matrix3, Matrix6, Point3, Vector6};

/// Covariance of the error of a motion `target_from_source`: turns in rad, shifts in m.
///
/// ```text
/// truth = exp(ξ) · estimate      ξ = [ω ; t]      C = E[ξ ξᵀ]
/// ```
///
/// `ξ` is a small motion in the target's frame: a turn `ω` about the x, y and z of the target's
/// origin, then a shift `t` along them. So rows and columns 0 to 2 are turns, 3 to 5 shifts. ROS
/// has the shift first; GTSAM's `Pose3` has this order in the source's frame:
/// `C_source = Ad⁻¹ C Ad⁻ᵀ` with the estimate's adjoint.
///
/// Its computation, and measurements of how well it holds: benches/record/registration.md.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Covariance(pub Matrix6<f64>);

impl Covariance {
    /// Standard deviations of the turns about x, y and z, rad.
    pub fn rotation_sd_rad(&self) -> [f64; 3] {
        [0, 1, 2].map(|i| self.0[(i, i)].sqrt())
    }

    /// Standard deviations of the shifts along x, y and z, m.
    pub fn translation_sd_m(&self) -> [f64; 3] {
        [3, 4, 5].map(|i| self.0[(i, i)].sqrt())
    }

    /// The same with turns about another point of the target's frame, m: a shift is then that
    /// point's.
    ///
    /// ```text
    /// ξ' = [ω ; t + ω × p]
    /// ```
    #[must_use]
    pub fn about(&self, point_m: &Point3<f64>) -> Self {
        let mut there = Matrix6::identity();
        let cross: Matrix3<f64> = point_m.coords.cross_matrix();
        there.fixed_view_mut::<3, 3>(3, 0).copy_from(&-cross);
        Self(there * self.0 * there.transpose())
    }

    /// The matrix row by row: rad², rad·m and m².
    pub fn to_rows(&self) -> [[f64; 6]; 6] {
        std::array::from_fn(|row| std::array::from_fn(|column| self.0[(row, column)]))
    }

    /// Squared error of an estimate, normalised: `ξᵀ C⁻¹ ξ / 6`, whose mean is 1 where the
    /// covariance is right (NEES; Bar-Shalom, Li and Kirubarajan, "Estimation with applications to
    /// tracking and navigation", 2001, Sec. 5.4). For normal errors 95 % are below 12.59 / 6.
    /// `None` where the matrix is not positive definite.
    pub fn normalized_error_squared(&self, estimate: &Pose, truth: &Pose) -> Option<f64> {
        let error = error(estimate, truth);
        self.0.cholesky().map(|whole| error.dot(&whole.solve(&error)) / 6.0)
    }
}

/// The `ξ` of `truth = exp(ξ) · estimate`: see [`Covariance`].
pub fn error(estimate: &Pose, truth: &Pose) -> Vector6<f64> {
    let between = truth * estimate.inverse();
    let (turn, shift) = (between.rotation.scaled_axis(), between.translation.vector);
    Vector6::new(turn.x, turn.y, turn.z, shift.x, shift.y, shift.z)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    #[test]
    fn the_error_is_the_motion_from_the_estimate_to_the_truth_in_the_targets_frame() {
        let estimate = Pose::new(Vector3::new(5.0, -2.0, 1.0), Vector3::new(0.3, -1.0, 2.0));
        let (shift, turn) = (Vector3::new(0.01, -0.02, 0.03), Vector3::new(0.004, 0.005, -0.006));
        let found = error(&estimate, &(Pose::new(shift, turn) * estimate));
        let expected = Vector6::new(turn.x, turn.y, turn.z, shift.x, shift.y, shift.z);
        assert!((found - expected).norm() < 1e-12, "{found}");
    }

    #[test]
    fn about_a_far_point_a_turn_is_a_shift_of_that_point() {
        let turn = Covariance(Matrix6::from_diagonal(&Vector6::new(0.0, 0.0, 1e-6, 0., 0., 0.)));
        let there = turn.about(&Point3::new(100.0, 0.0, 7.0));
        assert!((there.translation_sd_m()[1] - 0.1).abs() < 1e-12, "{there:?}");
        assert_eq!(there.rotation_sd_rad(), turn.rotation_sd_rad());
        let back = there.about(&Point3::new(-100.0, 0.0, -7.0));
        assert!((back.0 - turn.0).norm() < 1e-12);
    }

    #[test]
    fn an_error_of_one_standard_deviation_everywhere_is_1_normalised() {
        let sd = Vector6::new(0.01, 0.02, 0.03, 0.1, 0.2, 0.3);
        let covariance = Covariance(Matrix6::from_diagonal(&sd.component_mul(&sd)));
        let truth = Pose::new(Vector3::new(0.1, 0.2, 0.3), Vector3::new(0.01, 0.02, 0.03));
        let found = covariance.normalized_error_squared(&Pose::identity(), &truth).unwrap();
        assert!((found - 1.0).abs() < 1e-9, "{found}");
        for (ours, expected) in
            covariance.rotation_sd_rad().iter().chain(&covariance.translation_sd_m()).zip(&sd)
        {
            assert!((ours - expected).abs() < 1e-12);
        }
        assert_eq!(covariance.to_rows()[4][4], covariance.0[(4, 4)]);
    }
}
