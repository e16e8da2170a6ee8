//! The final selection: finalists compared on all training pairs.
//!
//! A candidate's own fitness comes from few pairs and was picked for being low, so it is biased
//! and only makes the shortlist. Here all finalists see the same pairs with the same noise, a few
//! more at a time, and those significantly behind the leader are eliminated (F-Race: Birattari et
//! al., "A Racing Algorithm for Configuring Metaheuristics", GECCO 2002; here by paired
//! differences). Where registrations fail often, differences stay insignificant for long, so the
//! number that may go on is bounded as well (successive halving: Jamieson and Talwalkar, AISTATS
//! 2016).

use std::cmp;

use echoloop_statistics::paired_t;

use super::batch::Task;
use super::fitness::{Fitness, PairResult, mean_cost};
use super::origin::Origin;
use super::tune_search::Finalist;
use crate::cost::ScanCost;
use crate::evaluation::objective::PairError;
use crate::parameters::{Parameters, Values};
use crate::seed::{Purpose, derive};
use echoloop_sensors::sensor::SensorError;

/// Pairs between two eliminations at least.
const LEG: usize = 5;

/// Registrations between two eliminations at least: few finalists see more pairs at once, so that
/// 16 threads have something to do.
const AT_ONCE: usize = 32;

/// Pairs before the first elimination.
const FIRST_LOOK: usize = 10;

/// Finalists more than this many standard errors behind the leader are eliminated.
const BEHIND: f64 = 2.5;

/// Lead in standard errors that replaces the incumbent. An equal finalist has it by chance in one
/// case of six, the best of several more often. The 1.59 that would correct for three finalists
/// lose more than they keep: the default run then stays at the start's sensor, 0.35 cm with all
/// the light instead of 0.26 cm with a sixth of it.
const AHEAD: f64 = 1.0;

/// (pairs seen, finalists that go on at most).
const GO_ON: [(usize, usize); 3] = [(20, 8), (40, 4), (60, 2)];

