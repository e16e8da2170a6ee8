//! Comparison of two sets of parameters on the same pairs: error and cost.

use echoloop_statistics::{Estimate, mean, paired_difference};
use serde::{Deserialize, Serialize};

use crate::config::preset::ErrorMean;
use crate::cost::{CostKind, ScanCost};
use crate::evaluation::objective::{PairError, Worth};

/// Loss of each pair: ‖T_est − T*‖_F, at most `cap`.
pub fn worths(errors: &[PairError], cap: f64) -> Vec<f64> {
    let worth = Worth { mean: ErrorMean::Arithmetic, cap };
    errors.iter().map(|error| worth.loss(error)).collect()
}

/// Difference of two sets of parameters in the mean error over the same pairs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Comparison {
    /// Mean difference; below 0 the second set has smaller errors.
    pub difference: f64,
    /// 95 % interval of the difference, by bootstrap over pairs.
    pub interval: [f64; 2],
    /// Mean error of the first; 0 in older results, which lack it.
    #[serde(default)]
    pub reference: f64,
}

/// Two errors are called the same when the 95 % interval of their difference stays within this
/// share of the first error.
const SAME: f64 = 0.25;

impl Comparison {
    /// Errors of the second set minus those of the first, each at most `cap` (0: no cap).
    pub fn new(first: &[PairError], second: &[PairError], cap: f64) -> Self {
        let (first, second) = (worths(first, cap), worths(second, cap));
        let Estimate { value: difference, interval } = paired_difference(&first, &second);
        Self { difference, interval, reference: mean(&first) }
    }

    /// True when the second errs significantly more.
    pub fn is_worse(&self) -> bool {
        self.interval[0] > 0.0
    }

    /// The difference in words. An interval that holds 0 means "the same error" only when it is
    /// narrow: few pairs prove nothing.
    pub fn error(&self) -> &'static str {
        match self.interval {
            [low, _] if low > 0.0 => "a higher error",
            [_, high] if high < 0.0 => "a lower error",
            [low, high] if high.max(-low) <= SAME * self.reference => "the same error",
            _ => "an error not shown to differ",
        }
    }

    /// `the same error at 1/7 of the energy`.
    pub fn at_cost(&self, kind: CostKind, first: &ScanCost, second: &ScanCost) -> String {
        let share = kind.of(second) / kind.of(first);
        format!("{} {}", self.error(), part(share, kind.name()))
    }
}

/// `at 1/7 of the energy`, `at 1.3 times the energy`.
fn part(share: f64, of: &str) -> String {
    match share {
        share if !share.is_finite() || share <= 0.0 => format!("at an unknown {of}"),
        share if share < 0.995 => format!("at 1/{} of the {of}", times(1.0 / share)),
        share if share < 1.005 => format!("at the same {of}"),
        share => format!("at {} times the {of}", times(share)),
    }
}

/// A factor with two significant digits.
fn times(factor: f64) -> String {
    if factor < 9.95 {
        return format!("{factor:.1}");
    }
    let unit = libm::pow(10.0, libm::log10(factor).floor() - 1.0);
    format!("{:.0}", (factor / unit).round() * unit)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn errors(values: &[f64]) -> Vec<PairError> {
        let error = |&frobenius| PairError { frobenius, ..PairError::default() };
        values.iter().map(error).collect()
    }

    #[test]
    fn pairs_are_compared_with_themselves_so_their_difficulty_is_taken_out() {
        let hard: Vec<f64> = (0..40).map(|i| 0.01 + 0.02 * f64::from(i)).collect();
        let less: Vec<f64> = hard.iter().map(|e| e - 0.002).collect();
        let compare = |a: &[f64], b: &[f64]| Comparison::new(&errors(a), &errors(b), 1.0);
        assert_eq!(compare(&hard, &less).error(), "a lower error");
        assert_eq!(compare(&less, &hard).error(), "a higher error");
        assert!(compare(&less, &hard).is_worse() && !compare(&hard, &less).is_worse());
        let noisy: Vec<f64> =
            hard.iter().enumerate().map(|(i, e)| e + [0.1, -0.1][i % 2]).collect();
        assert_eq!(compare(&hard, &noisy).error(), "the same error");
        let few = compare(&hard[..6], &noisy[..6]);
        assert_eq!(few.error(), "an error not shown to differ", "{few:?}");
        let one_lost: Vec<f64> = [100.0].into_iter().chain(less[1..].to_vec()).collect();
        let capped = compare(&hard, &one_lost);
        assert!(capped.difference < 0.03, "a pair counts for the cap at most: {capped:?}");
    }

    #[test]
    fn a_cost_is_said_as_a_part_or_as_so_many_times() {
        let cost = |energy_j| ScanCost { energy_j, instructions: 1.0, bits: 1.0, seconds: 1.0 };
        let same = Comparison { difference: 0.0, interval: [-0.1, 0.1], reference: 1.0 };
        let said = |a, b| same.at_cost(CostKind::Energy, &cost(a), &cost(b));
        assert_eq!(said(5e-3, 1e-4), "the same error at 1/50 of the energy");
        assert_eq!(said(5.678, 1e-3), "the same error at 1/5700 of the energy");
        assert_eq!(said(5e-3, 2e-3), "the same error at 1/2.5 of the energy");
        assert_eq!(said(5e-3, 5e-3), "the same error at the same energy");
        assert_eq!(said(2e-3, 5e-3), "the same error at 2.5 times the energy");
        assert_eq!(said(0.0, 1.0), "the same error at an unknown energy");
    }
}
