//! The closed loop: candidates go to the sensor, scans come back, errors go to the optimiser.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};

use echoloop_link::settings_hash;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::experiment::config::RunConfig;
use crate::experiment::content::{Content, build};
use crate::experiment::dataset::ScanPair;
use crate::experiment::evaluate::{NoisyPairs, Summary, evaluate, evaluate_and_cost, median};
use crate::experiment::journal::{
    CandidateRecord, FORMAT, Generation, Header, Journal, JournalError,
};
use crate::experiment::objective::{Bench, PairError, fitness};
use crate::experiment::params::{Parameters, Space, Values, written_values};
use crate::experiment::seed::{Purpose, derive};
use crate::link::sensor::SensorError;
use echoloop_cmaes::CmaEs;

/// Why a search did not end.
#[derive(Debug, Error)]
pub enum TuneError {
    /// The sensor failed.
    #[error(transparent)]
    Sensor(#[from] SensorError),
    /// The journal failed.
    #[error(transparent)]
    Journal(#[from] JournalError),
    /// The optimiser cannot run.
    #[error("the optimiser: {0}")]
    Optimizer(#[from] echoloop_cmaes::CmaEsConfigError),
    /// The journal's candidates are not those that this search asks for.
    #[error(
        "line {} of the journal is not of this search: its {field} is not what the configuration \
         gives in this version; begin anew with `echoloop tune --config` and the run's config.toml",
        generation + 2
    )]
    Diverged {
        /// The generation, which has a line after the header's.
        generation: usize,
        /// What differs first.
        field: String,
    },
    /// Someone asked to stop. What was done is in the journal.
    #[error("interrupted after {generations} generations")]
    Interrupted {
        /// Whole generations in the journal.
        generations: usize,
    },
}

/// Where a generation of the journal first differs from the one that would be written now, bit for
/// bit. Only the errors of the pairs are not known now; what is made of them is.
///
/// A search's start hangs on more than its configuration: on the defaults of this version. The same
/// header would else go on from candidates that were never asked for.
fn difference(found: &Generation, drawn: &Generation, cap: f64) -> Option<String> {
    let fields = [
        ("generation", found.generation == drawn.generation),
        ("pairs", found.pairs == drawn.pairs),
        ("mean", found.mean == drawn.mean),
        ("deviations", found.deviations == drawn.deviations),
        ("sigma", found.sigma == drawn.sigma),
        ("candidates", found.candidates.len() == drawn.candidates.len()),
    ];
    if let Some((field, _)) = fields.into_iter().find(|(_, same)| !same) {
        return Some(field.to_owned());
    }
    let candidates = found.candidates.iter().zip(&drawn.candidates).enumerate();
    candidates.into_iter().find_map(|(i, (found, asked))| {
        let field = candidate_difference(found, asked, &drawn.pairs, cap)?;
        Some(format!("candidates[{i}].{field}"))
    })
}

fn candidate_difference(
    found: &CandidateRecord,
    asked: &CandidateRecord,
    pairs: &[usize],
    cap: f64,
) -> Option<&'static str> {
    let fields = [
        ("point", found.point == asked.point),
        ("values", found.values == asked.values),
        ("repaired", found.repaired == asked.repaired),
        ("settings", found.settings == asked.settings),
        ("errors", found.errors.iter().map(|error| &error.pair).eq(pairs)),
        ("fitness", found.fitness == fitness(&found.errors, cap)),
    ];
    fields.into_iter().find(|(_, same)| !same).map(|(field, _)| field)
}

/// Tells the optimiser what a generation was worth.
fn tell(optimizer: &mut CmaEs, generation: &Generation) {
    let values: Vec<f64> = generation.candidates.iter().map(|c| c.fitness).collect();
    // There is a candidate for each that was asked for: drawn here, or compared with what was.
    let _ = optimizer.tell(&values);
}

/// Hears how far a search is.
pub trait Observer: Sync {
    /// A registration is done.
    fn evaluated(&self) {}
    /// A generation is done.
    fn generation(&self, _generation: &Generation, _of: u32) {}
    /// Another part of the work begins, with so many registrations.
    fn stage(&self, _name: &str, _registrations: usize) {}
}

