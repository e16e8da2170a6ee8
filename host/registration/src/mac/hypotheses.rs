//! Motions that cliques propose, and their scores.

use echoloop_clouds::Pose;
use rayon::prelude::*;

use super::score::Scorer;
use crate::features::PointPair;
use crate::rigid::rigid;

/// A motion and its score over all matches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Hypothesis {
    pub(super) target_from_source: Pose,
    /// Score by the MAE metric, in matches.
    pub(super) score: f64,
}

/// The motions that cliques of `nodes` propose, best first; equals in the order of the cliques.
pub(super) fn propose(
    cliques: &[Vec<u32>],
    nodes: &[PointPair],
    scorer: &Scorer,
) -> Vec<Hypothesis> {
    let hypothesis = |clique: &Vec<u32>| {
        let target_from_source = rigid(clique.iter().map(|&node| (nodes[node as usize], 1.0)))?;
        Some(Hypothesis { target_from_source, score: scorer.score(&target_from_source) })
    };
    let mut proposed: Vec<Hypothesis> = cliques.par_iter().filter_map(hypothesis).collect();
    proposed.sort_by(|a, b| b.score.total_cmp(&a.score));
    proposed
}

/// True when a motion is clearly another than `best`: it moves the matches that agree with
/// `best` by more than `2 τ` from where that has them (root mean square).
pub(super) fn is_another(
    other: &Pose,
    best: &Pose,
    inliers: &[PointPair],
    max_pair_distance_m: f64,
) -> bool {
    let apart = |pair: &PointPair| (other * pair.source - best * pair.source).norm_squared();
    let sum: f64 = inliers.iter().map(apart).sum();
    sum > (2.0 * max_pair_distance_m).powi(2) * inliers.len() as f64
}
