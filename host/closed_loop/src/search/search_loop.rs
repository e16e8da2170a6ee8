//! The stages of a run, one after the other, and the choice at the end.

use std::collections::VecDeque;

use echoloop_cmaes::{CmaEs, CmaEsConfig};

use super::CONSTANTS;
use super::batch::{Crew, Task};
use super::final_selection::Race;
use super::fitness::{Price, mean_cost};
use super::origin::Origin;
use super::replay::difference;
use super::stage::Stage;
use super::tune_search::{Check, Finalist, Observer, TuneError, TuneSearch, Tuned};
use crate::config::preset::Strategy;
use crate::evaluation::objective::{PairError, Worth};
use crate::evaluation::summary::{median, succeeds};
use crate::parameters::Parameters;
use crate::run_folder::journal::{CandidateRecord, Generation, Journal};
use crate::seed::{Purpose, derive};

impl TuneSearch<'_> {
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
        Course::new(self, journal, done, observer).run()
    }
}

/// A run on its way.
struct Course<'a> {
    search: &'a TuneSearch<'a>,
    journal: &'a mut Journal,
    crew: Crew<'a>,
    /// Generations that the journal had and that have not been gone through yet.
    ahead: VecDeque<Generation>,
    generations: Vec<Generation>,
    /// Generations of all stages.
    total: u32,
    /// How often each training pair is drawn, compared with the others.
    turns: Vec<f64>,
    price: Price<'a>,
}

impl<'a> Course<'a> {
    fn new(
        search: &'a TuneSearch<'a>,
        journal: &'a mut Journal,
        done: Vec<Generation>,
        observer: &'a dyn Observer,
    ) -> Self {
        let config = search.config;
        let price = Price { tune: &config.tune, data: &config.data, start: Vec::new() };
        let scanner = config.tune.counts_costs().then(|| search.scanner());
        let pairs = &search.bench.dataset.train;
        let crew = Crew { bench: search.bench, pairs, stop: search.stop, observer, scanner };
        let turns = vec![1.0; pairs.len()];
        let total = search.stages().iter().map(|stage| stage.generations).sum();
        Self {
            search,
            journal,
            crew,
            ahead: done.into(),
            generations: Vec::new(),
            total,
            turns,
            price,
        }
    }

    fn run(mut self) -> Result<Tuned, TuneError> {
        match self.search.config.tune.strategy {
            Strategy::Paper => self.paper(),
            Strategy::Fast => self.fast(),
        }
    }

    /// One search; its best candidate is the choice (Sec. 4.2).
    fn paper(&mut self) -> Result<Tuned, TuneError> {
        let start = self.search.space.start_point();
        let mut optimizer = None;
        for stage in &self.search.stages() {
            optimizer = Some(self.walk(stage, &start)?);
        }
        self.ends()?;
        let candidates = self.generations.iter().flat_map(|generation| {
            generation.candidates.iter().enumerate().map(move |(i, c)| (generation, i, c))
        });
        let best = candidates.min_by(|a, b| a.2.fitness.total_cmp(&b.2.fitness));
        let Some((generation, i, best)) = best else { return Ok(self.untuned()) };
        // Nothing to choose by: the first of equals is no better than the start.
        if self.nothing_found(&[]).is_some() {
            return Ok(self.untuned());
        }
        let origin = origin(generation, i);
        let finalist = Finalist {
            origin: origin.to_string(),
            values: best.values.clone(),
            fitness: best.fitness,
            pairs: best.errors.len(),
        };
        let (parameters, _) = self.search.space.parameters(&best.point);
        Ok(self.tuned(parameters, origin, vec![finalist], optimizer.as_ref(), &[]))
    }

