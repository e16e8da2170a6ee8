//! The choice: those who could win, on all training pairs.
//!
//! A candidate's own fitness saw few pairs and was picked for being low, so it flatters: it only
//! makes the shortlist. In the race all see the same pairs with the same noise, some more at a
//! time, and who is behind the leader beyond doubt falls out (F-Race: Birattari et al., "A Racing
//! Algorithm for Configuring Metaheuristics", GECCO 2002; here by paired differences).

use super::price::{Judged, Price, mean_cost};
use super::search::{Finalist, TuneSearch};
use super::tasks::{Crew, Task};
use crate::experiment::objective::PairError;
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
    judged: Vec<Judged>,
}

/// All who were ever entered, with what is known of them: nobody is judged twice on a pair.
pub(super) struct Race<'a> {
    search: &'a TuneSearch<'a>,
    runners: Vec<Runner>,
}

impl<'a> Race<'a> {
    pub(super) fn new(search: &'a TuneSearch<'a>) -> Self {
        Self { search, runners: Vec::new() }
    }

    /// Enters parameters; of those that are in already the number they have.
    pub(super) fn enter(&mut self, origin: String, parameters: Parameters) -> usize {
        match self.runners.iter().position(|runner| runner.parameters == parameters) {
            Some(number) => number,
            None => {
                self.runners.push(Runner { origin, parameters, judged: Vec::new() });
                self.runners.len() - 1
            }
        }
    }

    /// Registrations made.
    pub(super) fn registrations(&self) -> usize {
        self.runners.iter().map(|runner| runner.judged.len()).sum()
    }

    /// The best of some on all training pairs, by number; `None` when the search is to stop.
    pub(super) fn winner(
        &mut self,
        mut left: Vec<usize>,
        price: &Price<'_>,
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
            let leader = self.leader(&left, seen, price);
            if seen == all {
                return Ok(Some(leader));
            }
            left.retain(|&i| !self.is_behind(i, leader, seen, price));
            seen = (seen + LEG).min(all);
        }
    }

    /// Sees to it that all of some have been judged on the first pairs; false: interrupted.
    fn judge(&mut self, some: &[usize], seen: usize, crew: &Crew<'_>) -> Result<bool, SensorError> {
        let seed = self.search.config.seed;
        let mut tasks = Vec::new();
        for &i in some {
            let runner = &self.runners[i];
            tasks.extend((runner.judged.len()..seen).map(|pair| {
                let noise = derive(seed, Purpose::ShortlistNoise, pair as u64);
                (i, Task { parameters: &runner.parameters, pair, noise })
            }));
        }
        let (whose, tasks): (Vec<usize>, Vec<Task<'_>>) = tasks.into_iter().unzip();
        let Some(judged) = crew.judged(&tasks)? else { return Ok(false) };
        for (i, judged) in whose.into_iter().zip(judged) {
            self.runners[i].judged.push(judged);
        }
        Ok(true)
    }

    fn fitness(&self, i: usize, seen: usize, price: &Price<'_>) -> f64 {
        let judged = &self.runners[i].judged[..seen];
        let errors: Vec<PairError> = judged.iter().map(|judged| judged.error.clone()).collect();
        price.fitness(&errors, mean_cost(judged).as_ref())
    }

    /// The one of least fitness; of equals the first.
    fn leader(&self, left: &[usize], seen: usize, price: &Price<'_>) -> usize {
        let fitness = |i: usize| self.fitness(i, seen, price);
        left.iter().copied().min_by(|&a, &b| fitness(a).total_cmp(&fitness(b))).unwrap_or_default()
    }

    /// Whether one is worse than the leader beyond doubt, by the paired differences of losses.
    fn is_behind(&self, i: usize, leader: usize, seen: usize, price: &Price<'_>) -> bool {
        let losses = |i: usize| -> Option<Vec<f64>> {
            let judged = &self.runners[i].judged[..seen];
            let cost = mean_cost(judged);
            judged.iter().map(|judged| price.loss(&judged.error, cost.as_ref())).collect()
        };
        let Some((own, best)) = losses(i).zip(losses(leader)) else { return false };
        let differences: Vec<f64> = own.iter().zip(&best).map(|(a, b)| a - b).collect();
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

    /// How one came out on each pair that it has seen.
    pub(super) fn judged(&self, i: usize) -> &[Judged] {
        &self.runners[i].judged
    }

    /// All who were judged: those first that saw most pairs, the best of them first.
    pub(super) fn finalists(&self, price: &Price<'_>) -> Vec<Finalist> {
        let each = self.runners.iter().enumerate();
        let judged = each.filter(|(_, runner)| !runner.judged.is_empty());
        let mut finalists: Vec<Finalist> = judged
            .map(|(i, runner)| Finalist {
                origin: runner.origin.clone(),
                values: self.search.searched_values(&runner.parameters),
                fitness: self.fitness(i, runner.judged.len(), price),
                pairs: runner.judged.len(),
            })
            .collect();
        finalists.sort_by(|a, b| b.pairs.cmp(&a.pairs).then(a.fitness.total_cmp(&b.fitness)));
        finalists
    }
}
