//! Evaluation of many registrations: a pair is scanned once for all that share settings and noise.

use std::sync::atomic::{AtomicBool, Ordering};

use rayon::prelude::*;

use super::fitness::PairResult;
use super::tune_search::Observer;
use crate::cost::{ScanCost, Scanner};
use crate::dataset::ScanPair;
use crate::evaluation::objective::Bench;
use crate::parameters::Parameters;
use echoloop_sensors::sensor::SensorError;

/// One registration to make.
#[derive(Clone, Copy)]
pub(crate) struct Task<'a> {
    /// Settings of sensor and registration.
    pub parameters: &'a Parameters,
    /// Index of the pair among the evaluator's.
    pub pair: usize,
    /// Seed of the noise of both scans.
    pub noise: u64,
}

/// Scans and registers pairs on the threads of the pool.
pub(crate) struct Evaluator<'a> {
    pub bench: Bench<'a>,
    /// Pairs to register.
    pub pairs: &'a [ScanPair],
    pub stop: &'a AtomicBool,
    pub observer: &'a dyn Observer,
    /// Cost model of a scan, where costs count.
    pub scanner: Option<Scanner>,
}

impl Evaluator<'_> {
    /// Results in the order of the tasks; `None` when interrupted.
    ///
    /// A scan is a function of settings, pair and noise; a registration is one of the clouds and
    /// its own settings. A scan or registration that several tasks share is made once.
    pub(crate) fn evaluate(
        &self,
        tasks: &[Task<'_>],
    ) -> Result<Option<Vec<PairResult>>, SensorError> {
        let groups = grouped(tasks.len(), |a, b| is_same_scan(&tasks[a], &tasks[b]));
        let done = groups.par_iter().map(|group| self.group(tasks, group));
        let Some(done) = done.collect::<Result<Option<Vec<_>>, SensorError>>()? else {
            return Ok(None);
        };
        let mut results: Vec<(usize, PairResult)> = done.into_iter().flatten().collect();
        results.sort_by_key(|(task, _)| *task);
        Ok(Some(results.into_iter().map(|(_, result)| result).collect()))
    }

    /// Results of the tasks that share one scan, by index of the task.
    fn group(
        &self,
        tasks: &[Task<'_>],
        group: &[usize],
    ) -> Result<Option<Vec<(usize, PairResult)>>, SensorError> {
        let Task { parameters, pair, noise } = tasks[group[0]];
        if self.stop.load(Ordering::Relaxed) {
            return Ok(None);
        }
        let scanned = self.bench.scan(&parameters.settings, pair, &self.pairs[pair], noise)?;
        let cost = self.scanner.and_then(|scanner| {
            let weighed = |scan| scanner.cost(&parameters.settings, scan);
            ScanCost::mean(&scanned.scans.each_ref().map(|scan| weighed(scan)))
        });
        let registration = |i: usize| &tasks[group[i]].parameters.registration;
        let same = grouped(group.len(), |a, b| registration(a) == registration(b));
        let done = same.par_iter().map(|same| {
            if self.stop.load(Ordering::Relaxed) {
                return None;
            }
            let (error, _) = scanned.register(registration(same[0]));
            same.iter().for_each(|_| self.observer.evaluated());
            let result = PairResult { error, cost };
            Some(same.iter().map(|&i| (group[i], result.clone())).collect::<Vec<_>>())
        });
        let done: Option<Vec<_>> = done.collect();
        Ok(done.map(|done| done.into_iter().flatten().collect()))
    }
}

fn is_same_scan(a: &Task<'_>, b: &Task<'_>) -> bool {
    a.pair == b.pair && a.noise == b.noise && a.parameters.settings == b.parameters.settings
}

/// Indices below `count`, grouped by equality, groups in the order of their first index.
fn grouped(count: usize, is_same: impl Fn(usize, usize) -> bool) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for i in 0..count {
        match groups.iter_mut().find(|group| is_same(group[0], i)) {
            Some(group) => group.push(i),
            None => groups.push(vec![i]),
        }
    }
    groups
}
