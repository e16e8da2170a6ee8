//! Front of error against a cost: the least error found for every cost.
//!
//! 1. NSGA-II ([`echoloop_cmaes::Pareto`]) searches from the start and from the parameters that the
//!    search before selected, on some of the training pairs. Its objectives are logarithms, which
//!    spreads points evenly over decades.
//! 2. The best candidates, and start and selected parameters, are evaluated on all training pairs.
//!    Those that none dominates are the front.
//! 3. Its points are evaluated on the held-out pairs, which select nothing.

mod point;

use std::collections::BTreeSet;
use std::sync::atomic::Ordering;

use echoloop_cmaes::{Objectives, Pareto, ParetoConfig, dominates, sorted_by_crowding};
use echoloop_random::Generator;

use crate::config::preset::ErrorMean;
use crate::cost::CostKind;
use crate::evaluation::objective::Worth;
use crate::evaluation::summary::Summary;
use crate::parameters::{Parameters, Space, Values};
use crate::run_folder::journal::{CandidateRecord, Generation, Header, Journal};
use crate::search::{
    Evaluator, Observer, PairsOf, Task, TuneError, TuneSearch, difference, mean_cost,
};
use crate::seed::{Purpose, derive};
pub use point::{Front, FrontPoint, Mark};

/// Search for a front, ready to run.
pub struct FrontSearch<'a> {
    /// Search before: configuration, pairs, sensors, start.
    pub search: &'a TuneSearch<'a>,
    /// Axes, with power down to the sensor's least.
    pub space: Space,
    /// Parameters that the search before selected.
    pub tuned: Parameters,
    /// Summaries of start and [`Self::tuned`] on the held-out pairs.
    pub judged: [&'a Summary; 2],
    /// Second objective.
    pub cost: CostKind,
}

/// Least error in the logarithm, ‖T − T*‖_F: no pair is registered so well.
const LEAST_ERROR: f64 = 1e-9;

/// Candidates evaluated on all training pairs in the first round, in sizes of the front.
const FIRST_ROUND: usize = 2;
/// Most rounds, the later ones of one size of the front, if too few points are left.
const ROUNDS: usize = 3;

/// Share of its axis by which the power of the first candidates falls: 75 W to 0.6 mW.
const LADDER: f64 = 0.75;

/// Candidate evaluated on all training pairs.
struct Finalist {
    parameters: Parameters,
    values: Objectives,
}

