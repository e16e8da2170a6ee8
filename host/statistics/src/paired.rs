//! Two sets of values on the same pairs: the difficulty that a pair has for both is taken out.

use crate::{Estimate, mean, mean_interval, standard_error};

/// Mean of `second − first`, pair by pair, with its 95 % interval by bootstrap over pairs.
pub fn paired_difference(first: &[f64], second: &[f64]) -> Estimate {
    let differences = differences(second, first);
    Estimate { value: mean(&differences), interval: mean_interval(&differences) }
}

/// Standard error of the mean of `own − other`, pair by pair.
pub fn paired_standard_error(own: &[f64], other: &[f64]) -> f64 {
    standard_error(&differences(own, other))
}

/// Paired t statistic: the mean of `own − other` in its standard errors. 0 where the mean is 0, and
/// infinite where every pair differs by the same.
pub fn paired_t(own: &[f64], other: &[f64]) -> f64 {
    let mean = mean(&differences(own, other));
    if mean == 0.0 { 0.0 } else { mean / paired_standard_error(own, other) }
}

fn differences(own: &[f64], other: &[f64]) -> Vec<f64> {
    own.iter().zip(other).map(|(own, other)| own - other).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn t_is_the_mean_difference_in_its_standard_errors() {
        let other = [0.1, 0.9, 0.3, 0.5];
        assert_eq!(paired_t(&other, &other), 0.0);
        let worse = other.map(|value| value + 0.125);
        assert!(paired_t(&worse, &other) > 1e6, "as much worse on every pair");
        // Differences 0, 1, 2, 1: mean 1, s² = 2/3, standard error √(1/6).
        let own = [0.1, 1.9, 2.3, 1.5];
        assert!((paired_t(&own, &other) - 6.0f64.sqrt()).abs() < 1e-12);
        assert!((paired_t(&other, &own) + 6.0f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn a_gain_on_every_pair_shows_among_pairs_that_differ_far_more() {
        let hard: Vec<f64> = (0..40).map(|i| 0.01 + 0.02 * f64::from(i)).collect();
        let less: Vec<f64> =
            hard.iter().enumerate().map(|(i, e)| e - 0.002 - 0.001 * (i % 2) as f64).collect();
        let gain = paired_difference(&hard, &less);
        assert!((gain.value + 0.0025).abs() < 1e-12 && !gain.holds(0.0), "{gain:?}");
    }
}