    /// The halves, each from the best of start and warm starts; then one search after the other,
    /// each from the winner of the one before, the first from registration's.
    fn fast(&mut self) -> Result<Tuned, TuneError> {
        let search = self.search;
        let stages = search.stages();
        let mut race = Race::new(search.bench.dataset.train.len(), search.config.seed);
        let mut at = race.enter(Origin::Start, search.start);
        if !stages.is_empty() {
            self.winner(&mut race, at, Vec::new())?;
            self.price.start = race.judged(at).to_vec();
            self.expect_something_to_keep()?;
            self.turns = harder_oftener(&self.losses_of_start());
        }
        let mut winners = vec![at];
        if !stages.is_empty() && !search.warm_starts.is_empty() {
            let each = search.warm_starts.iter().enumerate();
            let warm = each.map(|(i, who)| race.enter(Origin::WarmStart(i + 1), *who));
            let warm = warm.collect();
            at = self.winner(&mut race, at, warm)?;
            winners.push(at);
        }
        let (halves, beside): (Vec<Stage>, Vec<Stage>) =
            stages.into_iter().partition(Stage::is_from_the_start);
        let (begin, mut last) = (at, None);
        let before = winners.clone();
        for half in &halves {
            let (runners, optimizer) = self.runners(half, &mut race, begin)?;
            let runners = [&before[..], &runners].concat();
            at = self.winner(&mut race, begin, runners)?;
            winners.push(at);
            last = Some(optimizer);
        }
        // Of two halves registration's: that a sensor should change is what is to be shown.
        let half = at;
        for (number, stage) in beside.iter().enumerate() {
            let is_last = number + 1 == beside.len();
            let mut runners = winners.clone();
            // Where registration keeps what it began at the sensor was searched from there already.
            if !is_last && half == begin {
                self.total -= stage.generations;
            } else {
                let (own, optimizer) = self.runners(stage, &mut race, at)?;
                runners.extend(own);
                last = Some(optimizer);
            }
            at = self.winner(&mut race, if is_last { half } else { at }, runners)?;
            winners.push(at);
        }
        self.ends()?;
        let checked = match at == half {
            true => None,
            false => self.checked(&race, half, at)?,
        };
        let mut errors = race.errors();
        errors.extend(checked.iter().flat_map(|(race, _)| race.errors()));
        let check = checked.as_ref().map(|(_, check)| *check);
        if check.is_some_and(|check| !check.holds) {
            at = half;
        }
        let origin = race.origin(at).clone();
        let values = |parameters: &Parameters| search.searched_values(parameters);
        let (parameters, finalists) = (*race.parameters(at), race.finalists(&self.price, values));
        Ok(Tuned { check, ..self.tuned(parameters, origin, finalists, last.as_ref(), &errors) })
    }

    /// Whether the choice stands on pairs that no search has seen: those of the races were seen by
    /// the searches, and of several that are no better one is easily ahead on them. `None` without
    /// such pairs, or where costs decide, which are exact.
    fn checked(
        &self,
        race: &Race,
        half: usize,
        at: usize,
    ) -> Result<Option<(Race, Check)>, TuneError> {
        let search = self.search;
        let pairs = &search.bench.dataset.check[..];
        if pairs.is_empty() || !TuneSearch::is_checked(&search.stages(), search.config) {
            return Ok(None);
        }
        let crew = Crew { pairs, ..self.crew };
        let mut last = Race::new(pairs.len(), derive(search.config.seed, Purpose::Check, 0));
        let [half, at] =
            [half, at].map(|i| last.enter(race.origin(i).clone(), *race.parameters(i)));
        // A holder has seen all pairs: it is who others are compared with.
        self.winner_by(&crew, &mut last, half, Vec::new())?;
        let winner = self.winner_by(&crew, &mut last, half, vec![at])?;
        let seen = last.judged(at).len();
        let ahead = last.behind(half, at, seen, &self.price).unwrap_or_default();
        // Where every pair says the same it is infinite, which is no number of JSON.
        let ahead = ahead.clamp(-99.0, 99.0);
        Ok(Some((last, Check { pairs: seen, ahead, holds: winner == at })))
    }

