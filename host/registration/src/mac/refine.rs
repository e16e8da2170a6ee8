//! The best motion, fitted to all matches that agree with it.

use super::hypotheses::Hypothesis;
use crate::features::PointPair;
use crate::pose::Pose;
use crate::rigid::rigid;

/// A refined motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Refined {
    pub(super) hypothesis: Hypothesis,
    /// Fits made.
    pub(super) iterations: usize,
}

/// Fits anew to the matches within τ until the score no longer rises.
///
/// ```text
/// w = (1 - (d / τ)²)²  where d < τ, else 0      d = |R x + t - y|
/// ```
///
/// Tukey's biweight falls to 0 at τ, so no match enters or leaves with a jump. MAC and SC²-PCR take
/// `1 / (1 + (d / τ)²)`, which is 1/2 there: on the matches of MAC's demonstration that ends 1.36°
/// and 1.7 cm from the truth, this 1.17° and 0.8 cm; on 34 simulated pairs 0.28° and 5.8 cm on
/// average, this 0.25° and 5.9 cm.
pub(super) fn refine(
    pairs: &[PointPair],
    start: &Pose,
    scale_m: f64,
    max_iterations: usize,
) -> Refined {
    let mut best = Hypothesis { target_from_source: *start, score: score(pairs, start, scale_m) };
    for iteration in 0..max_iterations {
        let Some(next) = step(pairs, &best.target_from_source, scale_m) else {
            return Refined { hypothesis: best, iterations: iteration };
        };
        let score = score(pairs, &next, scale_m);
        if score.total_cmp(&best.score).is_le() {
            return Refined { hypothesis: best, iterations: iteration + 1 };
        }
        best = Hypothesis { target_from_source: next, score };
    }
    Refined { hypothesis: best, iterations: max_iterations }
}

fn step(pairs: &[PointPair], from: &Pose, scale_m: f64) -> Option<Pose> {
    let weighted: Vec<(PointPair, f64)> = pairs
        .iter()
        .map(|pair| (*pair, (from * pair.source - pair.target).norm() / scale_m))
        .filter(|(_, share)| *share < 1.0)
        .map(|(pair, share)| (pair, (1.0 - share * share).powi(2)))
        .collect();
    rigid(weighted.into_iter())
}

/// The matches within τ.
pub(super) fn inliers(pairs: &[PointPair], pose: &Pose, max_m: f64) -> Vec<PointPair> {
    pairs.iter().copied().filter(|pair| (pose * pair.source - pair.target).norm() < max_m).collect()
}

/// The MAE metric, exactly.
fn score(pairs: &[PointPair], pose: &Pose, scale_m: f64) -> f64 {
    pairs
        .iter()
        .map(|pair| (1.0 - (pose * pair.source - pair.target).norm() / scale_m).max(0.0))
        .sum()
}
