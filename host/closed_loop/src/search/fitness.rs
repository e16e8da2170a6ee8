//! Fitness of a candidate: its error, and the cost of its scans beside the start's.

use echoloop_statistics::{paired_standard_error, paired_t};

use crate::config::preset::ErrorMean;
use crate::config::{DataConfig, TuneConfig};
use crate::cost::ScanCost;
use crate::evaluation::objective::{PairError, Worth};
use crate::evaluation::summary::succeeds;

/// Result of one registration: its error, and the cost of a scan where costs count.
#[derive(Clone, Debug)]
pub(crate) struct PairResult {
    pub error: PairError,
    pub cost: Option<ScanCost>,
}

/// Exponent of the penalty beyond the error limit: 10 % too much more than doubles the cost.
const BEYOND: f64 = 8.0;

/// Standard errors added to a mean error before it is held to the limit: the cheapest of many
/// candidates near the limit is there by luck.
const SURE: f64 = 1.0;

/// Least number of pairs from which a standard error is estimated.
const LEAST_PAIRS: usize = 10;

/// Penalty factor of a pair that the start registers and a candidate does not.
const LOST: f64 = 10.0;

/// Fitness of candidates, relative to the start where costs count.
pub(super) struct Fitness<'a> {
    pub tune: &'a TuneConfig,
    pub data: &'a DataConfig,
    /// Results, on every pair, of the start; empty where nothing is compared with it.
    pub start: Vec<PairResult>,
    /// Results, on every pair, of the best that was given; empty where that is the start.
    pub given: Vec<PairResult>,
}

impl<'a> Fitness<'a> {
    /// Fitness without anything to compare with.
    pub(super) fn new(tune: &'a TuneConfig, data: &'a DataConfig) -> Self {
        Self { tune, data, start: Vec::new(), given: Vec::new() }
    }

    /// Fitness of errors and of the mean cost of their scans: smaller is better.
    pub(super) fn of(&self, errors: &[PairError], cost: Option<&ScanCost>) -> f64 {
        let worth = Worth::from(self.tune).of(errors);
        let Some((cost, start)) = cost.zip(self.start_cost()) else { return worth };
        match self.tune.minimise {
            Some(kind) => kind.of(cost) / kind.of(&start) * self.penalty(errors, worth),
            None => worth * self.tune.weights.factor(cost, &start),
        }
    }

    /// Loss of one pair, whose mean is the fitness, so that candidates can be compared pair by
    /// pair; `None` where fitness is not a mean of losses.
    pub(super) fn loss(&self, error: &PairError, cost: Option<&ScanCost>) -> Option<f64> {
        self.loss_by(Worth::from(self.tune), error, cost)
    }

    /// The same by ratios, where each pair counts as much as any other.
    pub(super) fn ratio_loss(&self, error: &PairError, cost: Option<&ScanCost>) -> Option<f64> {
        let by_ratio = Worth { mean: ErrorMean::Geometric, ..Worth::from(self.tune) };
        self.loss_by(by_ratio, error, cost)
    }

    fn loss_by(&self, worth: Worth, error: &PairError, cost: Option<&ScanCost>) -> Option<f64> {
        let loss = worth.loss(error);
        match (cost.zip(self.start_cost()), self.tune.minimise) {
            (None, _) => Some(loss),
            (Some(_), Some(_)) => None,
            (Some((cost, start)), None) => {
                Some(worth.times(loss, self.tune.weights.factor(cost, &start)))
            }
        }
    }

    /// True when errors are such that a candidate may not be chosen. Where a cost is minimised:
    /// beyond its limit, to which the penalty shows the way back during the search. Else: by a
    /// standard error more pairs lost than by what was given, or a plain mean that is larger by
    /// one; of what loses more pairs at all, a plain mean that is larger. A mean that few bad pairs
    /// hardly move does not see these; whoever uses the sensor does.
    pub(super) fn is_beyond_the_limit(&self, errors: &[PairError]) -> bool {
        if self.start.is_empty() {
            return false;
        }
        if self.tune.minimise.is_some() {
            return self.penalty(errors, Worth::from(self.tune).of(errors)) > 1.0;
        }
        let given = if self.given.is_empty() { &self.start } else { &self.given };
        let given = on_the_pairs_of(errors, given);
        let plain = Worth { mean: ErrorMean::Arithmetic, cap: self.tune.error_cap };
        let behind = paired_t(&plain.losses(errors), &plain.losses(&given));
        let is_found = |error: &PairError| succeeds(error, self.data);
        let both = errors.iter().zip(&given);
        let differ = both.filter(|(own, given)| is_found(own) != is_found(given)).count();
        let net = self.lost(errors) as f64 - self.lost(&given) as f64;
        // Were each pair that only one of them finds found by either with the same chance, the
        // standard deviation of the difference would be the root of their number.
        net > SURE * (differ as f64).sqrt() || behind > if net > 0.0 { 0.0 } else { SURE }
    }

