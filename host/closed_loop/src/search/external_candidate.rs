//! Fitness of the candidates of an outside search, as a search here would tell its optimiser.

use super::fitness::{Fitness, PairResult};
use crate::cost::Scanner;
use crate::evaluation::summary::{NoisyPairs, Summary, evaluate_and_cost};
use crate::parameters::Parameters;
use crate::prepared::{PairSet, Prepared};
use echoloop_sensors::sensor::SensorError;

/// Results of the start on every pair, with which costs are compared; none where costs do not
/// count.
#[derive(Clone, Debug, Default)]
pub struct Started(Vec<PairResult>);

/// Judge of outside candidates: every one on the same pairs with the same noise.
pub struct Judge<'a> {
    prepared: &'a Prepared,
    scanner: Scanner,
    pairs: NoisyPairs<'a>,
    fitness: Fitness<'a>,
}

impl<'a> Judge<'a> {
    /// Judges the start, with which costs are compared. `done` is called after each pair.
    pub fn new(
        prepared: &'a Prepared,
        which: PairSet,
        done: &(dyn Fn() + Sync),
    ) -> Result<Self, SensorError> {
        let judge = Self::against(prepared, which, Started::default());
        if !prepared.config.tune.counts_costs() {
            return Ok(judge);
        }
        let (summary, _) = judge.evaluate(&prepared.start, done)?;
        let cost = summary.cost;
        let result = |error| PairResult { error, cost };
        let start = Started(summary.errors.into_iter().map(result).collect());
        Ok(Self::against(prepared, which, start))
    }

    /// A judge like the one whose [`Judge::started`] this is: the start is not judged again.
    pub fn against(prepared: &'a Prepared, which: PairSet, start: Started) -> Self {
        let (config, pairs) = (&prepared.config, prepared.pairs(which));
        let scanner = prepared.bench().scanner(prepared.device.hardware, config.motion.duration_s);
        let fitness = Fitness { start: start.0, ..Fitness::new(&config.tune, &config.data) };
        Self { prepared, scanner, pairs, fitness }
    }

    /// Results of the start.
    pub fn started(&self) -> Started {
        Started(self.fitness.start.clone())
    }

    /// Summary of a candidate over all pairs, and the fitness that a search would minimise. `done`
    /// is called after each pair.
    pub fn evaluate(
        &self,
        candidate: &Parameters,
        done: &(dyn Fn() + Sync),
    ) -> Result<(Summary, f64), SensorError> {
        let Self { prepared, scanner, pairs, fitness } = self;
        let (bench, data) = (prepared.bench(), &prepared.config.data);
        let summary = evaluate_and_cost(&bench, candidate, pairs, scanner, data, done)?;
        let value = fitness.of(&summary.errors, summary.cost.as_ref());
        Ok((summary, value))
    }
}
