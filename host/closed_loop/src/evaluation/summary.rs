//! Summary of parameters on a set of pairs: recall and errors.

use echoloop_statistics::median;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::config::DataConfig;
use crate::cost::{ScanCost, Scanner};
use crate::dataset::ScanPair;
use crate::evaluation::objective::{Bench, PairError, Registered};
use crate::parameters::Parameters;
use crate::seed::{Purpose, derive};
use echoloop_sensors::sensor::SensorError;

/// Recall, errors and cost of parameters on a set of pairs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Number of pairs.
    pub pairs: usize,
    /// Share within the bounds of success, percent.
    pub recall_pct: f64,
    /// Mean e_t over the successes, m; absent without any.
    pub mean_translation_m: Option<f64>,
    /// Mean e_R over the successes, degrees; absent without any.
    pub mean_rotation_deg: Option<f64>,
    /// Median e_t over all pairs, m.
    pub median_translation_m: f64,
    /// Median e_R over all pairs, degrees.
    pub median_rotation_deg: f64,
    /// Mean ‖T_est − T*‖_F over all pairs, not capped.
    pub mean_frobenius: f64,
    /// Mean points of a cloud.
    pub mean_points: f64,
    /// Mean cost of a scan of these pairs, where costs were measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cost: Option<ScanCost>,
    /// Error of every pair.
    pub errors: Vec<PairError>,
}

/// True when a pair is registered: both errors within the bounds of success (Sec. 4.3).
pub fn succeeds(error: &PairError, data: &DataConfig) -> bool {
    error.translation_m <= data.success_translation_m
        && error.rotation_deg <= data.success_rotation_deg
}

impl Summary {
    /// Summary of at least one error.
    pub fn from_errors(errors: Vec<PairError>, data: &DataConfig) -> Self {
        let successes: Vec<&PairError> = errors.iter().filter(|e| succeeds(e, data)).collect();
        let over_successes = |value: fn(&PairError) -> f64| {
            (!successes.is_empty())
                .then(|| successes.iter().map(|e| value(e)).sum::<f64>() / successes.len() as f64)
        };
        let count = errors.len() as f64;
        let mean = |value: fn(&PairError) -> f64| errors.iter().map(value).sum::<f64>() / count;
        Self {
            pairs: errors.len(),
            recall_pct: 100.0 * successes.len() as f64 / count,
            mean_translation_m: over_successes(|e| e.translation_m),
            mean_rotation_deg: over_successes(|e| e.rotation_deg),
            median_translation_m: median(errors.iter().map(|e| e.translation_m)),
            median_rotation_deg: median(errors.iter().map(|e| e.rotation_deg)),
            mean_frobenius: mean(|e| e.frobenius),
            mean_points: mean(|e| (e.points[0] + e.points[1]) as f64 / 2.0),
            cost: None,
            errors,
        }
    }
}

/// Pairs, and the noise that their scans get.
#[derive(Clone, Copy, Debug)]
pub struct NoisyPairs<'a> {
    /// The pairs.
    pub pairs: &'a [ScanPair],
    /// The run's seed.
    pub seed: u64,
    /// Purpose of the registrations; each has noise of its own.
    pub purpose: Purpose,
}

impl NoisyPairs<'_> {
    /// Seed of the noise of one pair.
    pub fn noise_seed(&self, index: usize) -> u64 {
        derive(self.seed, self.purpose, index as u64)
    }
}

/// Registers every pair in parallel; results in the order of the pairs. `done` is called after
/// each.
///
/// # Errors
///
/// [`SensorError`] of the first pair whose sensor failed.
pub fn evaluate(
    bench: &Bench<'_>,
    parameters: &Parameters,
    noisy: &NoisyPairs<'_>,
    done: &(dyn Fn() + Sync),
) -> Result<Vec<PairError>, SensorError> {
    evaluate_with(bench, parameters, noisy, done, &|registered| registered.error)
}

/// Summary of [`evaluate`], with the mean cost of a scan.
///
/// # Errors
///
/// As [`evaluate`].
pub fn evaluate_and_cost(
    bench: &Bench<'_>,
    parameters: &Parameters,
    noisy: &NoisyPairs<'_>,
    scanner: &Scanner,
    data: &DataConfig,
    done: &(dyn Fn() + Sync),
) -> Result<Summary, SensorError> {
    let with_costs = |registered: Registered| {
        let costs = registered.scans.map(|scan| scanner.cost(&parameters.settings, &scan));
        (registered.error, costs)
    };
    let each = evaluate_with(bench, parameters, noisy, done, &with_costs)?;
    let (errors, costs): (Vec<PairError>, Vec<_>) = each.into_iter().unzip();
    let cost = ScanCost::mean(costs.as_flattened());
    Ok(Summary { cost, ..Summary::from_errors(errors, data) })
}

fn evaluate_with<T: Send>(
    bench: &Bench<'_>,
    parameters: &Parameters,
    noisy: &NoisyPairs<'_>,
    done: &(dyn Fn() + Sync),
    keep: &(dyn Fn(Registered) -> T + Sync),
) -> Result<Vec<T>, SensorError> {
    noisy
        .pairs
        .par_iter()
        .enumerate()
        .map(|(index, pair)| {
            let result = bench.register(parameters, index, pair, noisy.noise_seed(index));
            done();
            result.map(keep)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(translation_m: f64, rotation_deg: f64) -> PairError {
        PairError { translation_m, rotation_deg, points: [100, 200], ..PairError::default() }
    }

    #[test]
    fn recall_counts_both_bounds_and_means_leave_failures_out() {
        let errors = vec![error(0.1, 0.1), error(0.3, 0.3), error(0.1, 9.0), error(9.0, 0.1)];
        let summary = Summary::from_errors(errors, &DataConfig::default());
        assert_eq!(summary.recall_pct, 50.0);
        assert!((summary.mean_translation_m.unwrap() - 0.2).abs() < 1e-12);
        assert!((summary.median_translation_m - 0.2).abs() < 1e-12);
        assert_eq!(summary.mean_points, 150.0);
    }

    #[test]
    fn without_a_success_there_is_no_mean() {
        assert_eq!(
            Summary::from_errors(vec![error(9.0, 9.0)], &DataConfig::default()).mean_translation_m,
            None
        );
    }
}