    fn lost(&self, errors: &[PairError]) -> usize {
        errors.iter().filter(|error| !succeeds(error, self.data)).count()
    }

    /// Penalty factor: 1 within the limit, growing beyond it.
    fn penalty(&self, errors: &[PairError], worth: f64) -> f64 {
        let of_start = on_the_pairs_of(errors, &self.start);
        let more_lost = self.lost(errors).saturating_sub(self.lost(&of_start)) as i32;
        let ratio = self.at_most(errors, &of_start, worth / Worth::from(self.tune).of(&of_start));
        libm::pow((ratio / self.tune.at_most_error).max(1.0), BEYOND) * LOST.powi(more_lost)
    }

    /// Upper bound of the ratio of two means over the same pairs, [`SURE`] standard errors up.
    fn at_most(&self, errors: &[PairError], of_start: &[PairError], ratio: f64) -> f64 {
        if errors.len() < LEAST_PAIRS || errors.len() != of_start.len() {
            return ratio;
        }
        let worth = Worth::from(self.tune);
        let above = SURE * paired_standard_error(&worth.losses(errors), &worth.losses(of_start));
        worth.of_mean_loss(worth.mean_loss(errors) + above) / worth.of(of_start)
    }

    fn start_cost(&self) -> Option<ScanCost> {
        mean_cost(&self.start)
    }
}

/// Errors of results, which are of every pair, on the pairs of these errors.
fn on_the_pairs_of(errors: &[PairError], results: &[PairResult]) -> Vec<PairError> {
    errors.iter().filter_map(|e| Some(results.get(e.pair)?.error.clone())).collect()
}

