//! Gain of tuning on pairs that both sets of parameters were evaluated on, and its significance.

use serde::Serialize;

use crate::config::DataConfig;
use crate::evaluation::objective::PairError;
use crate::evaluation::summary::{Summary, succeeds};
pub use echoloop_statistics::Estimate;
use echoloop_statistics::{median, sign_test, wilson};

/// Fewest pairs that can be significant: all five of five agree by chance in 1 of 16 cases
/// (sign test, two-sided).
const FEWEST: usize = 6;

/// Significance level of the sign test.
const LEVEL: f64 = 0.05;

/// Difference of a figure between two sets of parameters on the same pairs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Difference {
    /// Second minus first, with its interval by bootstrap over pairs.
    #[serde(flatten)]
    pub estimate: Estimate,
    /// True when significant: the interval leaves zero out, there are at least six pairs, and for
    /// recall McNemar's exact test agrees (a bootstrap of few changed pairs is too narrow).
    pub is_shown: bool,
}

/// The figures of one set of parameters, or the differences of two.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Figures<T> {
    /// Share of successes, percent.
    pub recall_pct: T,
    /// Mean e_t over the successes, m.
    pub mean_translation_m: T,
    /// Mean e_R over the successes, degrees.
    pub mean_rotation_deg: T,
    /// Median e_t over all pairs, m.
    pub median_translation_m: T,
    /// Median e_R over all pairs, degrees.
    pub median_rotation_deg: T,
}

/// A figure of some of a summary's pairs, by index; an index may be repeated.
type Statistic = fn(&Judged<'_>, &[usize]) -> f64;

/// Pairs, and the bounds of success.
struct Judged<'a> {
    errors: &'a [PairError],
    data: &'a DataConfig,
}

impl Judged<'_> {
    fn succeeds(&self, i: usize) -> bool {
        succeeds(&self.errors[i], self.data)
    }

    fn mean_over_successes(&self, drawn: &[usize], value: fn(&PairError) -> f64) -> f64 {
        let (mut sum, mut count) = (0.0, 0.0);
        for &i in drawn.iter().filter(|&&i| self.succeeds(i)) {
            sum += value(&self.errors[i]);
            count += 1.0;
        }
        sum / count
    }

    fn median_of(&self, drawn: &[usize], value: fn(&PairError) -> f64) -> f64 {
        median(drawn.iter().map(|&i| value(&self.errors[i])))
    }

    fn estimate(&self, statistic: Statistic) -> Estimate {
        Estimate::by_bootstrap(self.errors.len(), &|drawn| statistic(self, drawn))
    }

    fn recall(&self) -> Estimate {
        let value = RECALL(self, &(0..self.errors.len()).collect::<Vec<_>>());
        let interval = wilson(value / 100.0, self.errors.len() as f64).map(|end| 100.0 * end);
        Estimate { value, interval }
    }
}

const RECALL: Statistic = |judged, drawn| {
    let found = drawn.iter().filter(|&&i| judged.succeeds(i)).count();
    100.0 * found as f64 / drawn.len() as f64
};
const MEAN_TRANSLATION: Statistic =
    |judged, drawn| judged.mean_over_successes(drawn, |error| error.translation_m);
const MEAN_ROTATION: Statistic =
    |judged, drawn| judged.mean_over_successes(drawn, |error| error.rotation_deg);
const MEDIAN_TRANSLATION: Statistic =
    |judged, drawn| judged.median_of(drawn, |error| error.translation_m);
const MEDIAN_ROTATION: Statistic =
    |judged, drawn| judged.median_of(drawn, |error| error.rotation_deg);

impl Figures<Estimate> {
    /// Figures of a summary: recall with Wilson's interval, the others with percentiles of a
    /// bootstrap over pairs (Efron and Tibshirani 1993, Ch. 13).
    pub fn of(summary: &Summary, data: &DataConfig) -> Self {
        let judged = Judged { errors: &summary.errors, data };
        Self {
            recall_pct: judged.recall(),
            mean_translation_m: judged.estimate(MEAN_TRANSLATION),
            mean_rotation_deg: judged.estimate(MEAN_ROTATION),
            median_translation_m: judged.estimate(MEDIAN_TRANSLATION),
            median_rotation_deg: judged.estimate(MEDIAN_ROTATION),
        }
    }
}

impl Figures<Difference> {
    /// Figures of the second summary minus those of the first, over the same pairs in the same
    /// order.
    pub fn between(first: &Summary, second: &Summary, data: &DataConfig) -> Self {
        let pair = [first, second].map(|summary| Judged { errors: &summary.errors, data });
        let count = first.errors.len().min(second.errors.len());
        let difference = |statistic| difference(&pair, count, statistic);
        let mut recall_pct = difference(RECALL);
        recall_pct.is_shown &= mcnemar(&pair, count) < LEVEL;
        Self {
            recall_pct,
            mean_translation_m: difference(MEAN_TRANSLATION),
            mean_rotation_deg: difference(MEAN_ROTATION),
            median_translation_m: difference(MEDIAN_TRANSLATION),
            median_rotation_deg: difference(MEDIAN_ROTATION),
        }
    }
}

