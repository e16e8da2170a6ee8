//! The two strategies: order of the stages, and the choice at the end.

use super::batch::{Evaluator, Task};
use super::final_selection::FinalSelection;
use super::origin::Origin;
use super::search_run::SearchRun;
use super::shortlist::shortlist;
use super::stage::Stage;
use super::tune_search::{Check, Finalist, Observer, TuneError, TuneSearch, Tuned};
use crate::config::preset::Strategy;
use crate::evaluation::objective::Worth;
use crate::evaluation::summary::succeeds;
use crate::parameters::Parameters;
use crate::run_folder::journal::{Generation, Journal};
use crate::seed::{Purpose, derive};
use echoloop_cmaes::CmaEs;

/// Weight of the hardest training pair in the draw; the easiest has 1.
const HARDEST: f64 = 3.0;

impl TuneSearch<'_> {
    /// Searches, writing each generation to the journal. `done` are the generations that the
    /// journal holds already.
    ///
    /// # Errors
    ///
    /// [`TuneError`]; in every case the journal holds each whole generation.
    pub fn run(
        &self,
        journal: &mut Journal,
        done: Vec<Generation>,
        observer: &dyn Observer,
    ) -> Result<Tuned, TuneError> {
        let run = SearchRun::new(self, journal, done, observer);
        match self.config.tune.strategy {
            Strategy::Paper => run.paper(),
            Strategy::Fast => run.fast(),
        }
    }
}

