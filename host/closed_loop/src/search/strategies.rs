//! The two strategies: order of the stages, and the choice at the end.

use super::batch::{Evaluator, Task};
use super::elsewhere::PairsOf;
use super::final_selection::FinalSelection;
use super::fitness::Fitness;
use super::origin::Origin;
use super::search_run::SearchRun;
use super::shortlist::shortlist;
use super::stage::Stage;
use super::survey::survey;
use super::tune_search::{Check, Finalist, Observer, TuneError, TuneSearch, Tuned};
use crate::config::TuneConfig;
use crate::config::preset::{Sampler, Strategy};
use crate::evaluation::objective::Worth;
use crate::evaluation::summary::succeeds;
use crate::parameters::Parameters;
use crate::run_folder::journal::{Generation, Journal};
use crate::seed::{Purpose, derive};
use echoloop_cmaes::CmaEs;

/// Weight of the hardest training pair in the draw; the easiest has 1.
const HARDEST: f64 = 3.0;

/// Lead in standard errors with which an aim of the survey becomes the search's beginning: the best
/// of 32 that are no better has the one that a finalist needs as a rule.
const SURVEYED: f64 = 2.0;

/// Finalists next to the choice that are checked, too.
const NEXT: usize = 3;

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
            optimizer = self.closed_loop(&[(stage, start.clone())])?.pop();
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

    /// Both halves from the best of start, warm starts and survey, side by side; each again from
    /// the other's winner; then registration's axes, and all, from the best so far, to which the
    /// winners of both halves put together belong.
    fn fast(mut self) -> Result<Tuned, TuneError> {
        let search = self.search;
        let stages = search.stages();
        let mut lines = stages.chunk_by(|one, next| one.place == next.place);
        let mut selection =
            FinalSelection::new(search.bench.dataset.train.len(), search.config.seed);
        let start = selection.enter(Origin::Start, search.start);
        let (given, begin) = self.begin(&stages, &mut selection, start)?;
        let mut winners = vec![start, begin];
        let halves = lines.next().unwrap_or_default();
        let from_begin: Vec<_> = halves.iter().map(|half| (half, begin)).collect();
        let (found, mut optimizer) = self.finalists(&from_begin, &mut selection)?;
        for finalists in found {
            let among = [&[start, begin][..], &finalists].concat();
            winners.push(self.select(&mut selection, begin, among)?);
        }
        // A half's winner has to be beaten by whatever moves the other half, too: registration's,
        // as it leaves the sensor alone.
        let of_half = winners[winners.len() - 1];
        let mut choice = of_half;
        if let [_, _, lidar, registration] = winners[..] {
            // Where a half keeps what it began at, the other's winner is both already.
            if ![lidar, registration].contains(&begin) {
                let own = Parameters {
                    registration: selection.parameters(registration).registration,
                    ..*selection.parameters(lidar)
                };
                winners.push(selection.enter(Origin::Combined, own));
            }
            choice = self.select(&mut selection, choice, winners.clone())?;
            // From where the other half was moved to, if it was.
            let from = |other, own| if other == begin { own } else { other };
            let bases = [from(lidar, registration), from(registration, lidar)];
            let again = lines.next().unwrap_or_default();
            let again: Vec<_> = again.iter().zip(bases).collect();
            let (found, _) = self.finalists(&again, &mut selection)?;
            let among = [&winners[..], &found.concat()].concat();
            choice = self.select(&mut selection, choice, among)?;
        }
        for stage in lines.flatten() {
            let (found, last) = self.finalists(&[(stage, choice)], &mut selection)?;
            optimizer = last.or(optimizer);
            choice = self.select(&mut selection, choice, found.concat())?;
        }
        self.expect_end_of_journal()?;
        let mut simpler = winners[1..].to_vec();
        if choice != of_half {
            simpler.extend(selection.best(NEXT, &self.fitness).into_iter().rev());
        }
        let checked = self.checked(&selection, &given, &simpler, choice)?;
        let mut errors = selection.errors();
        let mut check = None;
        if let Some((on_check_pairs, standing, result)) = &checked {
            errors.extend(on_check_pairs.errors());
            (choice, check) = (*standing, Some(result.clone()));
        }
        let origin = selection.origin(choice).clone();
        let values = |parameters: &Parameters| search.space.values(parameters);
        let parameters = *selection.parameters(choice);
        let finalists = selection.finalists(&self.fitness, values);
        Ok(Tuned {
            check,
            ..self.tuned(parameters, origin, finalists, optimizer.as_ref(), &errors)
        })
    }

    /// The start and the warm starts, and the best of them and of the survey from there, where the
    /// search begins.
    fn begin(
        &mut self,
        stages: &[Stage],
        selection: &mut FinalSelection,
        start: usize,
    ) -> Result<(Vec<usize>, usize), TuneError> {
        let TuneSearch { config, space, warm_starts, .. } = self.search;
        let mut given = vec![start];
        if stages.is_empty() {
            return Ok((given, start));
        }
        self.select(selection, start, Vec::new())?;
        self.fitness.start = selection.results(start).to_vec();
        self.expect_something_to_keep()?;
        self.pair_weights = weights_by_difficulty(&self.losses_of_start());
        let each = warm_starts.iter().enumerate();
        given.extend(each.map(|(i, own)| selection.enter(Origin::WarmStart(i + 1), *own)));
        let begin = self.select(selection, start, given[1..].to_vec())?;
        self.fitness.given = selection.results(begin).to_vec();
        let count = match config.tune.sampler {
            Sampler::CmaEs => config.tune.survey,
            Sampler::Random => 0, // it looks everywhere already
        };
        let aims = survey(space, selection.parameters(begin), count).into_iter().enumerate();
        let aims = aims.map(|(i, own)| selection.enter(Origin::Survey(i + 1), own)).collect();
        let best = self.select(selection, begin, aims)?;
        let seen = selection.results(best).len();
        let is_sure =
            selection.ahead(best, begin, seen, &self.fitness).is_none_or(|a| a > SURVEYED);
        Ok((given, if is_sure { best } else { begin }))
    }

    /// Compares the choice with what was `given`, the start first, and with the `simpler` ones, on
    /// pairs that no search has seen: on pairs of a search the best of several equals is easily
    /// ahead by chance. Each has to be ahead of what stands before it. Those next to the choice are
    /// among them: it may lose a pair here that they keep. Returns what stands in the end; `None`
    /// without such pairs, where an exact cost decides, or where the start is the choice.
    fn checked(
        &self,
        selection: &FinalSelection,
        given: &[usize],
        simpler: &[usize],
        choice: usize,
    ) -> Result<Option<(FinalSelection, usize, Check)>, TuneError> {
        let search = self.search;
        let pairs = &search.bench.dataset.check[..];
        let is_checked = TuneSearch::is_checked(&search.stages(), search.config);
        if choice == given[0] || pairs.is_empty() || !is_checked {
            return Ok(None);
        }
        let each = in_order(given, simpler, choice);
        let evaluator = Evaluator { set: PairsOf::Check, ..self.evaluator };
        let seed = derive(search.config.seed, Purpose::Check, 0);
        let mut check = FinalSelection::new(pairs.len(), seed);
        for &i in &each {
            check.enter(selection.origin(i).clone(), *selection.parameters(i)); // no two are equal
        }
        let last = each.len() - 1;
        evaluator.observer.stage("checking", each.len() * pairs.len());
        // What stands has to be evaluated on all pairs before anybody is compared with it.
        self.select_on((&evaluator, &self.fitness), &mut check, 0, Vec::new())?;
        // Of these pairs, too, what stands is held to what the best that was given loses.
        let of_start = check.results(0).to_vec();
        let mut fitness = Fitness { given: of_start.clone(), start: of_start, ..self.fitness };
        let is_given = |&i: &usize| given.contains(&each[i]) && each[i] != choice;
        let (of_given, others): (Vec<usize>, Vec<usize>) = (1..each.len()).partition(is_given);
        let mut best_given = 0;
        for next in of_given {
            let of = (&evaluator, &fitness);
            best_given = self.select_on(of, &mut check, best_given, vec![next])?;
            fitness.given = check.results(best_given).to_vec();
        }
        // What falls far behind another is worth no more pairs, unless the choice does not stand.
        let raced = [&[best_given], &others[..]].concat();
        let left = self.raced_on((&evaluator, &fitness), &mut check, raced)?;
        let (mut standing, mut against) = (best_given, best_given);
        for order in [left, others] {
            standing = best_given;
            for next in order.into_iter().filter(|&next| next != best_given) {
                against = standing;
                let of = (&evaluator, &fitness);
                standing = self.select_on(of, &mut check, standing, vec![next])?;
            }
            if standing == last {
                break;
            }
        }
        let seen = check.results(last).len();
        let holds = standing == last;
        let ahead = match holds {
            true => check.ahead(last, against, seen, &fitness),
            false => check.behind(against, last, seen, &fitness),
        };
        let ahead = ahead.unwrap_or_default();
        let result = Check {
            pairs: seen,
            // It is infinite where every pair differs by the same amount; JSON has no such number.
            ahead: ahead.clamp(-99.0, 99.0),
            holds,
            of: check.origin(against).to_string(),
        };
        Ok(Some((check, each[standing], result)))
    }

    /// Searches stages side by side, each from one of the selection, and enters their shortlists.
    /// Returns the finalists of each, and the optimiser of the last.
    fn finalists(
        &mut self,
        stages: &[(&Stage, usize)],
        selection: &mut FinalSelection,
    ) -> Result<(Vec<Vec<usize>>, Option<CmaEs>), TuneError> {
        let TuneConfig { shortlist: count, sampler, .. } = self.search.config.tune;
        let space = &self.search.space;
        let base = |&(stage, from): &(_, usize)| (stage, space.point(selection.parameters(from)));
        let stages: Vec<(&Stage, Vec<f64>)> = stages.iter().map(base).collect();
        let mut optimizers = self.closed_loop(&stages)?;
        let each = stages.iter().zip(&optimizers);
        let entered = each.map(|((stage, base), optimizer)| {
            let of_stage = (space, &base[..]);
            let list = shortlist(stage, optimizer, &self.generations, of_stage, (count, sampler));
            list.into_iter().map(|(origin, own)| selection.enter(origin, own)).collect()
        });
        Ok((entered.collect(), optimizers.pop()))
    }

    /// Index of the winner among the incumbent and some finalists, on all training pairs.
    fn select(
        &self,
        selection: &mut FinalSelection,
        incumbent: usize,
        finalists: Vec<usize>,
    ) -> Result<usize, TuneError> {
        let most = (1 + finalists.len()) * self.evaluator.pairs().len();
        self.evaluator.observer.stage("choosing", most);
        self.select_on((&self.evaluator, &self.fitness), selection, incumbent, finalists)
    }

    /// The same on an evaluator's pairs, by a fitness of them.
    fn select_on(
        &self,
        (evaluator, fitness): (&Evaluator<'_>, &Fitness<'_>),
        selection: &mut FinalSelection,
        incumbent: usize,
        finalists: Vec<usize>,
    ) -> Result<usize, TuneError> {
        let evaluate = |tasks: &[Task<'_>]| evaluator.evaluate(tasks);
        let winner = selection.winner(incumbent, finalists, fitness, &evaluate)?;
        winner.ok_or_else(|| self.interrupted())
    }

    /// Races some finalists on all pairs of an evaluator; only those far behind another fall out.
    /// Returns those that have seen all pairs.
    fn raced_on(
        &self,
        (evaluator, fitness): (&Evaluator<'_>, &Fitness<'_>),
        selection: &mut FinalSelection,
        finalists: Vec<usize>,
    ) -> Result<Vec<usize>, TuneError> {
        let evaluate = |tasks: &[Task<'_>]| evaluator.evaluate(tasks);
        let left = selection.raced(finalists, |_| usize::MAX, fitness, &evaluate)?;
        left.ok_or_else(|| self.interrupted())
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

/// What was given, then the simpler ones, then the choice, each once: of a simpler one that is
/// there twice the later place counts.
fn in_order(given: &[usize], simpler: &[usize], choice: usize) -> Vec<usize> {
    let is_own =
        |k: &usize| !given.contains(&simpler[*k]) && !simpler[k + 1..].contains(&simpler[*k]);
    let own = (0..simpler.len()).filter(is_own).map(|k| simpler[k]);
    let before = given.iter().copied().chain(own).filter(|&i| i != choice);
    before.chain([choice]).collect()
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
    fn what_was_given_comes_first_in_the_check_and_the_choice_last() {
        assert_eq!(in_order(&[0, 1], &[2, 5, 1, 0, 7, 5, 1], 7), [0, 1, 2, 5, 7]);
        assert_eq!(in_order(&[0, 1], &[2, 1, 3, 2], 1), [0, 3, 2, 1], "a choice that was given");
        assert_eq!(in_order(&[3], &[], 4), [3, 4]);
    }

    #[test]
    fn pairs_harder_for_the_start_are_drawn_more_often() {
        assert_eq!(weights_by_difficulty(&[0.5, -2.0, 7.0]), [2.0, 1.0, HARDEST]);
        let alike = weights_by_difficulty(&[0.1; 5]);
        assert!(alike.is_sorted() && (alike[0], alike[4]) == (1.0, HARDEST), "{alike:?}");
        assert_eq!(weights_by_difficulty(&[3.0]), [1.0]);
        assert!(weights_by_difficulty(&[]).is_empty());
    }
}
