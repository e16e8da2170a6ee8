//! Comparison of the errors and costs of two sets of parameters on the same pairs.

use echoloop_random::Generator;
use serde::{Deserialize, Serialize};

use crate::config::preset::ErrorMean;
use crate::cost::{CostKind, ScanCost};
use crate::evaluation::objective::{PairError, Worth};

/// Samples that a bootstrap draws.
const RESAMPLES: u64 = 2_000;

/// "bootstrap" as a number: keeps these draws apart from those of other uses.
const PURPOSE: u64 = 0x626f_6f74_7374_7261;

/// The interval that holds the mean of such values with 95 %: percentile bootstrap (Efron and
/// Tibshirani 1993, Ch. 13). Of none, no numbers.
pub fn mean_interval(values: &[f64]) -> [f64; 2] {
    let mean =
        |drawn: &[usize]| drawn.iter().map(|&i| values[i]).sum::<f64>() / values.len() as f64;
    bootstrap(values.len(), &mean)
}

/// The 95 % interval of a figure of `count` things, by percentiles of what it is of as many drawn
/// from them with repetition. Draws that have no such figure are left out; where those are most,
/// there is no interval, nor is there one of nothing.
pub fn bootstrap(count: usize, figure: &dyn Fn(&[usize]) -> f64) -> [f64; 2] {
    let resampled = |sample: u64| {
        let mut random = Generator::from_key([sample, count as u64, 0, PURPOSE]);
        figure(&(0..count).map(|_| random.index(count)).collect::<Vec<_>>())
    };
    let samples = if count == 0 { 0 } else { RESAMPLES };
    let mut figures: Vec<f64> = (0..samples).map(resampled).filter(|f| f.is_finite()).collect();
    if figures.len() <= RESAMPLES as usize / 2 {
        return [f64::NAN; 2];
    }
    figures.sort_by(f64::total_cmp);
    let at = |share: f64| figures[(share * (figures.len() - 1) as f64).round() as usize];
    [at(0.025), at(0.975)]
}

/// ‖T_est − T*‖_F of each pair, at most `cap`.
pub fn worths(errors: &[PairError], cap: f64) -> Vec<f64> {
    let worth = Worth { mean: ErrorMean::Arithmetic, cap };
    errors.iter().map(|error| worth.loss(error)).collect()
}

/// Mean difference of the errors of two sets of parameters on the same pairs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Comparison {
    /// Mean difference; below 0 the second set has smaller errors.
    pub difference: f64,
    /// Its 95 % interval, by bootstrap over pairs.
    pub interval: [f64; 2],
    /// Mean of the first set; 0 in results written before it was kept.
    #[serde(default)]
    pub reference: f64,
}

/// Errors are equal when the 95 % interval of their difference is within this share of the first.
const SAME: f64 = 0.25;

impl Comparison {
    /// Errors of the second set minus those of the first, each at most `cap` (0: no cap).
    pub fn new(first: &[PairError], second: &[PairError], cap: f64) -> Self {
        let (first, second) = (worths(first, cap), worths(second, cap));
        let differences: Vec<f64> = first.iter().zip(&second).map(|(a, b)| b - a).collect();
        let difference = differences.iter().sum::<f64>() / differences.len() as f64;
        let reference = first.iter().sum::<f64>() / first.len() as f64;
        Self { difference, interval: mean_interval(&differences), reference }
    }

    /// True when the second set has significantly larger errors.
    pub fn is_worse(&self) -> bool {
        self.interval[0] > 0.0
    }

    /// The comparison in words. Where the interval holds zero, errors are called equal only if it is
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

/// Two digits.
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
        let error = |(pair, &frobenius): (usize, &f64)| PairError {
            pair,
            translation_m: frobenius,
            rotation_deg: 0.1,
            frobenius,
            points: [100, 100],
            stop: String::new(),
            iterations: 1,
        };
        values.iter().enumerate().map(error).collect()
    }

    #[test]
    fn the_interval_of_a_mean_is_that_of_its_standard_error_and_holds_it_as_often_as_said() {
        let mut random = Generator::new(3, 0);
        let mut missed = 0;
        for _ in 0..200 {
            let values = random.normals(60);
            let [low, high] = mean_interval(&values);
            // 3.92 standard errors
            assert!((0.7..1.4).contains(&((high - low) / (3.92 / libm::sqrt(60.0)))));
            missed += u32::from(low > 0.0 || high < 0.0);
        }
        assert!((2..=24).contains(&missed), "{missed} of 200 miss the mean, 5 % should");
        assert_eq!(mean_interval(&[2.5; 7]), [2.5, 2.5]);
        assert!(mean_interval(&[]).iter().all(|end| end.is_nan()));
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
