//! State of a search on its way, and its result at the end.

use std::collections::VecDeque;

use echoloop_cmaes::CmaEs;

use super::batch::Evaluator;
use super::elsewhere::PairsOf;
use super::fitness::Fitness;
use super::origin::Origin;
use super::tune_search::{Finalist, Observer, TuneError, TuneSearch, Tuned};
use crate::evaluation::objective::PairError;
use crate::parameters::Parameters;
use crate::run_folder::journal::{Generation, Journal};

/// A search on its way.
pub(super) struct SearchRun<'a> {
    pub(super) search: &'a TuneSearch<'a>,
    pub(super) journal: &'a mut Journal,
    pub(super) evaluator: Evaluator<'a>,
    /// Generations that the journal had and that have not been compared yet.
    pub(super) recorded: VecDeque<Generation>,
    pub(super) generations: Vec<Generation>,
    /// Generations of all stages.
    pub(super) total: u32,
    /// Weight of each training pair in the draw of a generation's pairs.
    pub(super) pair_weights: Vec<f64>,
    pub(super) fitness: Fitness<'a>,
}

impl<'a> SearchRun<'a> {
    pub(super) fn new(
        search: &'a TuneSearch<'a>,
        journal: &'a mut Journal,
        recorded: Vec<Generation>,
        observer: &'a dyn Observer,
    ) -> Self {
        let config = search.config;
        let scanner = config.tune.counts_costs().then(|| search.scanner());
        Self {
            search,
            journal,
            evaluator: Evaluator {
                bench: search.bench,
                set: PairsOf::Train,
                stop: search.stop,
                observer,
                scanner,
                elsewhere: search.elsewhere,
            },
            recorded: recorded.into(),
            generations: Vec::new(),
            total: search.stages().iter().map(|stage| stage.generations).sum(),
            pair_weights: vec![1.0; search.bench.dataset.train.len()],
            fitness: Fitness::new(&config.tune, &config.data),
        }
    }

    pub(super) fn interrupted(&self) -> TuneError {
        TuneError::Interrupted { generations: self.generations.len() }
    }

    /// Refuses a journal that holds generations after the search's end.
    pub(super) fn expect_end_of_journal(&self) -> Result<(), TuneError> {
        match self.recorded.is_empty() {
            true => Ok(()),
            false => Err(TuneError::Diverged {
                generation: self.generations.len(),
                field: "generation, after the search's end,".into(),
            }),
        }
    }

    /// Result of a search that found nothing better than its start.
    pub(super) fn untuned(&mut self) -> Tuned {
        self.tuned(self.search.start, Origin::Start, Vec::new(), None, &[])
    }

    /// Result of the search. `selection` are the errors of registrations made to choose among
    /// finalists.
    pub(super) fn tuned(
        &mut self,
        parameters: Parameters,
        origin: Origin,
        finalists: Vec<Finalist>,
        optimizer: Option<&CmaEs>,
        selection: &[&PairError],
    ) -> Tuned {
        let nothing_found = self.nothing_found(selection);
        let generations = std::mem::take(&mut self.generations);
        let searched = generations.iter().map(|g| g.candidates.len() * g.pairs.len());
        Tuned {
            parameters,
            origin: origin.to_string(),
            finalists,
            registrations: searched.sum::<usize>() + selection.len(),
            nothing_found,
            check: None,
            correlations: optimizer.map(CmaEs::correlations).unwrap_or_default(),
            covariance_learned: optimizer.map_or(0.0, CmaEs::covariance_learned),
            generations,
        }
    }

    /// Stop reason of the last registration, if no registration of the search found a motion.
    pub(super) fn nothing_found(&self, selection: &[&PairError]) -> Option<String> {
        let candidates = self.generations.iter().flat_map(|generation| &generation.candidates);
        let searched = candidates.flat_map(|candidate| &candidate.errors);
        let mut errors = searched.chain(selection.iter().copied());
        errors
            .clone()
            .all(PairError::is_of_no_motion)
            .then(|| errors.next_back())?
            .map(|error| error.stop.clone())
    }
}