impl FrontSearch<'_> {
    /// First line of this search's journal.
    pub fn header(&self) -> Header {
        let axes = self.space.axes().iter().map(|axis| axis.name.to_owned()).collect();
        Header { axes, ..self.search.header() }
    }

    /// Number of registrations of the search, without those on all training pairs.
    pub fn registrations(&self) -> usize {
        let front = self.search.config.front;
        front.generations as usize * front.population * self.pairs().len()
    }

    /// Searches, and writes each generation to the journal. `done` are generations that the journal
    /// has already.
    ///
    /// # Errors
    ///
    /// [`TuneError`]; whatever happens, the journal holds every whole generation.
    pub fn run(
        &self,
        journal: &mut Journal,
        done: Vec<Generation>,
        observer: &dyn Observer,
    ) -> Result<Front, TuneError> {
        let total = self.search.config.front.generations;
        let mut optimizer = self.replayed(&done)?;
        let mut generations = done;
        while optimizer.generation() < u64::from(total) {
            let Some(generation) = self.generation(&optimizer, &generations, observer)? else {
                return Err(TuneError::Interrupted { generations: generations.len() });
            };
            journal.add(&generation)?;
            self.tell(&mut optimizer, &generation);
            observer.generation(&generation, total);
            generations.push(generation);
        }
        let chosen = self.select(&generations, observer)?;
        self.evaluated_front(chosen, &generations, observer)
    }

    fn optimizer(&self) -> Result<Pareto, TuneError> {
        let seed = derive(self.search.config.seed, Purpose::Front, 0);
        let population = self.search.config.front.population;
        let (starts, dimension) = (self.starts(seed, population), self.space.axes().len());
        Pareto::new(ParetoConfig { starts, dimension, population, seed }).map_err(TuneError::Front)
    }

    /// First candidates: start and selected parameters in turns, each moved farther towards a
    /// random point; for a front of energy with less power each.
    fn starts(&self, seed: u64, population: usize) -> Vec<Vec<f64>> {
        let bases = [self.search.start, self.tuned].map(|base| self.space.point(&base));
        let start = |i: usize| {
            let share = (i / 2) as f64 / (population / 2).max(1) as f64;
            let mut random = Generator::from_key([seed, i as u64, 0, 0]);
            let drawn = |(axis, &own): (usize, &f64)| {
                let any = random.unit();
                match self.is_power(axis) && self.cost == CostKind::Energy {
                    true => own * (1.0 - LADDER * share),
                    false => own + 0.5 * share * (any - own),
                }
            };
            bases[i % 2].iter().enumerate().map(drawn).collect()
        };
        (0..population).map(start).collect()
    }

    fn is_power(&self, axis: usize) -> bool {
        self.space.axes()[axis].name == "lidar.power"
    }

    /// Training pairs of every generation, ascending.
    fn pairs(&self) -> Vec<usize> {
        let all = self.search.bench.dataset.train.len();
        let seed = derive(self.search.config.seed, Purpose::Front, 1);
        let mut pairs: Vec<usize> = (0..all).collect();
        pairs.sort_by_key(|&i| derive(seed, Purpose::Batch, i as u64));
        pairs.truncate(self.search.config.front.pairs);
        pairs.sort_unstable();
        pairs
    }

    /// Optimiser after the generations of a journal.
    fn replayed(&self, done: &[Generation]) -> Result<Pareto, TuneError> {
        let mut optimizer = self.optimizer()?;
        for (number, generation) in done.iter().enumerate() {
            if let Some(field) = self.difference(&optimizer, generation) {
                return Err(TuneError::Diverged { generation: number, field });
            }
            self.tell(&mut optimizer, generation);
        }
        Ok(optimizer)
    }

    /// First field in which a generation of the journal differs from the one that would be drawn
    /// now. Costs need scans and are taken from the journal, as errors are.
    fn difference(&self, optimizer: &Pareto, found: &Generation) -> Option<String> {
        let (drawn, _) = self.draw(optimizer);
        let front = self.search.config.front;
        if optimizer.generation() >= u64::from(front.generations) {
            return Some("generation".into());
        }
        difference(found, &drawn, &|c| self.worth().of(&c.errors))
            .or_else(|| found.candidates.iter().any(|c| c.cost.is_none()).then(|| "cost".into()))
    }

    /// Next generation before any scan, and the parameters of its candidates.
    fn draw(&self, optimizer: &Pareto) -> (Generation, Vec<Parameters>) {
        let (parameters, candidates) = optimizer
            .ask()
            .into_iter()
            .map(|point| CandidateRecord::drawn(&self.space, point))
            .unzip();
        let generation = Generation {
            generation: optimizer.generation() as u32,
            stage: "front".into(),
            pairs: self.pairs(),
            mean: Vec::new(),
            deviations: Vec::new(),
            sigma: 0.0,
            candidates,
        };
        (generation, parameters)
    }

    /// Evaluates the next generation; `None` when interrupted.
    fn generation(
        &self,
        optimizer: &Pareto,
        before: &[Generation],
        observer: &dyn Observer,
    ) -> Result<Option<Generation>, TuneError> {
        let (mut generation, parameters) = self.draw(optimizer);
        let evaluator = Evaluator {
            bench: self.search.bench,
            set: PairsOf::Train,
            stop: self.search.stop,
            observer,
            scanner: Some(self.search.scanner()),
            elsewhere: self.search.elsewhere,
        };
        let seed = self.search.config.seed;
        let task = |parameters, pair| Task {
            parameters,
            pair,
            noise: derive(seed, Purpose::FrontNoise, pair as u64),
        };
        // Noise depends on the pair alone, so a repeated candidate would have the same errors.
        let (mut new, mut untested) = (Vec::new(), Vec::new());
        for (candidate, own) in generation.candidates.iter_mut().zip(&parameters) {
            match same_before(candidate, own, before, &self.space) {
                Some(known) => {
                    known.errors.iter().for_each(|_| observer.evaluated());
                    candidate.errors.clone_from(&known.errors);
                    (candidate.fitness, candidate.cost) = (known.fitness, known.cost);
                }
                None => {
                    new.push(candidate);
                    untested.push(own);
                }
            }
        }
        let pairs = &generation.pairs;
        let each = untested.into_iter();
        let tasks: Vec<Task<'_>> =
            each.flat_map(|own| pairs.iter().map(move |&pair| task(own, pair))).collect();
        let Some(evaluated) = evaluator.evaluate(&tasks)? else { return Ok(None) };
        let each = evaluated.chunks(pairs.len());
        for (candidate, evaluated) in new.into_iter().zip(each) {
            candidate.errors = evaluated.iter().map(|one| one.error.clone()).collect();
            candidate.fitness = self.worth().of(&candidate.errors);
            candidate.cost = mean_cost(evaluated);
        }
        Ok(Some(generation))
    }

    /// Arithmetic mean, whatever the search before used: the front shows it.
    fn worth(&self) -> Worth {
        Worth { mean: ErrorMean::Arithmetic, cap: self.search.config.tune.error_cap }
    }

    fn tell(&self, optimizer: &mut Pareto, generation: &Generation) {
        let values: Vec<Objectives> =
            generation.candidates.iter().map(|candidate| self.values(candidate)).collect();
        // Never refused: `draw` made one candidate for each asked point, and `difference` compared.
        let _ = optimizer.tell(&values);
    }

    fn values(&self, candidate: &CandidateRecord) -> Objectives {
        let cost = candidate.cost.map_or(f64::NAN, |cost| self.cost.of(&cost));
        logarithms(candidate.fitness, cost)
    }

    /// Parameters of the front: the best candidates, start and selected parameters, evaluated on
    /// all training pairs, without the dominated ones and without the most crowded beyond the
    /// limit.
    fn select(
        &self,
        generations: &[Generation],
        observer: &dyn Observer,
    ) -> Result<Vec<Parameters>, TuneError> {
        let most = self.search.config.front.points;
        let mut waiting = self.entrants(generations).into_iter();
        let mut finalists = Vec::new();
        for round in 0..ROUNDS {
            let count = if round == 0 { FIRST_ROUND * most + 2 } else { most };
            let entrants: Vec<Parameters> = waiting.by_ref().take(count).collect();
            let pairs = self.search.bench.dataset.train.len();
            observer.stage("racing", entrants.len() * pairs);
            for parameters in entrants {
                finalists.push(self.finalist(parameters, generations.len(), observer)?);
            }
            if front_of(&finalists).len() >= most {
                break;
            }
        }
        Ok(thinned(front_of(&finalists), most)
            .into_iter()
            .map(|finalist| finalist.parameters)
            .collect())
    }

    /// Start, selected parameters, then every candidate, best first and each once.
    fn entrants(&self, generations: &[Generation]) -> Vec<Parameters> {
        let candidates: Vec<&CandidateRecord> =
            generations.iter().flat_map(|generation| &generation.candidates).collect();
        let values: Vec<Objectives> = candidates.iter().map(|c| self.values(c)).collect();
        let best = sorted_by_crowding(&values).into_iter();
        let best = best.map(|i| self.space.parameters(&candidates[i].point).0);
        let mut seen = BTreeSet::new();
        let all = [self.search.start, self.tuned].into_iter().chain(best);
        all.filter(|parameters| seen.insert(format!("{parameters:?}"))).collect()
    }

    fn finalist(
        &self,
        parameters: Parameters,
        generations: usize,
        observer: &dyn Observer,
    ) -> Result<Finalist, TuneError> {
        if self.search.stop.load(Ordering::Relaxed) {
            return Err(TuneError::Interrupted { generations });
        }
        let noise = Purpose::ShortlistNoise;
        let summary = self.search.summary(&parameters, PairsOf::Train, noise, observer)?;
        let cost = summary.cost.map_or(f64::NAN, |cost| self.cost.of(&cost));
        Ok(Finalist { parameters, values: logarithms(self.worth().of(&summary.errors), cost) })
    }

    /// Front with errors and costs on the held-out pairs.
    fn evaluated_front(
        &self,
        chosen: Vec<Parameters>,
        generations: &[Generation],
        observer: &dyn Observer,
    ) -> Result<Front, TuneError> {
        let values = |parameters: &Parameters| parameters.values(self.search.config);
        let known = [self.search.start, self.tuned].into_iter().zip(self.judged);
        let known: Vec<(Parameters, &Summary)> = known.collect();
        let of_known = |own: &Parameters| known.iter().find(|(other, _)| other == own);
        let rest = chosen.iter().filter(|own| of_known(own).is_none()).count();
        observer.stage("judging front", rest * self.search.bench.dataset.test.len());
        let mut judged: Vec<(Values, Summary)> =
            known.iter().map(|(own, summary)| (values(own), (*summary).clone())).collect();
        for parameters in &chosen {
            if self.search.stop.load(Ordering::Relaxed) {
                return Err(TuneError::Interrupted { generations: generations.len() });
            }
            let summary = match of_known(parameters) {
                Some((_, summary)) => (*summary).clone(),
                None => self.search.judge(parameters, observer)?,
            };
            judged.push((values(parameters), summary));
        }
        Ok(Front::new(self.cost, self.search.config.tune.error_cap, judged))
    }
}