impl SearchRun<'_> {
    /// One search, whose best candidate is the choice (Sec. 4.2).
    fn paper(mut self) -> Result<Tuned, TuneError> {
        let start = self.search.space.start_point();
        let mut optimizer = None;
        for stage in &self.search.stages() {
            optimizer = Some(self.closed_loop(stage, &start)?);
        }
        self.expect_end_of_journal()?;
        let candidates = self.generations.iter().flat_map(|generation| {
            generation.candidates.iter().enumerate().map(move |(i, c)| (generation, i, c))
        });
        let best = candidates.min_by(|a, b| a.2.fitness.total_cmp(&b.2.fitness));
        let Some((generation, i, best)) = best else { return Ok(self.untuned()) };
        // Where no candidate found a motion all have the same fitness: the first is no better than
        // the start.
        if self.nothing_found(&[]).is_some() {
            return Ok(self.untuned());
        }
        let origin = Origin::of(generation, i);
        let finalist = Finalist {
            origin: origin.to_string(),
            values: best.values.clone(),
            fitness: best.fitness,
            pairs: best.errors.len(),
        };
        let (parameters, _) = self.search.space.parameters(&best.point);
        Ok(self.tuned(parameters, origin, vec![finalist], optimizer.as_ref(), &[]))
    }

    /// Each protocol part from the best of start and warm starts; then one stage after the other,
    /// each from the winner of the one before, the first of them from registration's.
    fn fast(mut self) -> Result<Tuned, TuneError> {
        let search = self.search;
        let stages = search.stages();
        let mut selection =
            FinalSelection::new(search.bench.dataset.train.len(), search.config.seed);
        let mut incumbent = selection.enter(Origin::Start, search.start);
        if !stages.is_empty() {
            self.select(&mut selection, incumbent, Vec::new())?;
            self.fitness.start = selection.results(incumbent).to_vec();
            self.expect_something_to_keep()?;
            self.pair_weights = weights_by_difficulty(&self.losses_of_start());
        }
        let mut winners = vec![incumbent];
        if !stages.is_empty() && !search.warm_starts.is_empty() {
            let each = search.warm_starts.iter().enumerate();
            let warm = each.map(|(i, own)| selection.enter(Origin::WarmStart(i + 1), *own));
            let warm = warm.collect();
            incumbent = self.select(&mut selection, incumbent, warm)?;
            winners.push(incumbent);
        }
        let (parts, later): (Vec<Stage>, Vec<Stage>) =
            stages.into_iter().partition(Stage::is_from_the_start);
        let (begin, mut optimizer) = (incumbent, None);
        let before = winners.clone();
        for part in &parts {
            let (finalists, own) = self.finalists(part, &mut selection, begin)?;
            incumbent = self.select(&mut selection, begin, [&before[..], &finalists].concat())?;
            winners.push(incumbent);
            optimizer = Some(own);
        }
        // The parts end with registration. Its winner is what tuning the sensor, too, has to beat.
        let registration = incumbent;
        for (number, stage) in later.iter().enumerate() {
            let is_last = number + 1 == later.len();
            let mut finalists = winners.clone();
            // Where registration keeps what it began at, the sensor was searched from there
            // already.
            if !is_last && registration == begin {
                self.total -= stage.generations;
            } else {
                let (found, own) = self.finalists(stage, &mut selection, incumbent)?;
                finalists.extend(found);
                optimizer = Some(own);
            }
            let from = if is_last { registration } else { incumbent };
            incumbent = self.select(&mut selection, from, finalists)?;
            winners.push(incumbent);
        }
        self.expect_end_of_journal()?;
        let checked = match incumbent == registration {
            true => None,
            false => self.checked(&selection, registration, incumbent)?,
        };
        let mut errors = selection.errors();
        errors.extend(checked.iter().flat_map(|(selection, _)| selection.errors()));
        let check = checked.as_ref().map(|(_, check)| *check);
        if check.is_some_and(|check| !check.holds) {
            incumbent = registration;
        }
        let origin = selection.origin(incumbent).clone();
        let values = |parameters: &Parameters| search.space.values(parameters);
        let parameters = *selection.parameters(incumbent);
        let finalists = selection.finalists(&self.fitness, values);
        Ok(Tuned {
            check,
            ..self.tuned(parameters, origin, finalists, optimizer.as_ref(), &errors)
        })
    }

    /// Compares the choice with registration's winner on pairs that no search has seen: on pairs
    /// of a search the best of several equals is easily ahead by chance. `None` without such pairs,
    /// or where an exact cost decides.
    fn checked(
        &self,
        selection: &FinalSelection,
        registration: usize,
        choice: usize,
    ) -> Result<Option<(FinalSelection, Check)>, TuneError> {
        let search = self.search;
        let pairs = &search.bench.dataset.check[..];
        if pairs.is_empty() || !TuneSearch::is_checked(&search.stages(), search.config) {
            return Ok(None);
        }
        let evaluator = Evaluator { pairs, ..self.evaluator };
        let seed = derive(search.config.seed, Purpose::Check, 0);
        let mut check = FinalSelection::new(pairs.len(), seed);
        let [registration, choice] = [registration, choice]
            .map(|i| check.enter(selection.origin(i).clone(), *selection.parameters(i)));
        // The incumbent has to be evaluated on all pairs before anybody is compared with it.
        self.select_on(&evaluator, &mut check, registration, Vec::new())?;
        let winner = self.select_on(&evaluator, &mut check, registration, vec![choice])?;
        let seen = check.results(choice).len();
        let ahead = check.behind(registration, choice, seen, &self.fitness).unwrap_or_default();
        // It is infinite where every pair differs by the same amount; JSON has no such number.
        let ahead = ahead.clamp(-99.0, 99.0);
        Ok(Some((check, Check { pairs: seen, ahead, holds: winner == choice })))
    }

    /// Searches a stage from one of the selection, and enters its shortlist.
    fn finalists(
        &mut self,
        stage: &Stage,
        selection: &mut FinalSelection,
        from: usize,
    ) -> Result<(Vec<usize>, CmaEs), TuneError> {
        let space = &self.search.space;
        let base = space.point(selection.parameters(from));
        let optimizer = self.closed_loop(stage, &base)?;
        let count = self.search.config.tune.shortlist;
        let list = shortlist(stage, &optimizer, &self.generations, (space, &base), count);
        let entered = list.into_iter().map(|(origin, own)| selection.enter(origin, own));
        Ok((entered.collect(), optimizer))
    }

    /// Index of the winner among the incumbent and some finalists, on all training pairs.
    fn select(
        &self,
        selection: &mut FinalSelection,
        incumbent: usize,
        finalists: Vec<usize>,
    ) -> Result<usize, TuneError> {
        self.select_on(&self.evaluator, selection, incumbent, finalists)
    }

    /// The same on an evaluator's pairs.
    fn select_on(
        &self,
        evaluator: &Evaluator<'_>,
        selection: &mut FinalSelection,
        incumbent: usize,
        finalists: Vec<usize>,
    ) -> Result<usize, TuneError> {
        let most = (1 + finalists.len()) * evaluator.pairs.len();
        evaluator.observer.stage("choosing", most);
        let evaluate = |tasks: &[Task<'_>]| evaluator.evaluate(tasks);
        let winner = selection.winner(incumbent, finalists, &self.fitness, &evaluate)?;
        winner.ok_or_else(|| self.interrupted())
    }

    /// Refuses to minimise a cost from a start that registers no pair: no limit would hold a
    /// candidate then, and a blind sensor costs least.
    fn expect_something_to_keep(&self) -> Result<(), TuneError> {
        let (start, config) = (&self.fitness.start, self.search.config);
        let finds = start.iter().any(|result| succeeds(&result.error, &config.data));
        match config.tune.minimise {
            Some(_) if !finds => Err(TuneError::NothingToKeep { pairs: start.len() }),
            _ => Ok(()),
        }
    }

    fn losses_of_start(&self) -> Vec<f64> {
        let worth = Worth::from(&self.search.config.tune);
        self.fitness.start.iter().map(|result| worth.loss(&result.error)).collect()
    }
}

/// Weights of pairs by rank of the start's loss on them, from 1 for the easiest to [`HARDEST`].
/// Pairs that the start solves say little, and those that nobody solves say nothing, so none is
/// left out and none decides.
fn weights_by_difficulty(losses: &[f64]) -> Vec<f64> {
    let rank = |i: usize| {
        let before = |j: &usize| losses[*j].total_cmp(&losses[i]).then(j.cmp(&i)).is_lt();
        (0..losses.len()).filter(before).count() as f64
    };
    let most = losses.len().saturating_sub(1).max(1) as f64;
    (0..losses.len()).map(|i| 1.0 + (HARDEST - 1.0) * rank(i) / most).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_harder_for_the_start_are_drawn_more_often() {
        assert_eq!(weights_by_difficulty(&[0.5, -2.0, 7.0]), [2.0, 1.0, HARDEST]);
        let alike = weights_by_difficulty(&[0.1; 5]);
        assert!(alike.is_sorted() && (alike[0], alike[4]) == (1.0, HARDEST), "{alike:?}");
        assert_eq!(weights_by_difficulty(&[3.0]), [1.0]);
        assert!(weights_by_difficulty(&[]).is_empty());
    }
}
