//! Score of a motion over all matches.

use echoloop_clouds::Pose;
use echoloop_dispatch::dispatch;
use nalgebra::{Matrix3, Vector3};

use crate::correspondences::{Centroids, Columns, Residuals};
use crate::features::PointPair;

/// Matches taken at a time: one 256-bit vector of `f32`.
const LANES: usize = 8;

/// MAC's MAE metric over all matches, exactly; the function that [`Scorer::score`] is quick at.
pub(super) fn exact_score(pairs: &[PointPair], target_from_source: &Pose, scale_m: f64) -> f64 {
    let residuals = Residuals::new(target_from_source);
    let score = |pair| (1.0 - residuals.squared_m2(pair).sqrt() / scale_m).max(0.0);
    pairs.iter().map(score).sum()
}

/// Matches as they are scored.
#[derive(Clone, Debug)]
pub(super) struct Scorer {
    columns: Columns,
    centroids: Centroids,
    scale_m: f32,
}

/// A rotation and a shift between the centred clouds.
type Motion = ([[f32; 3]; 3], [f32; 3]);

impl Scorer {
    /// Over finite pairs; a match farther off than `scale_m` scores nothing.
    pub(super) fn new(pairs: &[PointPair], scale_m: f64) -> Self {
        let (columns, centroids) = Columns::new(pairs);
        Self { columns, centroids, scale_m: scale_m as f32 }
    }

    /// MAC's MAE metric over all matches:
    ///
    /// ```text
    /// Σ max(0, 1 - |R x + t - y| / τ)
    /// ```
    ///
    /// In `f32`, to about 1e-5 of itself: enough to rank motions.
    pub(super) fn score(&self, target_from_source: &Pose) -> f64 {
        let rotation = target_from_source.rotation.to_rotation_matrix().into_inner();
        let shift = rotation * self.centroids.source + target_from_source.translation.vector
            - self.centroids.target;
        let motion = in_f32(&rotation, &shift);
        sum(&self.columns, &motion, self.scale_m)
    }
}

fn in_f32(rotation: &Matrix3<f64>, shift: &Vector3<f64>) -> Motion {
    let row = |i: usize| [0, 1, 2].map(|j| rotation[(i, j)] as f32);
    ([0, 1, 2].map(row), [0, 1, 2].map(|i| shift[i] as f32))
}

dispatch! {
    /// The scores of all matches.
    fn sum(columns: &Columns, motion: &Motion, scale_m: f32) -> f64 = sum_inline;
}

#[inline(always)]
fn sum_inline(columns: &Columns, (r, t): &Motion, scale_m: f32) -> f64 {
    let share = 1.0 / scale_m;
    let mut sums = [0.0f32; LANES];
    let columns = columns.chunks::<LANES>();
    for index in 0..columns[0].len() {
        let block = columns.map(|column| &column[index]);
        for lane in 0..LANES {
            let d = |axis: usize| {
                let turned = r[axis][0] * block[0][lane]
                    + r[axis][1] * block[1][lane]
                    + r[axis][2] * block[2][lane];
                turned + t[axis] - block[3 + axis][lane]
            };
            let far = (d(0) * d(0) + d(1) * d(1) + d(2) * d(2)).sqrt();
            let score = 1.0 - far * share;
            sums[lane] += if score > 0.0 { score } else { 0.0 };
        }
    }
    sums.iter().map(|sum| f64::from(*sum)).sum()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn the_score_is_the_sum_over_all_matches_and_the_same_bytes_in_both_builds(
            pairs in prop::collection::vec(prop::array::uniform6(-20.0f64..20.0), 0..70),
            turn in prop::array::uniform3(-3.0f64..3.0),
            shift in prop::array::uniform3(-5.0f64..5.0),
            scale_m in 0.1f64..30.0,
        ) {
            let pose = Pose::new(shift.into(), turn.into());
            let pair = |v: &[f64; 6]| PointPair {
                source: [v[0], v[1], v[2]].into(),
                target: [v[3], v[4], v[5]].into(),
            };
            let pairs: Vec<PointPair> = pairs.iter().map(pair).collect();
            let far = |pair: &PointPair| (pose * pair.source - pair.target).norm();
            let expected: f64 = pairs.iter().map(|pair| (1.0 - far(pair) / scale_m).max(0.0)).sum();
            let scorer = Scorer::new(&pairs, scale_m);
            let score = scorer.score(&pose);
            prop_assert!(
                (exact_score(&pairs, &pose, scale_m) - expected).abs() <= 1e-9 * (1.0 + expected)
            );
            prop_assert!(
                (score - expected).abs() <= 1e-4 * (1.0 + expected),
                "{} {}",
                score,
                expected
            );
            let rotation = pose.rotation.to_rotation_matrix().into_inner();
            let shift = rotation * scorer.centroids.source + pose.translation.vector
                - scorer.centroids.target;
            prop_assert_eq!(
                score.to_bits(),
                sum_inline(&scorer.columns, &in_f32(&rotation, &shift), scorer.scale_m).to_bits()
            );
        }
    }
}
