//! Poses and trajectories from files, and the error of an estimated pose.

mod read;
mod trajectory;

use nalgebra::{Isometry3, Matrix3, Matrix4, Rotation3, Translation3, UnitQuaternion};

pub use read::{parse_pose, read_pose};
pub use trajectory::{Stamped, parse_trajectory, read_trajectory, to_kitti};

/// A rigid motion. Its variables are called by what they map: `target_from_source`.
pub type Pose = Isometry3<f64>;

/// Largest entry of `RᵀR - I` allowed in a rotation from a file: six printed digits, with room.
const RIGID_TOLERANCE: f64 = 1e-3;

/// Entry of `RᵀR - I` up to which a rotation of `f64` is taken as it is.
const ROUNDING: f64 = 1e-12;

/// Reason why a 4×4 matrix is not a rigid motion.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum NotRigid {
    /// An entry is infinite or not a number.
    #[error("an entry of the matrix is not finite")]
    NotFinite,
    /// The last row is not 0 0 0 1.
    #[error("the last row of the matrix is not 0 0 0 1")]
    LastRow,
    /// The largest entry of `RᵀR - I`.
    #[error("the rotation is not orthonormal: RᵀR is {0:.3e} from the identity")]
    NotOrthonormal(f64),
    /// The determinant of the rotation is negative.
    #[error("the rotation mirrors: its determinant is negative")]
    Mirrors,
}

/// The true motion between two scans, `first_from_second`, from their poses.
///
/// ```text
/// first_from_second = world_from_first⁻¹ · world_from_second
/// ```
///
/// The paper writes `P_i · P_j⁻¹`. That is the same only if its `P` maps the world to the sensor
/// (`P = world_from_sensor⁻¹`); here poses map the sensor to the world.
pub fn relative(world_from_first: &Pose, world_from_second: &Pose) -> Pose {
    world_from_first.inv_mul(world_from_second)
}

/// Distance between two translations, m.
pub fn translation_error_m(estimate: &Pose, truth: &Pose) -> f64 {
    (estimate.translation.vector - truth.translation.vector).norm()
}

/// Angle between two rotations, degrees, 0 to 180: Eq. 7 of the paper.
///
/// ```text
/// arccos( (tr(R_estᵀ R*) - 1) / 2 ) = 2 · atan2( |q_xyz|, |q_w| )      q of R_estᵀ R*
/// ```
///
/// Near 0 the arccosine loses half of the digits (1e-8 rad at best), and it needs a clamp. The
/// arctangent has neither fault.
pub fn rotation_error_deg(estimate: &Pose, truth: &Pose) -> f64 {
    let between = estimate.rotation.inverse() * truth.rotation;
    let half = between.imag().norm().atan2(between.w.abs());
    (2.0 * half).to_degrees()
}

/// `‖T_est - T*‖_F` of the 4×4 matrices: Eq. 3 of the paper. It adds metres to sines.
pub fn frobenius_error(estimate: &Pose, truth: &Pose) -> f64 {
    (estimate.to_homogeneous() - truth.to_homogeneous()).norm()
}

/// The 4×4 matrix of a pose, row by row; the translation in metres.
pub fn to_rows(pose: &Pose) -> [f64; 16] {
    let matrix = pose.to_homogeneous();
    std::array::from_fn(|i| matrix[(i / 4, i % 4)])
}

