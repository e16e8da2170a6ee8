//! Fitness of the candidates of an outside search, as a search here would tell its optimiser.

use echoloop_dsp::Hardware;

use super::fitness::{Fitness, PairResult};
use crate::config::RunConfig;
use crate::cost::Scanner;
use crate::evaluation::objective::Bench;
use crate::evaluation::summary::{NoisyPairs, Summary, evaluate_and_cost};
use crate::parameters::Parameters;
use echoloop_sensors::sensor::SensorError;

/// Judge of outside candidates: every one on the same pairs with the same noise.
pub struct Judge<'a> {
    config: &'a RunConfig,
    bench: Bench<'a>,
    scanner: Scanner,
    pairs: NoisyPairs<'a>,
    fitness: Fitness<'a>,
}

impl<'a> Judge<'a> {
    /// Judges the start, with which costs are compared. `done` is called after each pair.
    pub fn new(
        config: &'a RunConfig,
        bench: Bench<'a>,
        hardware: Hardware,
        start: &Parameters,
        pairs: NoisyPairs<'a>,
        done: &(dyn Fn() + Sync),
    ) -> Result<Self, SensorError> {
        let scanner = bench.scanner(hardware, config.motion.duration_s);
        let fitness = Fitness { tune: &config.tune, data: &config.data, start: Vec::new() };
        let mut judge = Self { config, bench, scanner, pairs, fitness };
        if config.tune.counts_costs() {
            let (summary, _) = judge.evaluate_with(start, done)?;
            let cost = summary.cost;
            let result = |error| PairResult { error, cost };
            judge.fitness.start = summary.errors.into_iter().map(result).collect();
        }
        Ok(judge)
    }

    /// Summary of a candidate over all pairs, and the fitness that a search would minimise.
    pub fn evaluate(&self, candidate: &Parameters) -> Result<(Summary, f64), SensorError> {
        self.evaluate_with(candidate, &|| ())
    }

    fn evaluate_with(
        &self,
        candidate: &Parameters,
        done: &(dyn Fn() + Sync),
    ) -> Result<(Summary, f64), SensorError> {
        let Self { config, bench, scanner, pairs, fitness } = self;
        let summary = evaluate_and_cost(bench, candidate, pairs, scanner, &config.data, done)?;
        let value = fitness.of(&summary.errors, summary.cost.as_ref());
        Ok((summary, value))
    }
}