    /// Searches a stage from one of the race, and enters who could win.
    fn runners(
        &mut self,
        stage: &Stage,
        race: &mut Race,
        from: usize,
    ) -> Result<(Vec<usize>, CmaEs), TuneError> {
        let base = self.search.space.point(race.parameters(from));
        let optimizer = self.walk(stage, &base)?;
        let entrants = self.shortlist(stage, &optimizer, &base);
        let runners = entrants.into_iter().map(|(origin, who)| race.enter(origin, who)).collect();
        Ok((runners, optimizer))
    }

    /// Where a cost is to be least the start must find something: a blind sensor is no worse than
    /// one that finds nothing, and costs less.
    fn expect_something_to_keep(&self) -> Result<(), TuneError> {
        let (start, config) = (&self.price.start, self.search.config);
        let finds = start.iter().any(|judged| succeeds(&judged.error, &config.data));
        match config.tune.minimise {
            Some(_) if !finds => Err(TuneError::NothingToKeep { pairs: start.len() }),
            _ => Ok(()),
        }
    }

    fn losses_of_start(&self) -> Vec<f64> {
        let worth = Worth::from(&self.search.config.tune);
        self.price.start.iter().map(|judged| worth.loss(&judged.error)).collect()
    }

    /// Who wins: the holder, or one of the runners.
    fn winner(
        &self,
        race: &mut Race,
        holder: usize,
        runners: Vec<usize>,
    ) -> Result<usize, TuneError> {
        self.winner_by(&self.crew, race, holder, runners)
    }