/// Mean cost of the scans; `None` where none was measured.
pub(crate) fn mean_cost(results: &[PairResult]) -> Option<ScanCost> {
    let costs: Vec<ScanCost> = results.iter().filter_map(|result| result.cost).collect();
    ScanCost::mean(&costs)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cost::CostKind;

    fn error(pair: usize, translation_m: f64) -> PairError {
        PairError { pair, translation_m, frobenius: translation_m, ..PairError::default() }
    }

    fn cost(energy_j: f64) -> Option<ScanCost> {
        Some(ScanCost { energy_j, instructions: 1.0, bits: 1.0, seconds: 1.0 })
    }

    /// The start errs by 1 cm and 4 cm and takes 1 J.
    fn start() -> Vec<PairResult> {
        [0.01, 0.04]
            .into_iter()
            .enumerate()
            .map(|(i, e)| PairResult { error: error(i, e), cost: cost(1.0) })
            .collect()
    }

    fn close(a: f64, b: f64) -> bool {
        (a / b - 1.0).abs() < 1e-9
    }

    #[test]
    fn weighted_a_hundredth_of_the_light_is_worth_a_fifth_of_the_error() {
        let data = DataConfig::default();
        let errors = [error(0, 0.01), error(1, 0.04)];
        for (error_mean, expected) in [
            (ErrorMean::Arithmetic, 0.025),
            (ErrorMean::SquareRoot, 0.0225),
            (ErrorMean::Geometric, 0.02),
        ] {
            let tune = TuneConfig { error_mean, ..TuneConfig::default() };
            let measure = Fitness { start: start(), ..Fitness::new(&tune, &data) };
            let fitness = measure.of(&errors, cost(0.01).as_ref());
            assert!(close(fitness, expected * 0.01f64.powf(0.05)), "{fitness}");
            let losses = errors.iter().filter_map(|e| measure.loss(e, cost(0.01).as_ref()));
            let mean = losses.sum::<f64>() / 2.0;
            let of_losses = Worth::from(&tune).of_mean_loss(mean);
            assert!(close(of_losses, fitness), "the mean of the losses is the fitness");
            assert!(close(measure.of(&errors, None), expected));
        }
    }

    #[test]
    fn the_least_energy_wins_as_long_as_the_error_is_within_the_limit_and_no_pair_is_lost() {
        let (minimise, error_mean) = (Some(CostKind::Energy), ErrorMean::Geometric);
        let tune = TuneConfig { minimise, error_mean, ..TuneConfig::default() };
        let data = DataConfig::default();
        let measure = Fitness { start: start(), ..Fitness::new(&tune, &data) };
        let fitness = |first: f64, second: f64, energy: f64| {
            measure.of(&[error(0, first), error(1, second)], cost(energy).as_ref())
        };
        assert!(close(fitness(0.01, 0.04, 0.1), 0.1));
        assert!(close(fitness(0.001, 0.002, 0.1), 0.1), "what is better is no cheaper");
        assert!(close(fitness(0.0144, 0.04, 0.1), 0.1), "1.2 times as much");
        assert!(fitness(0.02, 0.08, 0.1) > 0.1 * 50.0, "twice as much");
        assert!(fitness(0.0001, 0.6, 0.1) > 0.9, "a pair is lost");
        assert!(measure.is_beyond_the_limit(&[error(0, 0.02), error(1, 0.08)]));
        assert!(measure.is_beyond_the_limit(&[error(0, 0.0001), error(1, 0.6)]));
        assert!(!measure.is_beyond_the_limit(&[error(0, 0.0143), error(1, 0.04)]));
        // Of a batch the start's errors on the same pairs count.
        let second = measure.of(&[error(1, 0.048)], cost(0.1).as_ref());
        assert!(close(second, 0.1), "{second}");
        assert_eq!(measure.loss(&error(0, 0.01), cost(0.1).as_ref()), None);
    }

    #[test]
    fn what_loses_more_pairs_than_the_start_or_errs_more_in_the_mean_may_not_be_chosen() {
        let (tune, data) = (TuneConfig::default(), DataConfig::default());
        // Of 40 pairs the start loses one, which nobody finds.
        let errors = |least: f64, last: f64| -> Vec<PairError> {
            let own = |i: usize| match i {
                0 => 3.0,
                39 => last,
                _ => least * (1.0 + 0.1 * (i % 3) as f64),
            };
            (0..40).map(|i| error(i, own(i))).collect()
        };
        let start = errors(0.01, 0.02).into_iter().map(|error| PairResult { error, cost: None });
        let measure = Fitness { start: start.collect(), ..Fitness::new(&tune, &data) };
        let refused = |least, last| measure.is_beyond_the_limit(&errors(least, last));
        assert!(!refused(0.01, 0.02), "the start itself");
        assert!(!refused(0.005, 0.02));
        assert!(refused(0.0001, 0.6), "a hundredth of the error, and a pair lost");
        assert!(refused(0.011, 0.02), "a tenth more on every pair");
        assert!(!refused(0.009, 0.03), "one that is worse among 38 that are better");
        let nothing = Fitness { start: Vec::new(), ..measure };
        assert!(!nothing.is_beyond_the_limit(&errors(0.1, 0.6)), "nothing to compare with");
        // A start that errs so much that a pair is made up for in the plain mean.
        let start = errors(0.2, 0.2).into_iter().map(|error| PairResult { error, cost: None });
        let measure = Fitness { start: start.collect(), ..nothing };
        let lost = |count: usize| -> Vec<PairError> {
            let own = |(i, _)| error(i, if (1..=count).contains(&i) { 3.0 } else { 0.01 });
            errors(0.0, 0.0).into_iter().enumerate().map(own).collect()
        };
        assert!(!measure.is_beyond_the_limit(&lost(1)), "one lost for one found");
        let found = PairResult { error: error(0, 0.01), cost: None };
        let finds_all = [&[found][..], &measure.start[1..]].concat();
        let of_all = Fitness { start: finds_all, ..measure };
        assert!(!of_all.is_beyond_the_limit(&lost(1)), "one lost, and the plain mean is less");
        assert!(of_all.is_beyond_the_limit(&lost(2)), "two lost that the start finds");
        // Beside a warm start that finds all, the start, which loses as many, is no excuse.
        let of_lost = |count| lost(count).into_iter().map(|error| PairResult { error, cost: None });
        let of_three = Fitness { start: of_lost(3).collect(), ..of_all };
        assert!(!of_three.is_beyond_the_limit(&lost(3)));
        let of_warm = Fitness { given: of_lost(0).collect(), ..of_three };
        assert!(of_warm.is_beyond_the_limit(&lost(3)), "three lost that the warm start finds");
    }

    #[test]
    fn many_pairs_hold_the_error_to_the_limit_with_its_own_doubt() {
        let data = DataConfig::default();
        // Both means are just below 1.2.
        for (mean, low) in [
            (ErrorMean::Geometric, 0.7),
            (ErrorMean::SquareRoot, 0.56),
            (ErrorMean::Arithmetic, 0.35),
        ] {
            let minimise = Some(CostKind::Energy);
            let tune = TuneConfig { minimise, error_mean: mean, ..TuneConfig::default() };
            let start = (0..16).map(|i| PairResult { error: error(i, 0.02), cost: cost(1.0) });
            let measure = Fitness { start: start.collect(), ..Fitness::new(&tune, &data) };
            let fitness = |pairs: usize, factors: [f64; 2]| {
                let own = |i: usize| error(i, 0.02 * factors[i % 2]);
                measure.of(&(0..pairs).map(own).collect::<Vec<_>>(), cost(0.1).as_ref())
            };
            // The same on every pair leaves no doubt; twice as much on half of them and less on the
            // others does, where there are pairs enough to tell.
            assert!(close(fitness(16, [1.19, 1.19]), 0.1), "{mean:?}");
            assert!(close(fitness(8, [2.0, low]), 0.1), "{mean:?}");
            assert!(fitness(16, [2.0, low]) > 0.11, "{mean:?}");
        }
    }
}