/// An observer that hears nothing.
pub struct Silent;
impl Observer for Silent {}

/// One of those that were judged on all training pairs at the end.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Finalist {
    /// Where it comes from: `start`, `mean`, or generation and candidate.
    pub origin: String,
    /// Its parameters.
    #[serde(serialize_with = "written_values")]
    pub values: Values,
    /// Its fitness on all training pairs.
    pub fitness: f64,
}

/// The end of a search.
#[derive(Clone, Debug, PartialEq)]
pub struct Tuned {
    /// The parameters chosen.
    pub parameters: Parameters,
    /// Where they come from.
    pub origin: String,
    /// All that were in the choice, best first.
    pub finalists: Vec<Finalist>,
    /// Every generation.
    pub generations: Vec<Generation>,
    /// Correlations of the axes at the end.
    pub correlations: Vec<Vec<f64>>,
    /// How much of them can have been learned, 0 to 1.
    pub covariance_learned: f64,
}

/// A search, ready to run.
pub struct TuneSearch<'a> {
    /// The configuration.
    pub config: &'a RunConfig,
    /// Pairs, receiver, hardware.
    pub bench: Bench<'a>,
    /// The axes.
    pub space: Space,
    /// Where it starts.
    pub start: Parameters,
    /// Set from outside to stop.
    pub stop: &'a AtomicBool,
}

