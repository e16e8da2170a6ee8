//! The rigid motion of least squares between weighted pairs of points.

use echoloop_clouds::Pose;
use nalgebra::{Matrix3, Matrix4, Quaternion, UnitQuaternion, Vector3, Vector4};

use super::features::PointPair;

/// Least count of pairs that determine a motion, if they neither coincide nor lie on a line.
const LEAST_PAIRS: usize = 3;

/// Least gap of the eigenvalues, over the largest: about the squared width over the squared length
/// of the points. Points on a line leave the turn about it open. 1e-10 is a width of 0.1 mm at
/// 10 m, the rounding of `f32` points.
const LEAST_GAP: f64 = 1e-10;

/// The motion `target_from_source` that minimises the weighted squared distances of pairs.
///
/// ```text
/// min Σ w |q - (R p + t)|²      p of the source, q of the target, m      R ∈ SO(3)      w ≥ 0
/// ```
///
/// `t` takes the weighted centroid of `p` to that of
/// `q`; `R` is the unit quaternion of the largest eigenvalue of a 4×4 matrix (Horn, "Closed-form
/// solution of absolute orientation using unit quaternions", 1987), so it never mirrors, whatever
/// the pairs. `None` when the pairs of positive weight are fewer than three or leave a turn open
/// (coincident, or on a line), and when a number among them is not finite or a weight is negative.
pub fn rigid(pairs: impl Iterator<Item = (PointPair, f64)> + Clone) -> Option<Pose> {
    let means = Means::new(pairs.clone())?;
    let covariance = means.covariance(pairs);
    let rotation = rotation(&covariance)?;
    let translation = means.target - rotation * means.source;
    let pose = Pose::from_parts(translation.into(), rotation);
    translation.iter().all(|v| v.is_finite()).then_some(pose)
}

/// Weighted centroids, m.
struct Means {
    source: Vector3<f64>,
    target: Vector3<f64>,
    weight: f64,
}

impl Means {
    fn new(pairs: impl Iterator<Item = (PointPair, f64)>) -> Option<Self> {
        let (mut source, mut target, mut weight, mut count) =
            (Vector3::zeros(), Vector3::zeros(), 0.0, 0);
        for (pair, w) in pairs {
            if w.is_nan() || w < 0.0 {
                return None;
            }
            source += pair.source.coords * w;
            target += pair.target.coords * w;
            weight += w;
            count += usize::from(w > 0.0);
        }
        let finite =
            source.iter().chain(target.iter()).all(|v| v.is_finite()) && weight.is_finite();
        (count >= LEAST_PAIRS && finite).then(|| Self {
            source: source / weight,
            target: target / weight,
            weight,
        })
    }

    /// `Σ w (p - p̄)(q - q̄)ᵀ / Σ w`, m².
    fn covariance(&self, pairs: impl Iterator<Item = (PointPair, f64)>) -> Matrix3<f64> {
        pairs.fold(Matrix3::zeros(), |sum, (pair, w)| {
            let p = (pair.source.coords - self.source) * (w / self.weight);
            sum + p * (pair.target.coords - self.target).transpose()
        })
    }
}

/// The rotation that maximises `tr(R C)`; `None` when another one does so too.
fn rotation(c: &Matrix3<f64>) -> Option<UnitQuaternion<f64>> {
    let scale = c.amax();
    if !(scale > 0.0 && scale.is_finite()) {
        return None;
    }
    let eigen = horn(&(c / scale)).symmetric_eigen();
    let largest = eigen.eigenvalues.imax();
    let value = eigen.eigenvalues[largest];
    let others =
        eigen.eigenvalues.iter().enumerate().filter(|(i, _)| *i != largest).map(|(_, v)| *v);
    let gap = value - others.fold(f64::NEG_INFINITY, f64::max);
    let q = eigen.eigenvectors.column(largest);
    (gap > LEAST_GAP * value)
        .then(|| UnitQuaternion::new_normalize(Quaternion::new(q[0], q[1], q[2], q[3])))
}