    /// The same, on the pairs of a crew.
    fn winner_by(
        &self,
        crew: &Crew<'_>,
        race: &mut Race,
        holder: usize,
        runners: Vec<usize>,
    ) -> Result<usize, TuneError> {
        let most = (1 + runners.len()) * crew.pairs.len();
        crew.observer.stage("choosing", most);
        let judge = |tasks: &[Task<'_>]| crew.judged(tasks);
        let winner = race.winner(holder, runners, &self.price, &judge)?;
        winner.ok_or_else(|| self.interrupted())
    }

    fn interrupted(&self) -> TuneError {
        TuneError::Interrupted { generations: self.generations.len() }
    }

    /// Whether the journal ends where the search does.
    fn ends(&self) -> Result<(), TuneError> {
        match self.ahead.is_empty() {
            true => Ok(()),
            false => Err(TuneError::Diverged {
                generation: self.generations.len(),
                field: "generation, after the search's end,".into(),
            }),
        }
    }

    fn untuned(&mut self) -> Tuned {
        self.tuned(self.search.start, Origin::Start, Vec::new(), None, &[])
    }

    fn tuned(
        &mut self,
        parameters: Parameters,
        origin: Origin,
        finalists: Vec<Finalist>,
        optimizer: Option<&CmaEs>,
        raced: &[&PairError],
    ) -> Tuned {
        let nothing_found = self.nothing_found(raced);
        let generations = std::mem::take(&mut self.generations);
        let searched = generations.iter().map(|g| g.candidates.len() * g.pairs.len());
        Tuned {
            parameters,
            origin: origin.to_string(),
            finalists,
            registrations: searched.sum::<usize>() + raced.len(),
            nothing_found,
            check: None,
            correlations: optimizer.map(CmaEs::correlations).unwrap_or_default(),
            covariance_learned: optimizer.map_or(0.0, CmaEs::covariance_learned),
            generations,
        }
    }

    /// Why the last registration stopped, if none of the search and of those raced found a motion.
    fn nothing_found(&self, raced: &[&PairError]) -> Option<String> {
        let candidates = self.generations.iter().flat_map(|generation| &generation.candidates);
        let searched = candidates.flat_map(|candidate| &candidate.errors);
        let mut errors = searched.chain(raced.iter().copied());
        errors
            .clone()
            .all(PairError::is_of_no_motion)
            .then(|| errors.next_back())?
            .map(|error| error.stop.clone())
    }

    /// One stage's search from a point of the whole cube; generations that the journal has are
    /// compared with those that would be drawn now.
    fn walk(&mut self, stage: &Stage, base: &[f64]) -> Result<CmaEs, TuneError> {
        self.crew.observer.stage(stage.name, stage.registrations());
        let mut optimizer = self.optimizer(stage, base)?;
        for turn in stage.place.generations.. {
            if optimizer.stop().is_some() {
                break;
            }
            let (drawn, parameters) = self.draw(stage, turn, &optimizer, base);
            let generation = match self.ahead.pop_front() {
                Some(found) => self.same(found, &drawn)?,
                None => {
                    let evaluated = self.evaluated(drawn, turn, &parameters)?;
                    self.journal.add(&evaluated)?;
                    evaluated
                }
            };
            let values: Vec<f64> = generation.candidates.iter().map(|c| c.fitness).collect();
            // There is a candidate for each that was asked for: drawn here, or compared with it.
            let _ = optimizer.tell(&values);
            self.crew.observer.generation(&generation, self.total);
            self.generations.push(generation);
        }
        Ok(optimizer)
    }

    /// A generation of the journal, when it is the one that is drawn now.
    fn same(&self, found: Generation, drawn: &Generation) -> Result<Generation, TuneError> {
        match difference(&found, drawn, &self.price) {
            None => Ok(found),
            Some(field) => Err(TuneError::Diverged { generation: self.generations.len(), field }),
        }
    }

    fn optimizer(&self, stage: &Stage, base: &[f64]) -> Result<CmaEs, TuneError> {
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

    /// The next generation as far as it is known before a scan: without errors and fitness. And its
    /// candidates' parameters. `turn` is its number in its line of searches.
    fn draw(
        &self,
        stage: &Stage,
        turn: u32,
        optimizer: &CmaEs,
        base: &[f64],
    ) -> (Generation, Vec<Parameters>) {
        let number = self.generations.len();
        let points = optimizer.ask().into_iter().map(|c| stage.expanded(&c.phenotype, base));
        let space = &self.search.space;
        let (parameters, candidates) =
            points.map(|point| CandidateRecord::drawn(space, point)).unzip();
        let still = vec![0.0; base.len()];
        let generation = Generation {
            generation: number as u32,
            stage: stage.name.to_owned(),
            pairs: self.batch(turn.into(), stage.pairs),
            mean: stage.expanded(optimizer.mean(), base),
            deviations: stage.expanded(&optimizer.deviations(), &still),
            sigma: optimizer.sigma(),
            candidates,
        };
        (generation, parameters)
    }

    /// Evaluates one generation: every candidate on the same pairs.
    fn evaluated(
        &self,
        mut generation: Generation,
        turn: u32,
        parameters: &[Parameters],
    ) -> Result<Generation, TuneError> {
        let config = &self.search.config.tune;
        let seed = self.search.config.seed;
        let noise = |candidate: usize, pair: usize| {
            let own = if config.common_noise { 0 } else { candidate as u64 + 1 };
            // Each part has bits of its own, so no two registrations draw the same noise by chance.
            derive(seed, Purpose::TrainNoise, u64::from(turn) << 32 | (pair as u64) << 16 | own)
        };
        let each = parameters.iter().enumerate();
        let tasks: Vec<Task<'_>> = each
            .flat_map(|(candidate, parameters)| {
                let task = move |&pair| Task { parameters, pair, noise: noise(candidate, pair) };
                generation.pairs.iter().map(task).collect::<Vec<_>>()
            })
            .collect();
        let judged = self.crew.judged(&tasks)?.ok_or_else(|| self.interrupted())?;
        let each = judged.chunks(generation.pairs.len());
        for (candidate, judged) in generation.candidates.iter_mut().zip(each) {
            candidate.errors = judged.iter().map(|judged| judged.error.clone()).collect();
            candidate.cost = mean_cost(judged);
            candidate.fitness = self.price.fitness(&candidate.errors, candidate.cost.as_ref());
        }
        Ok(generation)
    }

    /// The pairs of a generation: some of all, drawn by weight without repetition, ascending.
    fn batch(&self, generation: u64, count: usize) -> Vec<usize> {
        let mut indices: Vec<usize> = (0..self.turns.len()).collect();
        let seed = derive(self.search.config.seed, Purpose::Batch, generation);
        // The least of exponential variates of these rates (Efraimidis and Spirakis 2006).
        let turn = |i: usize| {
            let uniform =
                (derive(seed, Purpose::Batch, i as u64) >> 11) as f64 / (1u64 << 53) as f64;
            -libm::log1p(-uniform) / self.turns[i]
        };
        indices.sort_by(|&a, &b| turn(a).total_cmp(&turn(b)));
        indices.truncate(count);
        indices.sort_unstable();
        indices
    }

    /// Who could win of a stage: its mean, and its best candidates, of each generation the best.
    fn shortlist(
        &self,
        stage: &Stage,
        optimizer: &CmaEs,
        base: &[f64],
    ) -> Vec<(Origin, Parameters)> {
        let space = &self.search.space;
        // The first half of the search was still on its way; one may have ended early.
        let own = self.generations.iter().filter(|generation| generation.stage == stage.name);
        let late = &self.generations[self.generations.len() - own.count() / 2..];
        let mut best: Vec<(f64, &Generation, usize)> = late.iter().filter_map(best_of).collect();
        best.reverse(); // the later generations first among equals
        best.sort_by(|a, b| a.0.total_cmp(&b.0));
        best.truncate(self.search.config.tune.shortlist);
        let mean = stage.expanded(optimizer.mean(), base);
        let of_mean = Origin::Mean { stage: stage.name.to_owned() };
        let mut entrants = vec![(of_mean, space.parameters(&mean).0)];
        entrants.extend(best.into_iter().map(|(_, generation, i)| {
            (origin(generation, i), space.parameters(&generation.candidates[i].point).0)
        }));
        entrants
    }
}

/// The best of a generation, compared with its median: pairs differ in difficulty from batch to
/// batch.
fn best_of(generation: &Generation) -> Option<(f64, &Generation, usize)> {
    let fitness = |i: usize| generation.candidates[i].fitness;
    let best =
        (0..generation.candidates.len()).min_by(|&a, &b| fitness(a).total_cmp(&fitness(b)))?;
    let median = median(generation.candidates.iter().map(|c| c.fitness));
    Some((fitness(best) / median.max(f64::MIN_POSITIVE), generation, best))
}

/// Weights of pairs by what the start loses on them: from 1 for the easiest evenly up to
/// [`HARDEST`]. Those that it solves say little, and those that nobody solves say nothing, so none
/// is left out and none decides.
fn harder_oftener(losses: &[f64]) -> Vec<f64> {
    let easier = |i: usize| {
        let before = |j: &usize| losses[*j].total_cmp(&losses[i]).then(j.cmp(&i)).is_lt();
        (0..losses.len()).filter(before).count() as f64
    };
    let most = losses.len().saturating_sub(1).max(1) as f64;
    (0..losses.len()).map(|i| 1.0 + (HARDEST - 1.0) * easier(i) / most).collect()
}

/// How much oftener the hardest training pair is drawn than the easiest.
const HARDEST: f64 = 3.0;

fn origin(generation: &Generation, candidate: usize) -> Origin {
    let stage = generation.stage.clone();
    Origin::Candidate { stage, generation: generation.generation, candidate }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_harder_a_pair_is_for_the_start_the_oftener_it_is_drawn() {
        assert_eq!(harder_oftener(&[0.5, -2.0, 7.0]), [2.0, 1.0, HARDEST]);
        let alike = harder_oftener(&[0.1; 5]);
        assert!(alike.is_sorted() && (alike[0], alike[4]) == (1.0, HARDEST), "{alike:?}");
        assert_eq!(harder_oftener(&[3.0]), [1.0]);
        assert!(harder_oftener(&[]).is_empty());
    }
}
