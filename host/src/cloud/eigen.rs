//! Eigenvalues of a symmetric 3×3 matrix, in closed form.

use nalgebra::{Matrix3, Vector3};

/// Eigenvalues of a symmetric matrix, ascending, by the trigonometric solution of its cubic (Smith 1961).
///
/// Accurate to about 1e-15 of the largest magnitude: enough to compare a plane's values, not to resolve tiny ones.
pub fn eigenvalues(a: &Matrix3<f64>) -> [f64; 3] {
    let mean = a.trace() / 3.0;
    let centred = a - Matrix3::from_diagonal_element(mean);
    let spread = (centred.norm_squared() / 6.0).sqrt();
    if spread == 0.0 {
        return [mean; 3];
    }
    let cosine = ((centred / spread).determinant() / 2.0).clamp(-1.0, 1.0);
    let angle = cosine.acos() / 3.0;
    let high = mean + 2.0 * spread * angle.cos();
    let low = mean + 2.0 * spread * (angle + std::f64::consts::TAU / 3.0).cos();
    [low, 3.0 * mean - low - high, high]
}

/// The unit vector that `a - value` maps to zero, for an eigenvalue that stands alone; absent when it does not.
///
/// The rows of `a - value` span the plane across that vector: the longest of their cross products is it.
pub fn eigenvector(a: &Matrix3<f64>, value: f64) -> Option<Vector3<f64>> {
    let shifted = a - Matrix3::from_diagonal_element(value);
    let [x, y, z] = [0, 1, 2].map(|i| shifted.column(i).into_owned());
    let crosses = [x.cross(&y), y.cross(&z), z.cross(&x)];
    let longest = crosses.iter().max_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared()))?;
    longest.try_normalize(0.0)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn the_closed_form_equals_the_iterative_one(v in prop::array::uniform6(-10.0f64..10.0)) {
            let a = Matrix3::new(v[0], v[1], v[2], v[1], v[3], v[4], v[2], v[4], v[5]);
            let mut expected = a.symmetric_eigenvalues();
            expected.as_mut_slice().sort_by(f64::total_cmp);
            let ours = eigenvalues(&a);
            for (ours, expected) in ours.iter().zip(expected.iter()) {
                prop_assert!((ours - expected).abs() < 1e-12 * a.norm(), "{} {}", ours, expected);
            }
            if ours[1] - ours[0] > 1e-3 {
                let vector = eigenvector(&a, ours[0]).unwrap();
                prop_assert!((a * vector - vector * ours[0]).norm() < 1e-8);
            }
        }
    }

    #[test]
    fn a_multiple_of_the_identity_has_one_value_and_no_direction() {
        let a = Matrix3::from_diagonal_element(2.0);
        assert_eq!(eigenvalues(&a), [2.0; 3]);
        assert_eq!(eigenvector(&a, 2.0), None);
    }
}
