//! The choice: those who could win, on all training pairs.
//!
//! A candidate's own fitness saw few pairs and was picked for being low, so it flatters: it only
//! makes the shortlist. In the race all see the same pairs with the same noise, some more at a
//! time, and who is behind the leader beyond doubt falls out (F-Race: Birattari et al., "A Racing
//! Algorithm for Configuring Metaheuristics", GECCO 2002; here by paired differences).

use super::tasks::{Crew, Task};
use super::{Finalist, TuneSearch};
use crate::experiment::objective::{PairError, Worth};
use crate::experiment::params::Parameters;
use crate::experiment::seed::{Purpose, derive};
use crate::link::sensor::SensorError;

/// Pairs that all who are left are judged on before anybody falls out, and between two looks.
const LEG: usize = 5;

/// Pairs before the first look.
const FIRST_LOOK: usize = 10;

/// Who is so many standard errors behind the leader falls out.
const BEHIND: f64 = 2.5;

/// One who could win.
#[derive(Clone, Debug)]
struct Runner {
    origin: String,
    parameters: Parameters,
    /// On the first pairs, as many as it has seen.
    errors: Vec<PairError>,
}

/// All who were ever entered, with what is known of them: nobody is judged twice on a pair.
pub(super) struct Race<'a> {
    search: &'a TuneSearch<'a>,
    worth: Worth,
    runners: Vec<Runner>,
}

impl<'a> Race<'a> {
    pub(super) fn new(search: &'a TuneSearch<'a>) -> Self {
        Self { search, worth: search.config.tune.worth(), runners: Vec::new() }
    }

    /// Enters parameters; of those that are in already the number they have.
    pub(super) fn enter(&mut self, origin: String, parameters: Parameters) -> usize {
        match self.runners.iter().position(|runner| runner.parameters == parameters) {
            Some(number) => number,
            None => {
                self.runners.push(Runner { origin, parameters, errors: Vec::new() });
                self.runners.len() - 1
            }
        }
    }

    /// Registrations made.
    pub(super) fn registrations(&self) -> usize {
        self.runners.iter().map(|runner| runner.errors.len()).sum()
    }

    /// The best of some on all training pairs, by number; `None` when the search is to stop.
    pub(super) fn winner(
        &mut self,
        mut left: Vec<usize>,
        crew: &Crew<'_>,
    ) -> Result<Option<usize>, SensorError> {
        left.sort_unstable();
        left.dedup();
        let all = self.search.bench.dataset.train.len();
        let mut seen = FIRST_LOOK.min(all);
        loop {
            if !self.judge(&left, seen, crew)? {
                return Ok(None);
            }
            let leader = self.leader(&left, seen);
            if seen == all {
                return Ok(Some(leader));
            }
            left.retain(|&i| !self.is_behind(i, leader, seen));
            seen = (seen + LEG).min(all);
        }
    }

    /// Sees to it that all of some have been judged on the first pairs; false: interrupted.
    fn judge(&mut self, some: &[usize], seen: usize, crew: &Crew<'_>) -> Result<bool, SensorError> {
        let seed = self.search.config.seed;
        let mut tasks = Vec::new();
        for &i in some {
            let runner = &self.runners[i];
            tasks.extend((runner.errors.len()..seen).map(|pair| {
                let noise = derive(seed, Purpose::ShortlistNoise, pair as u64);
                (i, Task { parameters: &runner.parameters, pair, noise })
            }));
        }
        let (whose, tasks): (Vec<usize>, Vec<Task<'_>>) = tasks.into_iter().unzip();
        let Some(errors) = crew.errors(&tasks)? else { return Ok(false) };
        for (i, error) in whose.into_iter().zip(errors) {
            self.runners[i].errors.push(error);
        }
        Ok(true)
    }

    fn fitness(&self, i: usize, seen: usize) -> f64 {
        self.worth.of(&self.runners[i].errors[..seen])
    }

    /// The one of least fitness; of equals the first.
    fn leader(&self, left: &[usize], seen: usize) -> usize {
        let fitness = |i: usize| self.fitness(i, seen);
        left.iter().copied().min_by(|&a, &b| fitness(a).total_cmp(&fitness(b))).unwrap_or_default()
    }

    /// Whether one is worse than the leader beyond doubt: by the paired differences of their losses.
    fn is_behind(&self, i: usize, leader: usize, seen: usize) -> bool {
        let loss = |i: usize| self.runners[i].errors[..seen].iter().map(|e| self.worth.loss(e));
        let differences: Vec<f64> = loss(i).zip(loss(leader)).map(|(a, b)| a - b).collect();
        let count = seen as f64;
        let mean = differences.iter().sum::<f64>() / count;
        let squares = differences.iter().map(|d| (d - mean) * (d - mean)).sum::<f64>();
        mean > BEHIND * (squares / (count - 1.0).max(1.0) / count).sqrt()
    }

    pub(super) fn origin(&self, i: usize) -> &str {
        &self.runners[i].origin
    }

    pub(super) fn parameters(&self, i: usize) -> &Parameters {
        &self.runners[i].parameters
    }

    /// What one loses on each pair that it has seen.
    pub(super) fn losses(&self, i: usize) -> Vec<f64> {
        self.runners[i].errors.iter().map(|error| self.worth.loss(error)).collect()
    }

    /// All who were judged: those first that saw most pairs, the best of them first.
    pub(super) fn finalists(&self) -> Vec<Finalist> {
        let judged = self.runners.iter().filter(|runner| !runner.errors.is_empty());
        let mut finalists: Vec<Finalist> = judged
            .map(|runner| Finalist {
                origin: runner.origin.clone(),
                values: self.search.searched_values(&runner.parameters),
                fitness: self.worth.of(&runner.errors),
                pairs: runner.errors.len(),
            })
            .collect();
        finalists.sort_by(|a, b| b.pairs.cmp(&a.pairs).then(a.fitness.total_cmp(&b.fitness)));
        finalists
    }
}