impl TuneSearch<'_> {
    /// λ: as configured, or as many as there are parameters (Sec. 4.2).
    pub fn population(&self) -> usize {
        match self.config.tune.population {
            0 => self.space.axes().len().max(2),
            population => population,
        }
    }

    /// Training pairs a generation sees.
    pub fn batch_size(&self) -> usize {
        let all = self.bench.dataset.train.len();
        match self.config.tune.pairs_per_generation {
            0 => all,
            some => some.min(all),
        }
    }

    /// The first line of this search's journal.
    pub fn header(&self) -> Header {
        Header {
            journal: FORMAT,
            program: format!("echoloop {}", env!("CARGO_PKG_VERSION")),
            build: build(),
            link_schema: format!("{:#018x}", echoloop_link::SCHEMA),
            config: serde_json::to_value(self.config).unwrap_or_default(),
            axes: self.space.axes().iter().map(|axis| axis.name.to_owned()).collect(),
            population: self.population(),
            content: Content::of(self.config, self.bench.dataset),
        }
    }

    /// Registrations the search takes, its choice included.
    pub fn registrations(&self) -> usize {
        let finalists = (self.config.tune.shortlist + 2) * self.bench.dataset.train.len();
        self.config.tune.generations as usize * self.population() * self.batch_size() + finalists
    }

    /// Searches, writing each generation to the journal. `done` are generations that the journal
    /// already has.
    ///
    /// # Errors
    ///
    /// [`TuneError`]; whatever happens, the journal holds every whole generation.
    pub fn run(
        &self,
        journal: &mut Journal,
        done: Vec<Generation>,
        observer: &dyn Observer,
    ) -> Result<Tuned, TuneError> {
        if self.space.axes().is_empty() {
            return self.untuned(&done);
        }
        let total = self.config.tune.generations;
        let mut optimizer = self.replayed(&done)?;
        let mut generations = done;
        generations.iter().for_each(|generation| observer.generation(generation, total));
        while optimizer.stop().is_none() {
            let generation = self.generation(&optimizer, observer)?;
            let Some(generation) = generation else {
                return Err(TuneError::Interrupted { generations: generations.len() });
            };
            journal.add(&generation)?;
            tell(&mut optimizer, &generation);
            observer.generation(&generation, total);
            generations.push(generation);
        }
        self.choose(&optimizer, generations, observer)
    }

    /// The default protocol: nothing to search, and nothing that can have been done.
    fn untuned(&self, done: &[Generation]) -> Result<Tuned, TuneError> {
        if !done.is_empty() {
            return Err(TuneError::Diverged { generation: 0, field: "generation".into() });
        }
        Ok(Tuned {
            parameters: self.start,
            origin: "start".into(),
            finalists: Vec::new(),
            generations: Vec::new(),
            correlations: Vec::new(),
            covariance_learned: 0.0,
        })
    }

    fn optimizer(&self) -> Result<CmaEs, TuneError> {
        let seed = derive(self.config.seed, Purpose::Search, 0);
        let mut config = echoloop_cmaes::CmaEsConfig::unit_cube(
            self.space.start_point(),
            self.config.tune.sigma,
            seed,
        );
        config.lambda = Some(self.population());
        config.stops.generations = Some(u64::from(self.config.tune.generations));
        Ok(CmaEs::new(config)?)
    }

    /// The optimiser after generations that a journal has.
    ///
    /// # Errors
    ///
    /// [`TuneError::Diverged`] at the first that this search would not have written.
    fn replayed(&self, done: &[Generation]) -> Result<CmaEs, TuneError> {
        let mut optimizer = self.optimizer()?;
        for (number, generation) in done.iter().enumerate() {
            let field = match optimizer.stop() {
                Some(_) => Some("generation, after the search's end,".to_owned()),
                None => {
                    let (drawn, _) = self.draw(&optimizer);
                    difference(generation, &drawn, self.config.tune.error_cap)
                }
            };
            if let Some(field) = field {
                return Err(TuneError::Diverged { generation: number, field });
            }
            tell(&mut optimizer, generation);
        }
        Ok(optimizer)
    }

    /// The next generation as far as it is known before a scan: without errors and fitness. And its
    /// candidates' parameters.
    fn draw(&self, optimizer: &CmaEs) -> (Generation, Vec<Parameters>) {
        let points = optimizer.ask().into_iter().map(|candidate| candidate.phenotype);
        let (parameters, candidates) = points
            .map(|point| {
                let (parameters, repaired) = self.space.parameters(&point);
                (parameters, self.record(point, &parameters, &repaired))
            })
            .unzip();
        let generation = Generation {
            generation: optimizer.generation() as u32,
            pairs: self.batch(optimizer.generation()),
            mean: optimizer.mean().to_vec(),
            deviations: optimizer.deviations(),
            sigma: optimizer.sigma(),
            candidates,
        };
        (generation, parameters)
    }

    /// Evaluates one generation: every candidate on the same pairs. `None`: interrupted.
    fn generation(
        &self,
        optimizer: &CmaEs,
        observer: &dyn Observer,
    ) -> Result<Option<Generation>, TuneError> {
        let number = optimizer.generation();
        let (mut generation, parameters) = self.draw(optimizer);
        let pairs = &generation.pairs;
        let tasks: Vec<(usize, usize)> = (0..parameters.len())
            .flat_map(|candidate| pairs.iter().map(move |&pair| (candidate, pair)))
            .collect();
        let errors: Option<Vec<PairError>> = tasks
            .par_iter()
            .map(|&(candidate, pair)| {
                self.task(&parameters[candidate], number, candidate, pair, observer)
            })
            .collect::<Result<_, SensorError>>()?;
        let Some(errors) = errors else { return Ok(None) };
        let each = errors.chunks(pairs.len());
        for (candidate, errors) in generation.candidates.iter_mut().zip(each) {
            candidate.errors = errors.to_vec();
            candidate.fitness = fitness(errors, self.config.tune.error_cap);
        }
        Ok(Some(generation))
    }

    /// One registration; `None` when the search is to stop.
    fn task(
        &self,
        parameters: &Parameters,
        generation: u64,
        candidate: usize,
        pair: usize,
        observer: &dyn Observer,
    ) -> Result<Option<PairError>, SensorError> {
        if self.stop.load(Ordering::Relaxed) {
            return Ok(None);
        }
        let noise_index = if self.config.tune.common_noise { 0 } else { candidate as u64 + 1 };
        // Each part has bits of its own, so no two registrations draw the same noise by chance.
        let index = (generation << 32) | (pair as u64) << 16 | noise_index;
        let noise = derive(self.config.seed, Purpose::TrainNoise, index);
        let registered =
            self.bench.register(parameters, pair, &self.bench.dataset.train[pair], noise)?;
        observer.evaluated();
        Ok(Some(registered.error))
    }

    /// What is known of a candidate before a scan.
    fn record(
        &self,
        point: Vec<f64>,
        parameters: &Parameters,
        repaired: &[&'static str],
    ) -> CandidateRecord {
        CandidateRecord {
            point,
            values: self.searched_values(parameters),
            repaired: repaired.iter().map(|&name| name.to_owned()).collect(),
            settings: settings_hash(&parameters.settings),
            errors: Vec::new(),
            fitness: f64::NAN,
        }
    }

    /// The searched parameters by name.
    pub fn searched_values(&self, parameters: &Parameters) -> Values {
        let axes = self.space.axes().iter();
        axes.filter_map(|axis| parameters.get(axis.name).map(|value| (axis.name.to_owned(), value)))
            .collect()
    }

    /// The pairs of a generation: some of all, drawn without repetition, ascending.
    fn batch(&self, generation: u64) -> Vec<usize> {
        let all = self.bench.dataset.train.len();
        let mut indices: Vec<usize> = (0..all).collect();
        let seed = derive(self.config.seed, Purpose::Batch, generation);
        indices.sort_by_key(|&i| derive(seed, Purpose::Batch, i as u64));
        indices.truncate(self.batch_size());
        indices.sort_unstable();
        indices
    }

    /// Judges start, final mean and the best candidates on all training pairs with one noise, and
    /// takes the best.
    ///
    /// A candidate's own fitness saw few pairs and was picked for being low, so it flatters: it
    /// only makes the shortlist.
    fn choose(
        &self,
        optimizer: &CmaEs,
        generations: Vec<Generation>,
        observer: &dyn Observer,
    ) -> Result<Tuned, TuneError> {
        let entrants = self.shortlist(optimizer, &generations);
        let noisy = self.noisy(&self.bench.dataset.train, Purpose::ShortlistNoise);
        observer.stage("choosing", entrants.len() * noisy.pairs.len());
        let mut finalists = Vec::new();
        for (origin, parameters) in entrants {
            if self.stop.load(Ordering::Relaxed) {
                return Err(TuneError::Interrupted { generations: generations.len() });
            }
            let errors = evaluate(&self.bench, &parameters, &noisy, &|| observer.evaluated())?;
            let worth = fitness(&errors, self.config.tune.error_cap);
            finalists.push((worth, origin, parameters));
        }
        finalists.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (_, origin, parameters) = finalists[0].clone();
        Ok(Tuned {
            parameters,
            origin,
            finalists: finalists.into_iter().map(|finalist| self.finalist(finalist)).collect(),
            correlations: optimizer.correlations(),
            covariance_learned: optimizer.covariance_learned(),
            generations,
        })
    }

    fn finalist(&self, (fitness, origin, parameters): (f64, String, Parameters)) -> Finalist {
        Finalist { origin, values: self.searched_values(&parameters), fitness }
    }

    /// Pairs with the noise of a purpose.
    fn noisy<'a>(&self, pairs: &'a [ScanPair], purpose: Purpose) -> NoisyPairs<'a> {
        NoisyPairs { pairs, seed: self.config.seed, purpose }
    }

    /// Start, final mean, and the best candidates: of each generation its best, the later
    /// generations first among equals.
    fn shortlist(
        &self,
        optimizer: &CmaEs,
        generations: &[Generation],
    ) -> Vec<(String, Parameters)> {
        let mut best: BTreeMap<usize, (f64, usize)> = BTreeMap::new();
        for (g, generation) in generations.iter().enumerate() {
            // Compared with its generation's median: pairs differ in difficulty from batch to
            // batch.
            let median = median(generation.candidates.iter().map(|c| c.fitness));
            for (i, candidate) in generation.candidates.iter().enumerate() {
                let relative = candidate.fitness / median.max(f64::MIN_POSITIVE);
                if best.get(&g).is_none_or(|(worth, _)| relative < *worth) {
                    best.insert(g, (relative, i));
                }
            }
        }
        let mut order: Vec<(usize, f64, usize)> =
            best.into_iter().map(|(g, (worth, i))| (g, worth, i)).collect();
        // The first half of the search was still on its way.
        let half = generations.len() / 2;
        order.retain(|(g, ..)| *g >= half);
        order.sort_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)));
        order.truncate(self.config.tune.shortlist);
        let mut entrants = vec![("start".to_owned(), self.start)];
        entrants.push(("mean".to_owned(), self.space.parameters(optimizer.mean()).0));
        entrants.extend(order.into_iter().map(|(g, _, i)| {
            let point = &generations[g].candidates[i].point;
            (format!("generation {g}, candidate {i}"), self.space.parameters(point).0)
        }));
        entrants
    }

    /// Judges parameters on the held-out pairs.
    ///
    /// # Errors
    ///
    /// [`SensorError`].
    pub fn judge(
        &self,
        parameters: &Parameters,
        observer: &dyn Observer,
    ) -> Result<Summary, SensorError> {
        let noisy = self.noisy(&self.bench.dataset.test, Purpose::TestNoise);
        let (bench, scanner) = (&self.bench, &self.bench.scanner(self.config));
        let done = || observer.evaluated();
        let (errors, cost) = evaluate_and_cost(bench, parameters, &noisy, scanner, &done)?;
        Ok(Summary { cost, ..Summary::from_errors(errors, &self.config.data) })
    }
}