/// First earlier candidate with the same parameters: its child was not changed, or by less than the
/// sensor's steps.
fn same_before<'a>(
    drawn: &CandidateRecord,
    own: &Parameters,
    before: &'a [Generation],
    space: &Space,
) -> Option<&'a CandidateRecord> {
    let mut all = before.iter().flat_map(|generation| &generation.candidates);
    all.find(|c| c.settings == drawn.settings && space.parameters(&c.point).0 == *own)
}

/// Logarithms of error and cost. NaN stays NaN, which ranks last.
fn logarithms(error: f64, cost: f64) -> Objectives {
    let error = if error < LEAST_ERROR { LEAST_ERROR } else { error };
    [libm::log(error), libm::log(cost)]
}

/// Candidates that none dominates; of several with equal values the first.
fn front_of(finalists: &[Finalist]) -> Vec<&Finalist> {
    let is_free =
        |own: &Finalist| !finalists.iter().any(|other| dominates(other.values, own.values));
    let is_first =
        |i: usize| finalists[..i].iter().all(|other| other.values != finalists[i].values);
    let each = finalists.iter().enumerate();
    each.filter(|&(i, own)| is_first(i) && is_free(own)).map(|(_, own)| own).collect()
}

/// At most `most` candidates: the most crowded is removed, one after the other.
fn thinned(mut front: Vec<&Finalist>, most: usize) -> Vec<&Finalist> {
    while front.len() > most {
        let values: Vec<Objectives> = front.iter().map(|finalist| finalist.values).collect();
        let Some(closest) = sorted_by_crowding(&values).pop() else { break };
        front.remove(closest);
    }
    front
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::RunConfig;
    use crate::parameters::Device;

    #[test]
    fn a_front_has_no_dominated_point_and_loses_the_most_crowded_first() {
        let start = Parameters::start(&RunConfig::default(), &Device::REFERENCE).unwrap();
        let finalist = |values| Finalist { parameters: start, values };
        let all: Vec<Finalist> = [
            [1.0, 9.0],
            [2.0, 8.9], // beside the next
            [2.1, 8.8],
            [3.0, 9.5], // dominated
            [5.0, 5.0],
            [5.0, 5.0], // the same again
            [9.0, 1.0],
        ]
        .map(finalist)
        .into();
        let front = front_of(&all);
        assert_eq!(front.len(), 5);
        let values: Vec<Objectives> =
            thinned(front, 4).iter().map(|finalist| finalist.values).collect();
        assert_eq!(values, [[1.0, 9.0], [2.1, 8.8], [5.0, 5.0], [9.0, 1.0]]);
    }

    #[test]
    fn a_candidate_is_recognised_by_its_parameters_alone() {
        let config = RunConfig::default();
        let start = Parameters::start(&config, &Device::REFERENCE).unwrap();
        let (tune, preset) = (&config.tune, config.registration.preset);
        let space = Space::new(tune.protocol, tune.lidar, preset, start, Device::REFERENCE);
        let axis = |name: &str| space.axes().iter().position(|axis| axis.name == name).unwrap();
        let at = |name: &str, change: f64| {
            let mut point = space.start_point();
            point[axis(name)] += change;
            CandidateRecord::drawn(&space, point)
        };
        let generation = |candidates| Generation {
            generation: 0,
            stage: "front".into(),
            pairs: vec![0],
            mean: Vec::new(),
            deviations: Vec::new(),
            sigma: 0.0,
            candidates,
        };
        let before = [
            generation(vec![at("lidar.power", -0.1).1]),
            generation(vec![at("lidar.power", -0.2).1, at("registration.voxel_m", -0.1).1]),
        ];
        let known = |(own, drawn): (Parameters, CandidateRecord)| {
            same_before(&drawn, &own, &before, &space).map(|known| known.point.clone())
        };
        for (name, change) in [("lidar.power", -0.2), ("registration.voxel_m", -0.1)] {
            assert_eq!(known(at(name, change)), Some(at(name, change).1.point), "{name}");
            assert_eq!(known(at(name, change / 4.0)), None, "{name}");
        }
        // Less than a microwatt is the same power.
        assert!(known(at("lidar.power", -0.1 - 1e-12)).is_some());
    }

    #[test]
    fn logarithms_of_zero_are_finite_and_of_nan_stay_nan() {
        assert!(logarithms(0.0, 1.0)[0].is_finite());
        assert!(logarithms(f64::NAN, 1.0)[0].is_nan());
        assert!(!logarithms(0.1, f64::NAN)[1].is_finite());
    }
}