/// Horn's matrix; its quadratic form at the quaternion `(w, x, y, z)` of `R` is `tr(R C)`.
fn horn(c: &Matrix3<f64>) -> Matrix4<f64> {
    let turn = Vector3::new(c.m23 - c.m32, c.m31 - c.m13, c.m12 - c.m21);
    let core = c + c.transpose() - Matrix3::from_diagonal_element(c.trace());
    let mut n = Matrix4::from_diagonal(&Vector4::new(c.trace(), 0.0, 0.0, 0.0));
    n.fixed_view_mut::<1, 3>(0, 1).copy_from(&turn.transpose());
    n.fixed_view_mut::<3, 1>(1, 0).copy_from(&turn);
    n.fixed_view_mut::<3, 3>(1, 1).copy_from(&core);
    n
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use nalgebra::Point3;
    use proptest::prelude::*;

    use super::*;
    use echoloop_clouds::pose::{frobenius_error, rotation_error_deg};

    fn moved(points: &[[f64; 3]], truth: &Pose) -> Vec<PointPair> {
        points
            .iter()
            .map(|&p| PointPair { source: p.into(), target: truth * Point3::from(p) })
            .collect()
    }

    fn fit(pairs: &[PointPair]) -> Option<Pose> {
        rigid(pairs.iter().map(|&pair| (pair, 1.0)))
    }

    const CORNER: [[f64; 3]; 4] =
        [[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 1.0]];

    proptest! {
        #[test]
        fn any_motion_of_exact_pairs_is_found(
            points in prop::collection::vec(prop::array::uniform3(-50.0f64..50.0), 4..40),
            shift in prop::array::uniform3(-100.0f64..100.0),
            turn in prop::array::uniform3(-3.0f64..3.0),
        ) {
            let truth = Pose::new(shift.into(), turn.into());
            let found = fit(&moved(&points, &truth)).unwrap();
            prop_assert!(
                frobenius_error(&found, &truth) < 1e-8,
                "{}",
                frobenius_error(&found, &truth)
            );
        }

        #[test]
        fn no_pairs_make_it_panic_or_mirror(
            pairs in prop::collection::vec(
                (prop::array::uniform6(any::<f64>()), any::<f64>()), 0..6
            ),
        ) {
            let pairs = pairs.iter().map(|(v, w)| {
                let pair = PointPair {
                    source: Point3::new(v[0], v[1], v[2]),
                    target: Point3::new(v[3], v[4], v[5]),
                };
                (pair, *w)
            });
            if let Some(found) = rigid(pairs) {
                prop_assert!(echoloop_clouds::pose::to_rows(&found).iter().all(|v| v.is_finite()));
            }
        }

        #[test]
        fn the_result_beats_every_motion_near_it(
            points in prop::collection::vec(prop::array::uniform3(-5.0f64..5.0), 5..12),
            noise in prop::collection::vec(prop::array::uniform3(-1.0f64..1.0), 12),
            weights in prop::collection::vec(0.1f64..2.0, 12),
            step in prop::array::uniform6(-0.1f64..0.1),
        ) {
            let mut pairs =
                moved(&points, &Pose::new([1.0, 2.0, 3.0].into(), [0.5, -2.0, 1.0].into()));
            for (pair, noise) in pairs.iter_mut().zip(&noise) {
                pair.target += Vector3::from(*noise);
            }
            let cost = |pose: &Pose| -> f64 {
                pairs
                    .iter()
                    .zip(&weights)
                    .map(|(p, w)| w * (pose * p.source - p.target).norm_squared())
                    .sum()
            };
            let found = rigid(pairs.iter().copied().zip(weights.iter().copied())).unwrap();
            let [a, b, c, x, y, z] = step;
            let near = Pose::new([a, b, c].into(), [x, y, z].into()) * found;
            prop_assert!(cost(&found) <= cost(&near) + 1e-9);
        }
    }

    #[test]
    fn points_of_a_plane_determine_the_motion_and_half_turns_are_no_exception() {
        for turn in
            [[0.0, 0.0, std::f64::consts::PI], [std::f64::consts::PI, 0.0, 0.0], [0.0, 3.1, 0.2]]
        {
            let truth = Pose::new([5.0, -3.0, 0.5].into(), turn.into());
            let found = fit(&moved(&CORNER[..3], &truth)).unwrap();
            assert!(frobenius_error(&found, &truth) < 1e-10);
        }
    }

    #[test]
    fn mirrored_pairs_give_a_rotation_all_the_same() {
        let pairs: Vec<PointPair> = CORNER
            .iter()
            .map(|p| PointPair { source: (*p).into(), target: [p[0], p[1], -p[2]].into() })
            .collect();
        let rotation = fit(&pairs).unwrap().rotation.to_rotation_matrix();
        assert!((rotation.matrix().determinant() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn pairs_that_determine_no_motion_give_none() {
        let truth = Pose::new([1.0, 2.0, 3.0].into(), [0.1, 0.2, 0.3].into());
        let line: Vec<[f64; 3]> =
            (0..50).map(|i| [f64::from(i) * 0.7, f64::from(i) * 0.3, 9.0]).collect();
        let rounded = |points: &[[f64; 3]]| -> Vec<PointPair> {
            let round = |p: Point3<f64>| p.cast::<f32>().cast::<f64>();
            let pair =
                |p: PointPair| PointPair { source: round(p.source), target: round(p.target) };
            moved(points, &truth).into_iter().map(pair).collect()
        };
        assert_eq!(fit(&[]), None);
        assert_eq!(fit(&moved(&CORNER[..2], &truth)), None, "two pairs");
        assert_eq!(fit(&moved(&[CORNER[1]; 9], &truth)), None, "coincident");
        assert_eq!(fit(&moved(&line, &truth)), None, "on a line");
        assert_eq!(fit(&rounded(&line)), None, "on a line, as f32 has it");
        let mut broken = moved(&CORNER, &truth);
        broken[2].target.y = f64::NAN;
        assert_eq!(fit(&broken), None, "not a number");
        broken[2].target.y = f64::INFINITY;
        assert_eq!(fit(&broken), None, "infinite");
    }

    #[test]
    fn a_pair_of_weight_0_does_not_count_and_a_negative_weight_is_refused() {
        let truth = Pose::new([1.0, 2.0, 3.0].into(), [0.1, 0.2, 0.3].into());
        let mut pairs = moved(&CORNER, &truth);
        pairs.push(PointPair { source: [9.0, 9.0, 9.0].into(), target: [0.0; 3].into() });
        let weighted = |last: f64| rigid(pairs.iter().copied().zip([1.0, 1.0, 1.0, 1.0, last]));
        assert!(rotation_error_deg(&weighted(0.0).unwrap(), &truth) < 1e-9);
        assert_eq!(weighted(-1.0), None);
        assert_eq!(weighted(f64::NAN), None);
        let three = pairs.iter().copied().zip([1.0, 1.0, 0.0, 0.0, 0.0]);
        assert_eq!(rigid(three), None, "two pairs of weight");
    }
}
