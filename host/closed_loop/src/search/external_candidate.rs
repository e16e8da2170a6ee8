//! What a candidate of another's search is worth: as a search of ours would tell its optimiser.

use echoloop_dsp::Hardware;

use super::fitness::{Judged, Price};
use crate::config::RunConfig;
use crate::cost::Scanner;
use crate::evaluation::objective::Bench;
use crate::evaluation::summary::{NoisyPairs, Summary, evaluate_and_cost};
use crate::parameters::Parameters;
use echoloop_sensors::sensor::SensorError;

/// Judges candidates on the same pairs with the same noise, each time.
pub struct Judge<'a> {
    config: &'a RunConfig,
    bench: Bench<'a>,
    scanner: Scanner,
    pairs: NoisyPairs<'a>,
    price: Price<'a>,
}

impl<'a> Judge<'a> {
    /// Judges the start, which costs are compared with. `done` hears of each pair.
    ///
    /// # Errors
    ///
    /// [`SensorError`].
    pub fn new(
        config: &'a RunConfig,
        bench: Bench<'a>,
        hardware: Hardware,
        start: &Parameters,
        pairs: NoisyPairs<'a>,
        done: &(dyn Fn() + Sync),
    ) -> Result<Self, SensorError> {
        let scanner = bench.scanner(hardware, config.motion.duration_s);
        let price = Price { tune: &config.tune, data: &config.data, start: Vec::new() };
        let mut judge = Self { config, bench, scanner, pairs, price };
        // Without the start's, no cost counts.
        if config.tune.counts_costs() {
            let (summary, _) = judge.judged_aloud(start, done)?;
            let cost = summary.cost;
            let judged = |error| Judged { error, cost };
            judge.price.start = summary.errors.into_iter().map(judged).collect();
        }
        Ok(judge)
    }

    /// How a candidate comes out, and the number that a search would make small.
    ///
    /// # Errors
    ///
    /// [`SensorError`].
    pub fn judged(&self, candidate: &Parameters) -> Result<(Summary, f64), SensorError> {
        self.judged_aloud(candidate, &|| ())
    }

    fn judged_aloud(
        &self,
        candidate: &Parameters,
        done: &(dyn Fn() + Sync),
    ) -> Result<(Summary, f64), SensorError> {
        let Self { config, bench, scanner, pairs, price } = self;
        let summary = evaluate_and_cost(bench, candidate, pairs, scanner, &config.data, done)?;
        let fitness = price.fitness(&summary.errors, summary.cost.as_ref());
        Ok((summary, fitness))
    }
}
