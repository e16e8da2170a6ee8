//! One generation of a stage: its candidates, the pairs they share, their evaluation.

use echoloop_cmaes::{CmaEs, CmaEsConfig};

use super::CONSTANTS;
use super::batch::Task;
use super::fitness::mean_cost;
use super::replay::difference;
use super::search_run::SearchRun;
use super::stage::Stage;
use super::tune_search::TuneError;
use crate::config::preset::{Sampler, Strategy};
use crate::parameters::Parameters;
use crate::run_folder::journal::{CandidateRecord, Generation};
use crate::seed::{Purpose, derive};
use echoloop_random::Generator;

/// A generation before its first scan: without errors and fitness.
pub(super) struct Asked {
    generation: Generation,
    /// Parameters of the candidates, in their order.
    parameters: Vec<Parameters>,
    /// Number of the generation within its line of stages; the noise of its scans follows from it.
    number: u32,
}

impl SearchRun<'_> {
    /// The optimiser of a stage: CMA-ES over the stage's axes, from their coordinates in `base`.
    pub(super) fn optimizer(&self, stage: &Stage, base: &[f64]) -> Result<CmaEs, TuneError> {
        let number = stage.place.searches.into();
        let seed = derive(self.search.config.seed, Purpose::Search, number);
        let mut config = CmaEsConfig::unit_cube(stage.own(base), stage.sigma, seed);
        config.lambda = Some(stage.population);
        config.constants = CONSTANTS;
        config.stops.generations = Some(stage.generations.into());
        if self.search.config.tune.strategy == Strategy::Fast {
            let space = &self.search.space;
            config.coordinates = stage.axes.iter().map(|&axis| space.coordinate(axis)).collect();
        }
        Ok(CmaEs::new(config)?)
    }

    /// The next generation that the optimiser asks for, the `step`th of its stage and the
    /// `place`th of those asked for at once, both from 0.
    pub(super) fn ask(
        &self,
        stage: &Stage,
        (place, step): (usize, u32),
        optimizer: &CmaEs,
        base: &[f64],
    ) -> Asked {
        let number = stage.place.generations + step;
        let asked = optimizer.ask();
        let points = asked.into_iter().enumerate().map(|(candidate, asked)| {
            let own = match self.search.config.tune.sampler {
                Sampler::CmaEs => asked.phenotype,
                Sampler::Random => self.even(number, candidate, stage.axes.len()),
            };
            stage.expanded(&own, base)
        });
        let space = &self.search.space;
        let (parameters, candidates) =
            points.map(|point| CandidateRecord::drawn(space, point)).unzip();
        let still = vec![0.0; base.len()];
        let generation = Generation {
            generation: (self.generations.len() + place) as u32,
            stage: stage.name.to_string(),
            pairs: self.pairs_of(number.into(), stage.pairs),
            mean: stage.expanded(optimizer.mean(), base),
            deviations: stage.expanded(&optimizer.deviations(), &still),
            sigma: optimizer.sigma(),
            candidates,
        };
        Asked { generation, parameters, number }
    }

    /// A point drawn evenly from the unit cube.
    fn even(&self, number: u32, candidate: usize, axes: usize) -> Vec<f64> {
        let seed = derive(self.search.config.seed, Purpose::Search, number.into());
        let mut generator = Generator::new(seed, candidate as u64);
        (0..axes).map(|_| generator.unit()).collect()
    }

    /// Training pairs of a generation, drawn by weight without repetition, ascending.
    fn pairs_of(&self, number: u64, count: usize) -> Vec<usize> {
        let mut pairs: Vec<usize> = (0..self.pair_weights.len()).collect();
        let seed = derive(self.search.config.seed, Purpose::Batch, number);
        // The smallest of exponential variates of these rates (Efraimidis and Spirakis 2006).
        let variate = |i: usize| {
            let uniform =
                (derive(seed, Purpose::Batch, i as u64) >> 11) as f64 / (1u64 << 53) as f64;
            -libm::log1p(-uniform) / self.pair_weights[i]
        };
        pairs.sort_by(|&a, &b| variate(a).total_cmp(&variate(b)));
        pairs.truncate(count);
        pairs.sort_unstable();
        pairs
    }

    /// Scans and registers every candidate on its generation's pairs, and adds the generations to
    /// the journal; those that it holds already are compared instead.
    pub(super) fn scan_and_register(
        &mut self,
        mut asked: Vec<Asked>,
    ) -> Result<Vec<Generation>, TuneError> {
        let known = self.recorded.len().min(asked.len());
        let fresh = asked.split_off(known);
        let recorded: Vec<Generation> = self.recorded.drain(..known).collect();
        let compared = recorded.into_iter().zip(&asked);
        let mut generations: Vec<Generation> = compared
            .map(|(recorded, asked)| self.compared(recorded, asked))
            .collect::<Result<_, _>>()?;
        let tasks: Vec<Task<'_>> = fresh.iter().flat_map(|asked| self.tasks(asked)).collect();
        let results = self.evaluator.evaluate(&tasks)?.ok_or_else(|| self.interrupted())?;
        let mut left = results.as_slice();
        for Asked { mut generation, .. } in fresh {
            for candidate in &mut generation.candidates {
                let (results, others) = left.split_at(generation.pairs.len());
                candidate.errors = results.iter().map(|result| result.error.clone()).collect();
                candidate.cost = mean_cost(results);
                candidate.fitness = self.fitness.of(&candidate.errors, candidate.cost.as_ref());
                left = others;
            }
            self.journal.add(&generation)?;
            generations.push(generation);
        }
        Ok(generations)
    }

    /// Registrations of a generation: its pairs by each candidate.
    fn tasks<'a>(&self, asked: &'a Asked) -> Vec<Task<'a>> {
        let pairs = &asked.generation.pairs;
        let task = |(candidate, parameters): (usize, &'a Parameters), pair: usize| Task {
            parameters,
            pair,
            noise: self.noise(asked.number, pair, candidate),
        };
        let candidates = asked.parameters.iter().enumerate();
        candidates
            .flat_map(|candidate| pairs.iter().map(move |&pair| task(candidate, pair)))
            .collect()
    }

    /// Seed of the noise of a registration's scans; one for all candidates with common noise.
    fn noise(&self, number: u32, pair: usize, candidate: usize) -> u64 {
        let config = self.search.config;
        let own = if config.tune.common_noise { 0 } else { candidate as u64 + 1 };
        // Each part has bits of its own, so no two registrations draw the same noise by chance.
        let index = u64::from(number) << 32 | (pair as u64) << 16 | own;
        derive(config.seed, Purpose::TrainNoise, index)
    }

    /// The journal's generation, when it is the one that is asked for now.
    fn compared(&self, recorded: Generation, asked: &Asked) -> Result<Generation, TuneError> {
        let fitness = |c: &CandidateRecord| self.fitness.of(&c.errors, c.cost.as_ref());
        match difference(&recorded, &asked.generation, &fitness) {
            None => Ok(recorded),
            Some(field) => {
                let generation = asked.generation.generation as usize;
                Err(TuneError::Diverged { generation, field })
            }
        }
    }
}