/// Evaluates registrations in their order; `None` when interrupted.
pub(super) type Evaluate<'a> =
    dyn Fn(&[Task<'_>]) -> Result<Option<Vec<PairResult>>, SensorError> + Sync + 'a;

/// A finalist.
#[derive(Clone, Debug)]
struct Entry {
    origin: Origin,
    parameters: Parameters,
    /// Results on the first pairs, as many as it has seen.
    results: Vec<PairResult>,
}

/// All finalists with their results. No finalist is evaluated twice on a pair.
pub(super) struct FinalSelection {
    /// Number of pairs.
    pairs: usize,
    /// Seed of the noise of every pair.
    seed: u64,
    entries: Vec<Entry>,
}

impl FinalSelection {
    /// An empty selection on the first `pairs` pairs of a data set.
    pub(super) fn new(pairs: usize, seed: u64) -> Self {
        Self { pairs, seed, entries: Vec::new() }
    }

    /// Adds a finalist and returns its index; a duplicate returns the existing index.
    pub(super) fn enter(&mut self, origin: Origin, parameters: Parameters) -> usize {
        match self.entries.iter().position(|entry| entry.parameters == parameters) {
            Some(index) => index,
            None => {
                self.entries.push(Entry { origin, parameters, results: Vec::new() });
                self.entries.len() - 1
            }
        }
    }

    /// Errors of all registrations made.
    pub(super) fn errors(&self) -> Vec<&PairError> {
        let results = self.entries.iter().flat_map(|entry| &entry.results);
        results.map(|result| &result.error).collect()
    }

    /// Index of the finalist with the lowest fitness over all pairs. The incumbent keeps its place
    /// unless that is more than [`AHEAD`] standard errors ahead ([`Self::ahead`]), or the incumbent
    /// may not be chosen and that may. `None` when interrupted.
    pub(super) fn winner(
        &mut self,
        incumbent: usize,
        mut left: Vec<usize>,
        fitness: &Fitness<'_>,
        evaluate: &Evaluate<'_>,
    ) -> Result<Option<usize>, SensorError> {
        left.push(incumbent);
        let Some(left) = self.raced(left, most_after, fitness, evaluate)? else { return Ok(None) };
        let leader = self.leader(&left, self.pairs, fitness);
        let ahead = self.ahead(leader, incumbent, self.pairs, fitness);
        let [own, best] = [incumbent, leader].map(|i| self.standing(i, self.pairs, fitness).0);
        let stays = own == best && ahead.is_some_and(|ahead| ahead <= AHEAD);
        Ok(Some(if stays { incumbent } else { leader }))
    }

    /// Indices of those that have seen all pairs at the end of a race. After every look those
    /// significantly behind the leader are eliminated, and of the others all but the best that
    /// `most` allows after so many pairs. `None` when interrupted.
    pub(super) fn raced(
        &mut self,
        mut left: Vec<usize>,
        most: fn(usize) -> usize,
        fitness: &Fitness<'_>,
        evaluate: &Evaluate<'_>,
    ) -> Result<Option<Vec<usize>>, SensorError> {
        left.sort_unstable();
        left.dedup();
        let mut seen = FIRST_LOOK.min(self.pairs);
        loop {
            if !self.evaluate(&left, seen, evaluate)? {
                return Ok(None);
            }
            if seen == self.pairs {
                return Ok(Some(left));
            }
            left = self.go_on(&left, most(seen), seen, fitness);
            seen = self.next(&left, seen + LEG);
        }
    }

    /// Pairs that these finalists see next: `least`, or more if that is too little to do.
    fn next(&self, left: &[usize], least: usize) -> usize {
        let missing = |seen: usize| -> usize {
            left.iter().map(|&i| seen.saturating_sub(self.entries[i].results.len())).sum()
        };
        let is_enough = |&seen: &usize| seen >= self.pairs || missing(seen) >= AT_ONCE;
        let next = (least..).step_by(LEG).find(is_enough);
        next.unwrap_or(self.pairs).min(self.pairs)
    }

    /// Evaluates finalists up to `seen` pairs each; false when interrupted.
    fn evaluate(
        &mut self,
        finalists: &[usize],
        seen: usize,
        evaluate: &Evaluate<'_>,
    ) -> Result<bool, SensorError> {
        let mut tasks = Vec::new();
        for &i in finalists {
            let entry = &self.entries[i];
            tasks.extend((entry.results.len()..seen).map(|pair| {
                let noise = derive(self.seed, Purpose::ShortlistNoise, pair as u64);
                (i, Task { parameters: &entry.parameters, pair, noise })
            }));
        }
        let (whose, tasks): (Vec<usize>, Vec<Task<'_>>) = tasks.into_iter().unzip();
        let Some(results) = evaluate(&tasks)? else { return Ok(false) };
        for (i, result) in whose.into_iter().zip(results) {
            self.entries[i].results.push(result);
        }
        Ok(true)
    }

    /// (exceeds the error limit, fitness) of a finalist on the first `seen` pairs.
    fn standing(&self, i: usize, seen: usize, fitness: &Fitness<'_>) -> (bool, f64) {
        let results = &self.entries[i].results[..seen];
        let errors: Vec<PairError> = results.iter().map(|result| result.error.clone()).collect();
        let value = fitness.of(&errors, mean_cost(results).as_ref());
        (fitness.is_beyond_the_limit(&errors), value)
    }

    fn better(&self, a: usize, b: usize, seen: usize, fitness: &Fitness<'_>) -> cmp::Ordering {
        better(self.standing(a, seen, fitness), self.standing(b, seen, fitness))
    }

    /// Index of the best; ties go to the earlier entry.
    fn leader(&self, left: &[usize], seen: usize, fitness: &Fitness<'_>) -> usize {
        let best = left.iter().copied().min_by(|&a, &b| self.better(a, b, seen, fitness));
        best.unwrap_or_default()
    }

    /// Finalists that go on, at most so many; ties go to the earlier entry. One that has seen all
    /// pairs before stays: it costs nothing, and no finalist wins without a comparison with it on
    /// all of them.
    fn go_on(&self, left: &[usize], most: usize, seen: usize, fitness: &Fitness<'_>) -> Vec<usize> {
        let leader = self.leader(left, seen, fitness);
        let (mut stay, mut others): (Vec<usize>, Vec<usize>) =
            left.iter().partition(|&&i| self.entries[i].results.len() == self.pairs);
        others.retain(|&i| self.behind(i, leader, seen, fitness).is_none_or(|b| b <= BEHIND));
        others.sort_by(|&a, &b| self.better(a, b, seen, fitness));
        others.truncate(most);
        stay.append(&mut others);
        stay.sort_unstable();
        stay
    }

    /// Lead of the one with the better fitness in standard errors: by losses, or by ratios where
    /// that is more. A few bad pairs, the same for both, hide by losses that all others are better;
    /// that they are no worse, fitness says.
    pub(super) fn ahead(
        &self,
        leader: usize,
        of: usize,
        seen: usize,
        fitness: &Fitness<'_>,
    ) -> Option<f64> {
        let by_ratio = self.distance(of, leader, seen, |e, cost| fitness.ratio_loss(e, cost))?;
        Some(self.behind(of, leader, seen, fitness)?.max(by_ratio))
    }

    /// Distance behind the leader in standard errors of the paired difference of losses; `None`
    /// where fitness is not a mean of losses.
    pub(super) fn behind(
        &self,
        i: usize,
        leader: usize,
        seen: usize,
        fitness: &Fitness<'_>,
    ) -> Option<f64> {
        self.distance(i, leader, seen, |error, cost| fitness.loss(error, cost))
    }

    /// The same by some loss of each pair.
    fn distance(
        &self,
        i: usize,
        leader: usize,
        seen: usize,
        loss: impl Fn(&PairError, Option<&ScanCost>) -> Option<f64>,
    ) -> Option<f64> {
        let losses = |i: usize| -> Option<Vec<f64>> {
            let results = &self.entries[i].results[..seen];
            let cost = mean_cost(results);
            results.iter().map(|result| loss(&result.error, cost.as_ref())).collect()
        };
        let (own, best) = losses(i).zip(losses(leader))?;
        Some(paired_t(&own, &best))
    }

    /// Indices of the `count` best of those that have seen all pairs and may be chosen, best first.
    pub(super) fn best(&self, count: usize, fitness: &Fitness<'_>) -> Vec<usize> {
        let has_seen_all = |&i: &usize| self.entries[i].results.len() == self.pairs;
        let standings = (0..self.entries.len()).filter(has_seen_all);
        let standings = standings.map(|i| (self.standing(i, self.pairs, fitness), i));
        let mut standings: Vec<_> = standings.filter(|((is_beyond, _), _)| !is_beyond).collect();
        standings.sort_by(|(a, _), (b, _)| better(*a, *b));
        standings.into_iter().map(|(_, i)| i).take(count).collect()
    }

    pub(super) fn origin(&self, i: usize) -> &Origin {
        &self.entries[i].origin
    }

    pub(super) fn parameters(&self, i: usize) -> &Parameters {
        &self.entries[i].parameters
    }

    /// Results of a finalist on each pair that it has seen.
    pub(super) fn results(&self, i: usize) -> &[PairResult] {
        &self.entries[i].results
    }

    /// Records of all finalists, by pairs seen, then by fitness. `values` names the searched
    /// parameters.
    pub(super) fn finalists(
        &self,
        fitness: &Fitness<'_>,
        values: impl Fn(&Parameters) -> Values,
    ) -> Vec<Finalist> {
        let each = self.entries.iter().enumerate();
        let evaluated = each.filter(|(_, entry)| !entry.results.is_empty());
        let mut finalists: Vec<(bool, Finalist)> = evaluated
            .map(|(i, entry)| {
                let pairs = entry.results.len();
                let (is_beyond, fitness) = self.standing(i, pairs, fitness);
                let origin = entry.origin.to_string();
                let values = values(&entry.parameters);
                (is_beyond, Finalist { origin, values, fitness, pairs })
            })
            .collect();
        finalists.sort_by(|(a_beyond, a), (b_beyond, b)| {
            let order = better((*a_beyond, a.fitness), (*b_beyond, b.fitness));
            b.pairs.cmp(&a.pairs).then(order)
        });
        finalists.into_iter().map(|(_, finalist)| finalist).collect()
    }
}

/// Order of two standings: those within the limit first, then by fitness.
fn better(a: (bool, f64), b: (bool, f64)) -> cmp::Ordering {
    a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
}

/// Number of finalists that go on at most after `pairs` pairs.
fn most_after(pairs: usize) -> usize {
    GO_ON.iter().rev().find(|(from, _)| pairs >= *from).map_or(usize::MAX, |&(_, most)| most)
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use crate::parameters::Device;
    use echoloop_random::Generator;

    use super::*;
    use crate::config::{DataConfig, RunConfig, TuneConfig};

    #[test]
    fn the_more_pairs_are_seen_the_fewer_go_on() {
        let most: Vec<usize> = [10, 20, 35, 40, 60, 95].into_iter().map(most_after).collect();
        assert_eq!(most, [usize::MAX, 8, 8, 4, 2, 2]);
    }

    #[test]
    fn a_finalist_as_good_as_the_incumbent_seldom_replaces_it() {
        let mut random = Generator::new(11, 0);
        let mut followed = 0;
        for _ in 0..400 {
            let incumbent = random.normals(100);
            let is_ahead = |other: Vec<f64>| paired_t(&incumbent, &other) > AHEAD;
            followed += usize::from(is_ahead(random.normals(100)));
        }
        // A standard normal variate is above 1 in 16 % of cases.
        assert!((40..90).contains(&followed), "{followed} of 400");
    }

    /// Pairs of a selection that meets every rule.
    const PAIRS: usize = 65;

    /// Parameters told apart by their number of normal neighbours.
    fn finalist(number: u32) -> Parameters {
        let config = RunConfig::default();
        let mut parameters = Parameters::start(&config, &Device::REFERENCE).expect("a start");
        assert!(parameters.set(NUMBER, f64::from(number)));
        parameters
    }

    const NUMBER: &str = "registration.normal_neighbours";

    /// A selection in which a number more adds `step` to the loss, and pairs differ by `spread`.
    struct Staged {
        step: f64,
        spread: f64,
        selection: FinalSelection,
        /// Registrations made at once.
        batches: Vec<usize>,
    }

    impl Staged {
        fn new(step: f64, spread: f64) -> Self {
            Self { step, spread, selection: FinalSelection::new(PAIRS, 1), batches: Vec::new() }
        }

        fn enter(&mut self, numbers: impl IntoIterator<Item = u32>) -> Vec<usize> {
            let enter = |number| self.selection.enter(Origin::Start, finalist(number));
            numbers.into_iter().map(enter).collect()
        }

        fn winner(&mut self, incumbent: usize, finalists: &[usize]) -> usize {
            let (tune, data) = (TuneConfig::default(), DataConfig::default());
            let fitness = Fitness::new(&tune, &data);
            let (step, spread, batches) = (self.step, self.spread, Mutex::new(Vec::new()));
            let evaluate = |tasks: &[Task<'_>]| {
                batches.lock().expect("nothing panics").push(tasks.len());
                let result = |task: &Task<'_>| {
                    let number = task.parameters.get(NUMBER).expect("a number");
                    let own = Generator::from_key([task.noise, number as u64, 0, 0]).normals(1)[0];
                    let frobenius = libm::exp(step * (number - 10.0) - 5.0 + spread * own);
                    let error = PairError { pair: task.pair, frobenius, ..PairError::default() };
                    PairResult { error, cost: None }
                };
                Ok(Some(tasks.iter().map(result).collect()))
            };
            let winner = self.selection.winner(incumbent, finalists.to_vec(), &fitness, &evaluate);
            self.batches.extend(batches.into_inner().expect("nothing panics"));
            winner.expect("a sensor").expect("nobody stops it")
        }

        fn made(&self) -> usize {
            self.batches.iter().sum()
        }

        fn pairs_seen(&self, finalists: &[usize]) -> Vec<usize> {
            finalists.iter().map(|&i| self.selection.results(i).len()).collect()
        }
    }

    #[test]
    fn a_finalist_significantly_behind_is_eliminated_at_the_next_look() {
        // Behind by the spread of the difference, so by √n standard errors or so of n pairs: 2.5
        // are had of 10 pairs as a rule; by a fifth of it, of many more.
        let spread = 0.1;
        let mut staged = Staged::new(spread * std::f64::consts::SQRT_2, spread);
        let finalists = staged.enter([10, 11, 14]);
        assert_eq!(staged.winner(finalists[0], &finalists), finalists[0]);
        assert_eq!(staged.pairs_seen(&finalists), [65, 10, 10]);

        let mut staged = Staged::new(0.3 * spread * std::f64::consts::SQRT_2, spread);
        let finalists = staged.enter([10, 11, 20]);
        assert_eq!(staged.winner(finalists[0], &finalists), finalists[0]);
        let [all, near, far] = staged.pairs_seen(&finalists)[..] else { panic!("three") };
        assert_eq!((all, far), (65, 10));
        assert!(near > 10 && near % LEG == 0, "{near}");
    }

    #[test]
    fn between_two_looks_there_is_work_for_many_threads() {
        let mut staged = Staged::new(0.0, 0.1);
        let finalists = staged.enter([10, 11]);
        staged.winner(finalists[0], &finalists);
        // Both see 10, 30, 50 and 65 pairs.
        assert_eq!(staged.batches, [20, 40, 40, 30]);
        // Who comes later sees more at once, as the others are done.
        let later = staged.enter([12]);
        staged.winner(finalists[0], &later);
        assert_eq!(staged.batches[4..], [10, 35, 20]);
    }

    #[test]
    fn without_significant_differences_the_number_that_go_on_is_bounded() {
        let mut staged = Staged::new(0.0, 1.0);
        let finalists = staged.enter(10..22);
        staged.winner(finalists[0], &finalists);
        let seen = staged.pairs_seen(&finalists);
        // Of a dozen that are alike one or two fall out by chance besides.
        let beyond = |pairs: usize| seen.iter().filter(|&&seen| seen > pairs).count();
        assert_eq!([20, 40, 60].map(beyond), [8, 4, 2], "{seen:?}");
    }

    #[test]
    fn a_finalist_that_has_seen_all_pairs_stays_and_is_not_evaluated_again() {
        let mut staged = Staged::new(0.2, 0.1);
        let worst = staged.enter([30])[0];
        assert_eq!(staged.winner(worst, &[]), worst);
        assert_eq!(staged.made(), PAIRS);
        let others = staged.enter([10, 20]);
        assert_eq!(staged.winner(worst, &others), others[0]);
        assert_eq!(staged.pairs_seen(&others), [65, 10]);
        assert_eq!(staged.made(), 2 * PAIRS + 10);
        // Equal parameters are one finalist.
        assert_eq!(staged.enter([30, 10]), [worst, others[0]]);
    }

    #[test]
    fn the_incumbent_stays_unless_another_is_ahead_by_a_standard_error() {
        let (tune, data) = (TuneConfig::default(), DataConfig::default());
        let fitness = Fitness::new(&tune, &data);
        // Of 65 pairs the mean of a difference of 0.17 times its own spread is 1.4 standard errors.
        let spread = 0.1;
        for (step, ahead, followed) in [(0.17, 1.0..2.0, true), (0.07, 0.1..1.0, false)] {
            let mut staged = Staged::new(step * spread * std::f64::consts::SQRT_2, spread);
            let [best, incumbent] = staged.enter([10, 11])[..] else { panic!("two") };
            let winner = staged.winner(incumbent, &[best]);
            let behind = staged.selection.behind(incumbent, best, PAIRS, &fitness).expect("a mean");
            assert!(ahead.contains(&behind), "{behind}: else this tests nothing");
            assert_eq!(winner, if followed { best } else { incumbent });
        }
    }

    #[test]
    fn a_gain_that_a_few_bad_pairs_hide_by_losses_shows_by_ratios() {
        // Ten pairs are bad for both, now more for one, now for the other; on the others the second
        // has four fifths of the error.
        let mut selection = FinalSelection::new(PAIRS, 1);
        for (number, factor, phase) in [(10, 1.0, 0), (11, 0.8, 1)] {
            let i = selection.enter(Origin::Start, finalist(number));
            let frobenius = |pair: usize| match pair {
                0..10 => [0.5, 0.9][(pair + phase) % 2],
                _ => 0.01 * factor,
            };
            let error =
                |pair| PairError { pair, frobenius: frobenius(pair), ..PairError::default() };
            let results = (0..PAIRS).map(|pair| PairResult { error: error(pair), cost: None });
            selection.entries[i].results = results.collect();
        }
        let (tune, data) = (TuneConfig::default(), DataConfig::default());
        let fitness = Fitness::new(&tune, &data);
        let by_losses = selection.behind(0, 1, PAIRS, &fitness).expect("a mean");
        let ahead = selection.ahead(1, 0, PAIRS, &fitness).expect("a mean");
        assert!((0.0..AHEAD).contains(&by_losses), "{by_losses}");
        assert!(ahead > 2.0, "{ahead}");
        // Those that have seen all pairs, best first.
        assert_eq!(selection.best(3, &fitness), [1, 0]);
        selection.entries[1].results.pop();
        assert_eq!(selection.best(3, &fitness), [0]);
    }
}
