//! Eigenvalues of a symmetric 3×3 matrix, in closed form.

use nalgebra::{Matrix3, Vector3};

/// Eigenvalues of a symmetric matrix, ascending, by the trigonometric solution of its cubic (Smith
/// 1961).
///
/// Accurate to about 1e-15 of the largest magnitude: enough to compare a plane's values, not to
/// resolve tiny ones.
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

/// The unit vector that `a - value` maps to zero, for a simple eigenvalue; None when
/// it is not simple.
///
/// The rows of `a - value` span the plane across that vector: the longest of their cross products
/// is it.
pub fn eigenvector(a: &Matrix3<f64>, value: f64) -> Option<Vector3<f64>> {
    let shifted = a - Matrix3::from_diagonal_element(value);
    let [x, y, z] = [0, 1, 2].map(|i| shifted.column(i).into_owned());
    let crosses = [x.cross(&y), y.cross(&z), z.cross(&x)];
    let longest = crosses.iter().max_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared()))?;
    longest.try_normalize(0.0)
}

/// The eigenvector of the least eigenvalue, with the sign that the computation leaves.
pub(super) mod eberly {
    use nalgebra::{Matrix3, Vector3};

    /// The eigenvector of the least eigenvalue of a symmetric matrix, zero for the zero matrix.
    ///
    /// After D. Eberly, "A robust eigensolver for 3 × 3 symmetric matrices" (2014), which Open3D
    /// follows: first the vector of the eigenvalue farthest from the middle one, then the middle
    /// one's in the plane across it, then their product. Vectors come with the sign that this
    /// leaves.
    pub(in crate::geometry) fn least(a: &Matrix3<f64>) -> Vector3<f64> {
        let scale = a.max();
        if scale == 0.0 || !scale.is_finite() {
            return Vector3::zeros();
        }
        let a = a / scale;
        let norm = a.m12 * a.m12 + a.m13 * a.m13 + a.m23 * a.m23;
        if norm > 0.0 { of_full(&a, norm) } else { of_diagonal(&a) }
    }

    fn of_diagonal(a: &Matrix3<f64>) -> Vector3<f64> {
        match () {
            () if a.m11 < a.m22 && a.m11 < a.m33 => Vector3::x(),
            () if a.m22 < a.m11 && a.m22 < a.m33 => Vector3::y(),
            () => Vector3::z(),
        }
    }

    fn of_full(a: &Matrix3<f64>, norm: f64) -> Vector3<f64> {
        let q = a.trace() / 3.0;
        let (b11, b22, b33) = (a.m11 - q, a.m22 - q, a.m33 - q);
        let p = ((b11 * b11 + b22 * b22 + b33 * b33 + norm * 2.0) / 6.0).sqrt();
        let c11 = b22 * b33 - a.m23 * a.m23;
        let c12 = a.m12 * b33 - a.m23 * a.m13;
        let c13 = a.m12 * a.m23 - b22 * a.m13;
        let half = ((b11 * c11 - a.m12 * c12 + a.m13 * c13) / (p * p * p) * 0.5).clamp(-1.0, 1.0);
        let angle = half.acos() / 3.0;
        let high = angle.cos() * 2.0;
        let low = (angle + std::f64::consts::TAU / 3.0).cos() * 2.0;
        let [low, middle, high] = [low, -(low + high), high].map(|beta| q + p * beta);
        // Far from the middle one is where its vector is well determined.
        if half >= 0.0 {
            let third = alone(a, high);
            if high < low && high < middle {
                return third;
            }
            let second = across(a, &third, middle);
            if middle < low && middle < high { second } else { second.cross(&third) }
        } else {
            alone(a, low)
        }
    }

    /// The vector that `a - value` maps to zero: the longest product of two of its rows.
    fn alone(a: &Matrix3<f64>, value: f64) -> Vector3<f64> {
        let shifted = a - Matrix3::from_diagonal_element(value);
        let [r0, r1, r2] = [0, 1, 2].map(|row| shifted.row(row).transpose());
        let products = [r0.cross(&r1), r0.cross(&r2), r1.cross(&r2)];
        let longest = products[1..].iter().fold(products[0], |best, product| {
            if product.norm_squared() > best.norm_squared() { *product } else { best }
        });
        longest / longest.norm()
    }

    /// The vector of `value` in the plane across another eigenvector.
    fn across(a: &Matrix3<f64>, other: &Vector3<f64>, value: f64) -> Vector3<f64> {
        let u = if other.x.abs() > other.y.abs() {
            Vector3::new(-other.z, 0.0, other.x) / other.x.hypot(other.z)
        } else {
            Vector3::new(0.0, other.z, -other.y) / other.y.hypot(other.z)
        };
        let v = other.cross(&u);
        let (m11, m12, m22) = (u.dot(&(a * u)) - value, u.dot(&(a * v)), v.dot(&(a * v)) - value);
        // The null vector of [m11 m12; m12 m22], from its larger row.
        let (large, of_u) = if m11.abs() >= m22.abs() { (m11, true) } else { (m22, false) };
        if large == 0.0 && m12 == 0.0 {
            return u;
        }
        let (cos, sin) = if large.abs() >= m12.abs() {
            let ratio = m12 / large;
            let cos = 1.0 / (1.0 + ratio * ratio).sqrt();
            (cos, ratio * cos)
        } else {
            let ratio = large / m12;
            let sin = 1.0 / (1.0 + ratio * ratio).sqrt();
            (ratio * sin, sin)
        };
        if of_u { u * sin - v * cos } else { u * cos - v * sin }
    }
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