/// The pose of a 4×4 matrix, row by row. A rotation within 1e-3 of orthonormal is made orthonormal.
///
/// # Errors
///
/// [`NotRigid`] names the missing property of a rigid motion.
pub fn from_rows(rows: &[f64; 16]) -> Result<Pose, NotRigid> {
    if rows.iter().any(|v| !v.is_finite()) {
        return Err(NotRigid::NotFinite);
    }
    let matrix = Matrix4::from_row_slice(rows);
    let last = matrix.row(3) - nalgebra::RowVector4::new(0.0, 0.0, 0.0, 1.0);
    if last.amax() > RIGID_TOLERANCE {
        return Err(NotRigid::LastRow);
    }
    let rotation: Matrix3<f64> = matrix.fixed_view::<3, 3>(0, 0).into();
    let miss = (rotation.transpose() * rotation - Matrix3::identity()).amax();
    if miss > RIGID_TOLERANCE {
        return Err(NotRigid::NotOrthonormal(miss));
    }
    if rotation.determinant() < 0.0 {
        return Err(NotRigid::Mirrors);
    }
    let mut rotation =
        UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
    if miss > ROUNDING {
        rotation.renormalize(); // of few digits the quaternion is not of length 1
    }
    let translation = Translation3::new(rows[3], rows[7], rows[11]);
    Ok(Pose::from_parts(translation, rotation))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use nalgebra::Vector3;
    use proptest::prelude::*;

    use super::*;

    fn pose(v: [f64; 6]) -> Pose {
        Pose::new(Vector3::new(v[0], v[1], v[2]), Vector3::new(v[3], v[4], v[5]))
    }

    #[test]
    fn the_second_sensor_lies_at_its_offset_in_the_frame_of_the_first() {
        // The second sensor stands 2 m ahead, both look along world y: second's origin is at x = 2
        // of the first.
        let turn = Vector3::new(0.0, 0.0, std::f64::consts::FRAC_PI_2);
        let first = Pose::new(Vector3::new(10.0, 0.0, 0.0), turn);
        let second = Pose::new(Vector3::new(10.0, 2.0, 0.0), turn);
        let truth = relative(&first, &second);
        assert!((truth.translation.vector - Vector3::new(2.0, 0.0, 0.0)).norm() < 1e-12);
    }

    #[test]
    fn the_papers_order_agrees_when_its_poses_map_the_world_to_the_sensor() {
        let (first, second) =
            (pose([1.0, 2.0, 3.0, 0.1, 0.2, 0.3]), pose([-4.0, 1.0, 0.0, -0.3, 0.0, 1.0]));
        let paper = first.inverse() * second.inverse().inverse();
        assert!(frobenius_error(&relative(&first, &second), &paper) < 1e-12);
    }

    #[test]
    fn the_rotation_error_keeps_its_digits_where_the_arccosine_loses_them() {
        for angle in [0.0, 1e-12, 1e-9, 1e-4, 1.0, 3.0, std::f64::consts::PI] {
            let turned = pose([0.0, 0.0, 0.0, 0.0, 0.0, angle]);
            let error = rotation_error_deg(&Pose::identity(), &turned).to_radians();
            assert!(
                (error - angle).abs() <= 1e-14 * (1.0 + angle / 1e-14 * 1e-15),
                "{angle} gave {error}"
            );
        }
    }

    #[test]
    fn the_frobenius_error_of_a_shift_is_its_length() {
        let shifted = pose([3.0, 4.0, 0.0, 0.0, 0.0, 0.0]);
        assert!((frobenius_error(&Pose::identity(), &shifted) - 5.0).abs() < 1e-15);
        assert!((translation_error_m(&Pose::identity(), &shifted) - 5.0).abs() < 1e-15);
    }

    #[test]
    fn a_matrix_that_is_not_rigid_is_refused_with_its_reason() {
        let identity = to_rows(&Pose::identity());
        let with = |at: usize, value: f64| {
            let mut rows = identity;
            rows[at] = value;
            from_rows(&rows)
        };
        assert_eq!(with(3, f64::NAN), Err(NotRigid::NotFinite));
        assert_eq!(with(12, 0.5), Err(NotRigid::LastRow));
        assert_eq!(with(0, -1.0), Err(NotRigid::Mirrors));
        assert_eq!(with(0, 2.0), Err(NotRigid::NotOrthonormal(3.0)));
    }

    #[test]
    fn a_rotation_of_few_digits_is_made_orthonormal() {
        let exact = pose([300.0, -20.0, 4.0, 0.3, -0.2, 1.1]);
        let few = from_rows(&to_rows(&exact).map(|entry| (entry * 1e4).round() / 1e4)).unwrap();
        let rotation: Matrix3<f64> = few.rotation.to_rotation_matrix().into_inner();
        let miss = (rotation.transpose() * rotation - Matrix3::identity()).amax();
        assert!(miss < 1e-15, "{miss}");
        assert!(rotation_error_deg(&few, &exact) < 0.01);
    }

    proptest! {
        #[test]
        fn rows_and_back_is_the_same_pose(v in prop::array::uniform6(-3.0f64..3.0)) {
            let pose = pose(v);
            prop_assert!(frobenius_error(&from_rows(&to_rows(&pose)).unwrap(), &pose) < 1e-12);
        }
    }
}
