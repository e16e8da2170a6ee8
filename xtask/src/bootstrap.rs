//! Intervals by resampling: Efron and Tibshirani, "An Introduction to the Bootstrap" (1993), the
//! percentile method; and by Student's t where few runs differ by more than resampling them shows.

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

/// The 97.5 % quantiles of Student's t of 2 to 9 degrees of freedom.
const STUDENT: [f64; 8] = [4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262];

/// Mean of values that come in groups, each group's mean counting alike, with its interval: groups
/// are drawn with repetition, and values within each. Groups are runs, so that what a run has of
/// its own is part of the doubt. Resampled, n runs vary by (n − 1)/n of what they do, and their
/// deviation is known no better than n tells: of three or more the interval is as wide at either
/// end as Student's over their means, if that is wider. Of two it is the bootstrap's alone.
pub(crate) fn mean(groups: &[Vec<f64>]) -> Option<Interval> {
    if groups.is_empty() || groups.iter().any(Vec::is_empty) {
        return None;
    }
    let of = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let own: Vec<f64> = groups.iter().map(|group| of(group)).collect();
    let value = of(&own);
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
    let half = student(&own, value).unwrap_or(0.0);
    Some(Interval { value, low: at(0.025).min(value - half), high: at(0.975).max(value + half) })
}

/// Half of Student's interval of a mean of few values; `None` of fewer than three.
fn student(values: &[f64], mean: f64) -> Option<f64> {
    let freedom = values.len().checked_sub(1)?;
    let quantile = STUDENT[..].get(freedom.checked_sub(2)?).or(STUDENT.last())?;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    Some(quantile * (squares / freedom as f64 / values.len() as f64).sqrt())
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
        // Means 0 to 4: deviation √2.5, of their mean √0.5; Student's t of 4 degrees 2.776.
        let half = 2.776 * 0.5f64.sqrt();
        assert!((interval.low - (2.0 - half)).abs() < 1e-9, "{interval:?}");
        assert!((interval.high - (2.0 + half)).abs() < 1e-9, "{interval:?}");
        // Of two, what resampling gives.
        let two = mean(&runs[..2]).unwrap();
        assert_eq!((two.low, two.high), (0.0, 1.0));
        assert_eq!(mean(&runs[..1]).unwrap(), Interval { value: 0.0, low: 0.0, high: 0.0 });
        // Runs that agree are in no less doubt than their values.
        let alike: Vec<Vec<f64>> = vec![(0..100).map(f64::from).collect(); 5];
        let alike = mean(&alike).unwrap();
        assert!(alike.high - alike.low > 4.0, "{alike:?}");
        assert!(mean(&[]).is_none() && mean(&[Vec::new()]).is_none());
    }
}