#[cfg(test)]
mod tests {
    use echoloop_cmaes::CmaEsConfig;

    use super::*;

    fn search(start: f64) -> CmaEs {
        CmaEs::new(CmaEsConfig::unit_cube(vec![start; 3], 0.2, 1)).unwrap()
    }

    /// A generation of two pairs, with the errors that a search would have written.
    fn written(optimizer: &CmaEs) -> Generation {
        let error = |pair| PairError {
            pair,
            translation_m: 0.1,
            rotation_deg: 0.1,
            frobenius: pair as f64,
            points: [100, 100],
            stop: String::new(),
            iterations: 1,
        };
        let record = |point| CandidateRecord {
            point,
            values: Values::from([("lidar.power".into(), 5.0)]),
            repaired: Vec::new(),
            settings: 7,
            errors: vec![error(1), error(4)],
            fitness: 2.0, // capped at 3
        };
        Generation {
            generation: optimizer.generation() as u32,
            pairs: vec![1, 4],
            mean: optimizer.mean().to_vec(),
            deviations: optimizer.deviations(),
            sigma: optimizer.sigma(),
            candidates: optimizer.ask().into_iter().map(|c| record(c.phenotype)).collect(),
        }
    }

    #[test]
    fn a_search_goes_on_only_from_what_it_would_have_written_itself() {
        let drawn = written(&search(0.5));
        assert_eq!(difference(&written(&search(0.5)), &drawn, 3.0), None);
        assert_eq!(difference(&written(&search(0.6)), &drawn, 3.0).unwrap(), "mean");
        type Change = fn(&mut Generation);
        let changes: [(&str, Change); 14] = [
            ("generation", |g| g.generation += 1),
            ("pairs", |g| g.pairs.reverse()),
            ("mean", |g| g.mean.clear()),
            ("deviations", |g| g.deviations[0] *= 1.0 + 1e-15),
            ("sigma", |g| g.sigma = 1e308),
            ("candidates", |g| g.candidates.clear()),
            ("candidates[0].point", |g| g.candidates.reverse()),
            ("candidates[2].point", |g| g.candidates[2].point[1] *= 1.0 + 1e-15),
            ("candidates[1].values", |g| g.candidates[1].values.clear()),
            ("candidates[1].repaired", |g| g.candidates[1].repaired.push("gain".into())),
            ("candidates[1].settings", |g| g.candidates[1].settings ^= 1),
            ("candidates[0].errors", |g| g.candidates[0].errors.truncate(1)),
            ("candidates[0].fitness", |g| g.candidates[0].errors[0].frobenius = 1.5),
            ("candidates[0].fitness", |g| g.candidates[0].fitness = -1e300),
        ];
        for (field, change) in changes {
            let mut found = written(&search(0.5));
            change(&mut found);
            assert_eq!(difference(&found, &drawn, 3.0).as_deref(), Some(field));
        }
    }
}
