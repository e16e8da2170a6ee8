//! The choice: those who could win, on all training pairs.
//!
//! A candidate's own fitness saw few pairs and was picked for being low, so it flatters: it only
//! makes the shortlist. In the race all see the same pairs with the same noise, some more at a
//! time, and who is behind the leader beyond doubt falls out (F-Race: Birattari et al., "A Racing
//! Algorithm for Configuring Metaheuristics", GECCO 2002; here by paired differences). Where
//! registrations fail often nobody is behind beyond doubt for long, so the farther the race the
//! fewer may go on (successive halving: Jamieson and Talwalkar, AISTATS 2016).

use std::cmp;

use super::batch::Task;
use super::fitness::{Judged, Price, mean_cost, standard_error};
use super::origin::Origin;
use super::tune_search::Finalist;
use crate::evaluation::objective::PairError;
use crate::parameters::{Parameters, Values};
use crate::seed::{Purpose, derive};
use echoloop_sensors::sensor::SensorError;

/// Pairs that all who are left are judged on before anybody falls out, and between two looks.
const LEG: usize = 5;

/// Pairs before the first look.
const FIRST_LOOK: usize = 10;

/// Who is so many standard errors behind the leader falls out.
const BEHIND: f64 = 2.5;

/// Who is to follow the holder must be so many standard errors ahead of it: one that is as good is
/// so by chance in a case of six, the best of several oftener. To ask of three the 1.59 that make
/// up for it loses more than it keeps: the default run then stays with the sensor of the start, for
/// 0.35 cm with all the light instead of 0.26 with a sixth of it.
const AHEAD: f64 = 1.0;

/// How many go on at most once so many pairs have been seen.
const GO_ON: [(usize, usize); 3] = [(20, 8), (40, 4), (60, 2)];

