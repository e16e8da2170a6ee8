//! The closing step: what all matches say about the motion found.

use crate::features::PointPair;
use crate::pose::Pose;
use crate::rigid::rigid;

/// Fits at most.
const FITS: usize = 12;

/// What agrees with a motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Agreement {
    pub(super) target_from_source: Pose,
    /// Matches within the pair distance.
    pub(super) inliers: usize,
    /// Root mean square distance of those, m.
    pub(super) rmse_m: f64,
}

impl Agreement {
    /// Of all matches within `delta_m`.
    pub(super) fn of(pairs: &[PointPair], pose: &Pose, delta_m: f64) -> Self {
        let (rotation, shift) = (pose.rotation.to_rotation_matrix(), pose.translation.vector);
        let (mut inliers, mut squares) = (0, 0.0);
        for pair in pairs {
            let squared =
                (pair.target.coords - rotation * pair.source.coords - shift).norm_squared();
            if squared < delta_m * delta_m {
                inliers += 1;
                squares += squared;
            }
        }
        Self {
            target_from_source: *pose,
            inliers,
            rmse_m: (squares / inliers.max(1) as f64).sqrt(),
        }
    }

    /// More inliers are better; of as many, the nearer ones.
    fn beats(&self, other: &Self) -> bool {
        (self.inliers, other.rmse_m) > (other.inliers, self.rmse_m)
    }
}

/// Fits the motion again to all matches, not only those the tuple test kept, until it no longer
/// gets better.
///
/// ```text
/// w = (1 - r² / (2 δ)²)²  within 2 δ, else 0       r = |q - T p|, m
/// ```
///
/// Tukey's biweight: matches are means of voxels, so right ones may lie a little beyond δ and still
/// say something, while far ones say nothing at all, unlike under the annealed kernel.
pub(super) fn closed(pairs: &[PointPair], start: &Pose, delta_m: f64) -> Agreement {
    let mut best = Agreement::of(pairs, start, delta_m);
    let mut pose = *start;
    for _ in 0..FITS {
        let Some(next) = fit(pairs, &pose, 2.0 * delta_m) else { break };
        pose = next;
        let found = Agreement::of(pairs, &pose, delta_m);
        if found == best {
            break;
        }
        if found.beats(&best) {
            best = found;
        }
    }
    best
}

fn fit(pairs: &[PointPair], pose: &Pose, width_m: f64) -> Option<Pose> {
    let (rotation, shift) = (pose.rotation.to_rotation_matrix(), pose.translation.vector);
    let weighted: Vec<(PointPair, f64)> = pairs
        .iter()
        .filter_map(|pair| {
            let squared =
                (pair.target.coords - rotation * pair.source.coords - shift).norm_squared();
            let rest = 1.0 - squared / (width_m * width_m);
            (rest > 0.0).then_some((*pair, rest * rest))
        })
        .collect();
    rigid(weighted.iter().copied())
}
