//! Difficulty of pairs at which a given share of them is registered.
//!
//! Recalls are measured at some difficulties, made to fall ([`falling`]) and interpolated
//! ([`difficulty_at`]).

use echoloop_statistics::wilson;
use serde::Serialize;

/// Pairs registered at one difficulty.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct DifficultyStep {
    /// `data.difficulty`.
    pub difficulty: f64,
    /// Pairs registered.
    pub successes: usize,
    /// Pairs tried.
    pub pairs: usize,
}

impl DifficultyStep {
    /// Share of the pairs that is registered, 0 to 1.
    pub fn recall(&self) -> f64 {
        self.successes as f64 / self.pairs.max(1) as f64
    }

    /// 95 % interval of the recall.
    pub fn interval(&self) -> [f64; 2] {
        wilson(self.recall(), self.pairs as f64)
    }
}

/// True when the last two steps are below a recall: beyond them it only falls.
pub fn is_far_below(steps: &[DifficultyStep], recall_pct: f64) -> bool {
    let below = |step: &&DifficultyStep| step.recall() * 100.0 < recall_pct;
    steps.iter().rev().take(2).filter(below).count() == 2
}

/// Isotonic regression of the recalls: a step that rises is pooled with those before (Ayer et al.,
/// Ann. Math. Stat. 26, 1955). Points `[difficulty, recall]`.
pub fn falling(steps: &[DifficultyStep]) -> Vec<[f64; 2]> {
    let mut pools: Vec<(Vec<f64>, usize, usize)> = Vec::new();
    for step in steps {
        pools.push((vec![step.difficulty], step.successes, step.pairs));
        while let [.., (_, a, of_a), (_, b, of_b)] = &pools[..] {
            if a * of_b >= b * of_a {
                break;
            }
            let Some((more, successes, pairs)) = pools.pop() else { break };
            let Some(last) = pools.last_mut() else { break };
            last.0.extend(more);
            (last.1, last.2) = (last.1 + successes, last.2 + pairs);
        }
    }
    let points = |(difficulties, successes, pairs): &(Vec<f64>, usize, usize)| {
        let recall = *successes as f64 / (*pairs).max(1) as f64;
        difficulties.iter().map(|&difficulty| [difficulty, recall]).collect::<Vec<_>>()
    };
    pools.iter().flat_map(points).collect()
}

/// The difficulty at which a falling curve has a recall; none where it begins below or ends above.
pub fn difficulty_at(curve: &[[f64; 2]], recall: f64) -> Option<f64> {
    let crossed = |pair: &&[[f64; 2]]| pair[0][1] >= recall && pair[1][1] < recall;
    let pair = curve.windows(2).find(crossed)?;
    let [[from, high], [to, low]] = [pair[0], pair[1]];
    Some(from + (to - from) * (high - recall) / (high - low))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn steps(successes: &[usize]) -> Vec<DifficultyStep> {
        let step = |(i, &successes): (usize, &usize)| DifficultyStep {
            difficulty: i as f64 * 0.5,
            successes,
            pairs: 10,
        };
        successes.iter().enumerate().map(step).collect()
    }

    #[test]
    fn a_recall_lies_where_the_falling_curve_has_it() {
        let curve = falling(&steps(&[10, 10, 8, 4, 0]));
        let at = |recall| difficulty_at(&curve, recall);
        assert_eq!((at(0.9), at(0.6), at(0.2)), (Some(0.75), Some(1.25), Some(1.75)));
        assert_eq!(difficulty_at(&falling(&steps(&[10, 10])), 0.5), None);
        assert_eq!(difficulty_at(&falling(&steps(&[3, 1])), 0.5), None);
        assert_eq!(difficulty_at(&[], 0.5), None);
    }

    #[test]
    fn a_step_that_rises_is_one_with_those_before() {
        let curve = falling(&steps(&[10, 6, 8, 9, 1]));
        let recalls: Vec<f64> = curve.iter().map(|point| point[1]).collect();
        let pooled = 23.0 / 30.0;
        assert_eq!(recalls, [1.0, pooled, pooled, pooled, 0.1]);
    }

    #[test]
    fn two_steps_below_what_is_asked_for_are_enough() {
        let is_far_below = |successes: &[usize]| is_far_below(&steps(successes), 20.0);
        assert!(!is_far_below(&[10, 1]) && !is_far_below(&[10, 1, 2, 1]) && !is_far_below(&[]));
        assert!(is_far_below(&[10, 1, 1]));
    }
}