/// Makes registrations, in their order; `None` when the search is to stop.
pub(super) type Judge<'a> =
    dyn Fn(&[Task<'_>]) -> Result<Option<Vec<Judged>>, SensorError> + Sync + 'a;

/// One who could win.
#[derive(Clone, Debug)]
struct Runner {
    origin: Origin,
    parameters: Parameters,
    /// On the first pairs, as many as it has seen.
    judged: Vec<Judged>,
}

/// All who were ever entered, with what is known of them: nobody is judged twice on a pair.
pub(super) struct Race {
    /// Training pairs.
    all: usize,
    /// Of the run: the noise of every pair is made of it.
    seed: u64,
    runners: Vec<Runner>,
}

impl Race {
    pub(super) fn new(all: usize, seed: u64) -> Self {
        Self { all, seed, runners: Vec::new() }
    }

    /// Enters parameters; of those that are in already the number they have.
    pub(super) fn enter(&mut self, origin: Origin, parameters: Parameters) -> usize {
        match self.runners.iter().position(|runner| runner.parameters == parameters) {
            Some(number) => number,
            None => {
                self.runners.push(Runner { origin, parameters, judged: Vec::new() });
                self.runners.len() - 1
            }
        }
    }

    /// How each registration came out.
    pub(super) fn errors(&self) -> Vec<&PairError> {
        let judged = self.runners.iter().flat_map(|runner| &runner.judged);
        judged.map(|judged| &judged.error).collect()
    }

    /// The best of some on all training pairs, by number; `None` when the search is to stop. The
    /// holder, who won a race before, stays unless another is ahead of it.
    pub(super) fn winner(
        &mut self,
        holder: usize,
        mut left: Vec<usize>,
        price: &Price<'_>,
        judge: &Judge<'_>,
    ) -> Result<Option<usize>, SensorError> {
        left.push(holder);
        left.sort_unstable();
        left.dedup();
        let mut seen = FIRST_LOOK.min(self.all);
        loop {
            if !self.judge(&left, seen, judge)? {
                return Ok(None);
            }
            let leader = self.leader(&left, seen, price);
            if seen == self.all {
                let behind = self.behind(holder, leader, seen, price);
                let stays = behind.is_some_and(|behind| behind <= AHEAD);
                return Ok(Some(if stays { holder } else { leader }));
            }
            left = self.go_on(&left, leader, seen, price);
            seen = (seen + LEG).min(self.all);
        }
    }

    /// Sees to it that all of some have been judged on the first pairs; false: interrupted.
    fn judge(
        &mut self,
        some: &[usize],
        seen: usize,
        judge: &Judge<'_>,
    ) -> Result<bool, SensorError> {
        let mut tasks = Vec::new();
        for &i in some {
            let runner = &self.runners[i];
            tasks.extend((runner.judged.len()..seen).map(|pair| {
                let noise = derive(self.seed, Purpose::ShortlistNoise, pair as u64);
                (i, Task { parameters: &runner.parameters, pair, noise })
            }));
        }
        let (whose, tasks): (Vec<usize>, Vec<Task<'_>>) = tasks.into_iter().unzip();
        let Some(judged) = judge(&tasks)? else { return Ok(false) };
        for (i, judged) in whose.into_iter().zip(judged) {
            self.runners[i].judged.push(judged);
        }
        Ok(true)
    }

    /// Whether one is beyond the limit, where there is one, and its fitness.
    fn standing(&self, i: usize, seen: usize, price: &Price<'_>) -> (bool, f64) {
        let judged = &self.runners[i].judged[..seen];
        let errors: Vec<PairError> = judged.iter().map(|judged| judged.error.clone()).collect();
        let fitness = price.fitness(&errors, mean_cost(judged).as_ref());
        (price.is_beyond_the_limit(&errors), fitness)
    }

    fn better(&self, a: usize, b: usize, seen: usize, price: &Price<'_>) -> cmp::Ordering {
        better(self.standing(a, seen, price), self.standing(b, seen, price))
    }

    /// The best; of equals the first.
    fn leader(&self, left: &[usize], seen: usize, price: &Price<'_>) -> usize {
        let best = left.iter().copied().min_by(|&a, &b| self.better(a, b, seen, price));
        best.unwrap_or_default()
    }

    /// Those who go on: of equals the first that were entered. Who has seen all pairs before stays:
    /// it costs nothing, and nobody wins who was not compared with it on all of them.
    fn go_on(&self, left: &[usize], leader: usize, seen: usize, price: &Price<'_>) -> Vec<usize> {
        let (mut stay, mut others): (Vec<usize>, Vec<usize>) =
            left.iter().partition(|&&i| self.runners[i].judged.len() == self.all);
        others.retain(|&i| self.behind(i, leader, seen, price).is_none_or(|b| b <= BEHIND));
        others.sort_by(|&a, &b| self.better(a, b, seen, price));
        others.truncate(most_after(seen));
        stay.append(&mut others);
        stay.sort_unstable();
        stay
    }

    /// By how many standard errors one is behind the leader, by the paired differences of losses;
    /// `None` where fitness is no mean of losses.
    pub(super) fn behind(
        &self,
        i: usize,
        leader: usize,
        seen: usize,
        price: &Price<'_>,
    ) -> Option<f64> {
        let losses = |i: usize| -> Option<Vec<f64>> {
            let judged = &self.runners[i].judged[..seen];
            let cost = mean_cost(judged);
            judged.iter().map(|judged| price.loss(&judged.error, cost.as_ref())).collect()
        };
        let (own, best) = losses(i).zip(losses(leader))?;
        Some(standard_errors_behind(&own, &best))
    }

    pub(super) fn origin(&self, i: usize) -> &Origin {
        &self.runners[i].origin
    }

    pub(super) fn parameters(&self, i: usize) -> &Parameters {
        &self.runners[i].parameters
    }

    /// How one came out on each pair that it has seen.
    pub(super) fn judged(&self, i: usize) -> &[Judged] {
        &self.runners[i].judged
    }

    /// All who were judged: those first that saw most pairs, the best of them first. `values` names
    /// what was searched.
    pub(super) fn finalists(
        &self,
        price: &Price<'_>,
        values: impl Fn(&Parameters) -> Values,
    ) -> Vec<Finalist> {
        let each = self.runners.iter().enumerate();
        let judged = each.filter(|(_, runner)| !runner.judged.is_empty());
        let mut finalists: Vec<(bool, Finalist)> = judged
            .map(|(i, runner)| {
                let pairs = runner.judged.len();
                let (is_beyond, fitness) = self.standing(i, pairs, price);
                let origin = runner.origin.to_string();
                let values = values(&runner.parameters);
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

/// Whose standing is better comes first: who is within the limit, and of these the fitter.
fn better(a: (bool, f64), b: (bool, f64)) -> cmp::Ordering {
    a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
}

/// How many go on at most after so many pairs.
fn most_after(pairs: usize) -> usize {
    GO_ON.iter().rev().find(|(from, _)| pairs >= *from).map_or(usize::MAX, |&(_, most)| most)
}

/// The mean of the paired differences of two's losses, in its own standard errors: infinite where
/// every pair says the same, 0 of two that never differ.
fn standard_errors_behind(own: &[f64], best: &[f64]) -> f64 {
    let differences = own.iter().zip(best).map(|(a, b)| a - b);
    let mean = differences.sum::<f64>() / own.len() as f64;
    if mean == 0.0 { 0.0 } else { mean / standard_error(own, best) }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use echoloop_dsp::Hardware;
    use echoloop_random::Generator;

    use super::*;
    use crate::config::{DataConfig, RunConfig, TuneConfig};

    #[test]
    fn the_farther_the_race_the_fewer_go_on() {
        let most: Vec<usize> = [10, 20, 35, 40, 60, 95].into_iter().map(most_after).collect();
        assert_eq!(most, [usize::MAX, 8, 8, 4, 2, 2]);
    }

    #[test]
    fn who_is_behind_by_so_many_standard_errors_is_so_pair_by_pair() {
        let best = [0.1, 0.9, 0.3, 0.5];
        assert_eq!(standard_errors_behind(&best, &best), 0.0);
        let worse = best.map(|loss| loss + 0.125);
        assert!(standard_errors_behind(&worse, &best) > 1e6, "as much behind on every pair");
        assert!(standard_errors_behind(&best, &worse) < -1e6);
        // Differences 1, -1, 1, 3: mean 1, standard deviation √(8/3), of the mean √(2/3).
        let own = [1.1, -0.1, 1.3, 3.5];
        let best = [0.1, 0.9, 0.3, 0.5];
        let expected = 1.0 / (2.0f64 / 3.0).sqrt();
        assert!((standard_errors_behind(&own, &best) - expected).abs() < 1e-12);
    }

    #[test]
    fn one_that_is_as_good_as_the_holder_is_seldom_followed() {
        let mut random = Generator::new(11, 0);
        let mut followed = 0;
        for _ in 0..400 {
            let holder = random.normals(100);
            let is_ahead = |other: Vec<f64>| standard_errors_behind(&holder, &other) > AHEAD;
            followed += usize::from(is_ahead(random.normals(100)));
        }
        // A standard normal variate is above 1 in 16 % of cases.
        assert!((40..90).contains(&followed), "{followed} of 400");
    }

    /// Training pairs of a race that comes to every rule.
    const PAIRS: usize = 65;

    /// One with so many normal neighbours, by which it is known here.
    fn runner(number: u32) -> Parameters {
        let config = RunConfig::default();
        let mut parameters = Parameters::start(&config, &Hardware::REFERENCE).expect("a start");
        assert!(parameters.set(NUMBER, f64::from(number)));
        parameters
    }

    const NUMBER: &str = "registration.normal_neighbours";

    /// A race in which every number more is so much more loss, and every pair differs by so much.
    struct Staged {
        step: f64,
        spread: f64,
        race: Race,
        made: usize,
    }

    impl Staged {
        fn new(step: f64, spread: f64) -> Self {
            Self { step, spread, race: Race::new(PAIRS, 1), made: 0 }
        }

        fn enter(&mut self, numbers: impl IntoIterator<Item = u32>) -> Vec<usize> {
            let enter = |number| self.race.enter(Origin::Start, runner(number));
            numbers.into_iter().map(enter).collect()
        }

        fn winner(&mut self, holder: usize, runners: &[usize]) -> usize {
            let (tune, data) = (TuneConfig::default(), DataConfig::default());
            let price = Price { tune: &tune, data: &data, start: Vec::new() };
            let (step, spread, made) = (self.step, self.spread, AtomicUsize::new(0));
            let judge = |tasks: &[Task<'_>]| {
                made.fetch_add(tasks.len(), Ordering::Relaxed);
                let judged = |task: &Task<'_>| {
                    let number = task.parameters.get(NUMBER).expect("a number");
                    let own = Generator::from_key([task.noise, number as u64, 0, 0]).normals(1)[0];
                    let frobenius = libm::exp(step * (number - 10.0) - 5.0 + spread * own);
                    Judged { error: PairError { frobenius, ..error(task.pair) }, cost: None }
                };
                Ok(Some(tasks.iter().map(judged).collect()))
            };
            let winner = self.race.winner(holder, runners.to_vec(), &price, &judge);
            self.made += made.into_inner();
            winner.expect("a sensor").expect("nobody stops it")
        }

        fn pairs_seen(&self, runners: &[usize]) -> Vec<usize> {
            runners.iter().map(|&i| self.race.judged(i).len()).collect()
        }
    }

    fn error(pair: usize) -> PairError {
        PairError {
            pair,
            translation_m: 0.0,
            rotation_deg: 0.0,
            frobenius: 1.0,
            points: [100, 100],
            stop: String::new(),
            iterations: 1,
        }
    }

    #[test]
    fn who_is_behind_beyond_doubt_falls_out_at_the_next_look() {
        // Behind by the spread of the difference, so by √n standard errors or so of n pairs: 2.5
        // are had of 10 pairs as a rule; by a fifth of it, of many more.
        let spread = 0.1;
        let mut staged = Staged::new(spread * std::f64::consts::SQRT_2, spread);
        let runners = staged.enter([10, 11, 14]);
        assert_eq!(staged.winner(runners[0], &runners), runners[0]);
        assert_eq!(staged.pairs_seen(&runners), [65, 10, 10]);

        let mut staged = Staged::new(0.3 * spread * std::f64::consts::SQRT_2, spread);
        let runners = staged.enter([10, 11, 20]);
        assert_eq!(staged.winner(runners[0], &runners), runners[0]);
        let [all, near, far] = staged.pairs_seen(&runners)[..] else { panic!("three") };
        assert_eq!((all, far), (65, 10));
        assert!(near > 10 && near % LEG == 0, "{near}");
    }

    #[test]
    fn where_nobody_is_behind_beyond_doubt_ever_fewer_go_on() {
        let mut staged = Staged::new(0.0, 1.0);
        let runners = staged.enter(10..22);
        staged.winner(runners[0], &runners);
        let seen = staged.pairs_seen(&runners);
        // Of a dozen that are alike one or two fall out by chance besides.
        let beyond = |pairs: usize| seen.iter().filter(|&&seen| seen > pairs).count();
        assert_eq!([20, 40, 60].map(beyond), [8, 4, 2], "{seen:?}");
    }

    #[test]
    fn who_has_seen_all_pairs_stays_in_and_is_not_judged_again() {
        let mut staged = Staged::new(0.2, 0.1);
        let worst = staged.enter([30])[0];
        assert_eq!(staged.winner(worst, &[]), worst);
        assert_eq!(staged.made, PAIRS);
        let others = staged.enter([10, 20]);
        assert_eq!(staged.winner(worst, &others), others[0]);
        assert_eq!(staged.pairs_seen(&others), [65, 10]);
        assert_eq!(staged.made, 2 * PAIRS + 10);
        // Equals of those who are in are the same runner.
        assert_eq!(staged.enter([30, 10]), [worst, others[0]]);
    }

    #[test]
    fn the_holder_stays_unless_another_is_ahead_by_a_standard_error() {
        let (tune, data) = (TuneConfig::default(), DataConfig::default());
        let price = Price { tune: &tune, data: &data, start: Vec::new() };
        // Of 65 pairs the mean of a difference of 0.17 times its own spread is 1.4 standard errors.
        let spread = 0.1;
        for (step, ahead, followed) in [(0.17, 1.0..2.0, true), (0.07, 0.1..1.0, false)] {
            let mut staged = Staged::new(step * spread * std::f64::consts::SQRT_2, spread);
            let [best, holder] = staged.enter([10, 11])[..] else { panic!("two") };
            let winner = staged.winner(holder, &[best]);
            let behind = staged.race.behind(holder, best, PAIRS, &price).expect("a mean");
            assert!(ahead.contains(&behind), "{behind}: else this tests nothing");
            assert_eq!(winner, if followed { best } else { holder });
        }
    }
}
