//! Intervals by resampling: Efron and Tibshirani, "An Introduction to the Bootstrap" (1993), the
//! percentile method.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Resamples.
const DRAWS: usize = 4000;

/// A value and its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Interval {
    pub(crate) value: f64,
    pub(crate) low: f64,
    pub(crate) high: f64,
}

impl Interval {
    /// Whether a difference cannot be told from nothing.
    pub(crate) fn holds(&self, value: f64) -> bool {
        (self.low..=self.high).contains(&value)
    }
}

/// Mean of values that come in groups, each group's mean counting alike, with its interval: groups
/// are drawn with repetition, and values within each. Groups are runs, so that what a run has of
/// its own is part of the doubt.
pub(crate) fn mean(groups: &[Vec<f64>]) -> Option<Interval> {
    if groups.is_empty() || groups.iter().any(Vec::is_empty) {
        return None;
    }
    let of = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let value = of(&groups.iter().map(|group| of(group)).collect::<Vec<_>>());
    let mut random = ChaCha8Rng::seed_from_u64(1); // the page is the same everywhere
    let mut means: Vec<f64> = (0..DRAWS)
        .map(|_| {
            let drawn = groups.iter().map(|_| {
                let group = &groups[random.random_range(0..groups.len())];
                let sum: f64 =
                    group.iter().map(|_| group[random.random_range(0..group.len())]).sum();
                sum / group.len() as f64
            });
            drawn.collect::<Vec<_>>().iter().sum::<f64>() / groups.len() as f64
        })
        .collect();
    means.sort_by(f64::total_cmp);
    let at = |q: f64| means[((DRAWS - 1) as f64 * q).round() as usize];
    Some(Interval { value, low: at(0.025), high: at(0.975) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_interval_of_one_run_is_that_of_its_mean() {
        // 0, 1, …, 99: mean 49.5, standard error 28.9 / 10.
        let interval = mean(&[(0..100).map(f64::from).collect()]).unwrap();
        assert_eq!(interval.value, 49.5);
        assert!((interval.low - (49.5 - 1.96 * 2.887)).abs() < 0.4, "{interval:?}");
        assert!((interval.high - (49.5 + 1.96 * 2.887)).abs() < 0.4, "{interval:?}");
        assert!(interval.holds(45.0) && !interval.holds(60.0));
    }

    #[test]
    fn runs_that_differ_widen_it() {
        let runs: Vec<Vec<f64>> = (0..5).map(|run| vec![f64::from(run); 100]).collect();
        let interval = mean(&runs).unwrap();
        assert_eq!(interval.value, 2.0);
        assert!(interval.low < 1.2 && interval.high > 2.8, "{interval:?}");
        assert_eq!(mean(&runs[..1]).unwrap(), Interval { value: 0.0, low: 0.0, high: 0.0 });
        assert!(mean(&[]).is_none() && mean(&[Vec::new()]).is_none());
    }
}