fn difference(pair: &[Judged<'_>; 2], count: usize, statistic: Statistic) -> Difference {
    let of = |drawn: &[usize]| statistic(&pair[1], drawn) - statistic(&pair[0], drawn);
    let estimate = Estimate::by_bootstrap(count, &of);
    let [low, high] = estimate.interval;
    Difference { estimate, is_shown: count >= FEWEST && (low > 0.0 || high < 0.0) }
}

fn mcnemar([first, second]: &[Judged<'_>; 2], count: usize) -> f64 {
    let changed = |from: &Judged<'_>, to: &Judged<'_>| {
        (0..count).filter(|&i| !from.succeeds(i) && to.succeeds(i)).count()
    };
    sign_test(changed(first, second), changed(second, first))
}

#[cfg(test)]
mod tests {
    use super::*;
    use echoloop_random::Generator;

    fn summary(errors_m: &[f64]) -> Summary {
        let error = |&translation_m: &f64| {
            let rotation_deg = 10.0 * translation_m;
            PairError { translation_m, rotation_deg, ..PairError::default() }
        };
        Summary::from_errors(errors_m.iter().map(error).collect(), &DataConfig::default())
    }

    fn between(first: &[f64], second: &[f64]) -> Figures<Difference> {
        Figures::between(&summary(first), &summary(second), &DataConfig::default())
    }

    #[test]
    fn figures_are_those_of_the_summary_each_within_its_interval() {
        let mut random = Generator::new(7, 0);
        let errors: Vec<f64> = (0..40).map(|_| 0.2 * random.unit()).chain([9.0; 4]).collect();
        let summary = summary(&errors);
        let figures = Figures::of(&summary, &DataConfig::default());
        let pairs = [
            (figures.recall_pct, summary.recall_pct),
            (figures.mean_translation_m, summary.mean_translation_m.unwrap()),
            (figures.mean_rotation_deg, summary.mean_rotation_deg.unwrap()),
            (figures.median_translation_m, summary.median_translation_m),
            (figures.median_rotation_deg, summary.median_rotation_deg),
        ];
        for (Estimate { value, interval: [low, high] }, expected) in pairs {
            assert!((value - expected).abs() < 1e-12 && low < value && value < high);
        }
    }

    #[test]
    fn a_gain_on_every_pair_is_shown_and_mere_noise_is_not() {
        let mut random = Generator::new(5, 0);
        let before: Vec<f64> = (0..40).map(|_| 0.02 + 0.1 * random.unit()).collect();
        let better: Vec<f64> = before.iter().map(|e| 0.8 * e).collect();
        let gain = between(&before, &better);
        assert!(gain.mean_translation_m.is_shown && gain.mean_translation_m.estimate.value < 0.0);
        assert!(gain.mean_rotation_deg.is_shown && gain.median_translation_m.is_shown);
        assert!(!gain.recall_pct.is_shown, "all succeed both times");
        let loss = between(&better, &before);
        assert!(loss.mean_translation_m.is_shown && loss.mean_translation_m.estimate.value > 0.0);
        let shown = |random: &mut Generator| {
            let noise: Vec<f64> = before.iter().map(|e| e + 0.02 * random.normals(1)[0]).collect();
            between(&before, &noise).mean_translation_m.is_shown
        };
        let wrong = (0..100).filter(|_| shown(&mut random)).count();
        assert!(wrong <= 14, "{wrong} of 100 chances are taken for gains, 5 should be");
    }

    #[test]
    fn few_pairs_prove_nothing_however_they_fall() {
        assert!(!between(&[0.1; 5], &[0.05; 5]).mean_translation_m.is_shown);
        assert!(between(&[0.1; 6], &[0.05; 6]).mean_translation_m.is_shown);
        // Four of 40 found: the bootstrap leaves zero out, the exact test (1 in 8) does not.
        let before: Vec<f64> = [9.0; 4].into_iter().chain([0.1; 36]).collect();
        let gain = between(&before, &[0.1; 40]).recall_pct;
        assert!(gain.estimate.interval[0] > 0.0 && !gain.is_shown, "{gain:?}");
        let before: Vec<f64> = [9.0; 6].into_iter().chain([0.1; 34]).collect();
        assert!(between(&before, &[0.1; 40]).recall_pct.is_shown);
    }

    #[test]
    fn without_a_success_there_is_no_mean_and_nothing_shown() {
        let gain = between(&[9.0; 8], &[0.1; 8]);
        assert!(gain.mean_translation_m.estimate.value.is_nan());
        assert!(!gain.mean_translation_m.is_shown && gain.recall_pct.is_shown);
    }
}
