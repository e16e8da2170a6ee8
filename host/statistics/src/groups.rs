//! Mean of values that come in groups, as the pairs of several runs.

use echoloop_random::Generator;

use crate::{Estimate, mean, quantile, standard_error};

/// Resamples.
const DRAWS: usize = 4000;

/// 97.5 % quantiles of Student's t, for 2 to 9 degrees of freedom.
const STUDENT: [f64; 8] = [4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262];

/// Mean of the groups' means with its 95 % interval: groups are drawn with repetition, and values
/// within each. `None` where there is no group, or an empty one.
///
/// Groups are runs, so the interval has in it what one run differs by from another. Resamples of n
/// runs vary by (n − 1)/n of what the runs do, so with three groups or more the interval is at
/// least as wide as Student's over their means. With two it is the bootstrap's alone.
pub fn mean_of_groups(groups: &[Vec<f64>]) -> Option<Estimate> {
    if groups.is_empty() || groups.iter().any(Vec::is_empty) {
        return None;
    }
    let own: Vec<f64> = groups.iter().map(|group| mean(group)).collect();
    let value = mean(&own);
    let mut random = Generator::new(1, 0);
    let mut means: Vec<f64> = (0..DRAWS)
        .map(|_| {
            let drawn = groups.iter().map(|_| {
                let group = &groups[random.index(groups.len())];
                let sum: f64 = group.iter().map(|_| group[random.index(group.len())]).sum();
                sum / group.len() as f64
            });
            mean(&drawn.collect::<Vec<_>>())
        })
        .collect();
    means.sort_by(f64::total_cmp);
    let half = student(&own).unwrap_or(0.0);
    let [low, high] = [0.025, 0.975].map(|share| quantile(&means, share));
    Some(Estimate { value, interval: [low.min(value - half), high.max(value + half)] })
}

/// Half of Student's interval of the mean of a few values; `None` of fewer than three.
fn student(values: &[f64]) -> Option<f64> {
    let place = values.len().checked_sub(3)?;
    let quantile = STUDENT.get(place).or(STUDENT.last())?;
    Some(quantile * standard_error(values))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_interval_of_one_run_is_that_of_its_mean() {
        // 0, 1, …, 99: mean 49.5, standard error 28.9 / 10.
        let estimate = mean_of_groups(&[(0..100).map(f64::from).collect()]).unwrap();
        assert_eq!(estimate.value, 49.5);
        let [low, high] = estimate.interval;
        assert!((low - (49.5 - 1.96 * 2.887)).abs() < 0.4, "{estimate:?}");
        assert!((high - (49.5 + 1.96 * 2.887)).abs() < 0.4, "{estimate:?}");
        assert!(estimate.holds(45.0) && !estimate.holds(60.0));
    }

    #[test]
    fn runs_that_differ_widen_it() {
        let runs: Vec<Vec<f64>> = (0..5).map(|run| vec![f64::from(run); 100]).collect();
        let five = mean_of_groups(&runs).unwrap();
        assert_eq!(five.value, 2.0);
        // Means 0 to 4: deviation √2.5, of their mean √0.5; Student's t of 4 degrees 2.776.
        let half = 2.776 * 0.5f64.sqrt();
        assert!((five.interval[0] - (2.0 - half)).abs() < 1e-9, "{five:?}");
        assert!((five.interval[1] - (2.0 + half)).abs() < 1e-9, "{five:?}");
        // Of two, what resampling gives.
        assert_eq!(mean_of_groups(&runs[..2]).unwrap().interval, [0.0, 1.0]);
        assert_eq!(
            mean_of_groups(&runs[..1]).unwrap(),
            Estimate { value: 0.0, interval: [0.0; 2] }
        );
        // Runs that agree are in no less doubt than their values.
        let alike = mean_of_groups(&vec![(0..100).map(f64::from).collect(); 5]).unwrap();
        assert!(alike.interval[1] - alike.interval[0] > 4.0, "{alike:?}");
        assert!(mean_of_groups(&[]).is_none() && mean_of_groups(&[Vec::new()]).is_none());
    }
}
