//! Registrations by the dozen: every pair is scanned once for all who share settings and noise.

use std::sync::atomic::{AtomicBool, Ordering};

use rayon::prelude::*;

use super::fitness::Judged;
use super::tune_search::Observer;
use crate::cost::{ScanCost, Scanner};
use crate::dataset::ScanPair;
use crate::evaluation::objective::Bench;
use crate::parameters::Parameters;
use echoloop_sensors::sensor::SensorError;

/// One registration to make.
#[derive(Clone, Copy)]
pub(crate) struct Task<'a> {
    /// What to scan and register with.
    pub parameters: &'a Parameters,
    /// Index of the pair among those of who makes it.
    pub pair: usize,
    /// Seed of the scans' noise.
    pub noise: u64,
}

/// Who makes them.
pub(crate) struct Crew<'a> {
    pub bench: Bench<'a>,
    /// What is registered.
    pub pairs: &'a [ScanPair],
    pub stop: &'a AtomicBool,
    pub observer: &'a dyn Observer,
    /// What scans are weighed with, where their costs matter.
    pub scanner: Option<Scanner>,
}

impl Crew<'_> {
    /// How they come out, in the tasks' order; `None` when the search is to stop.
    ///
    /// A scan is a function of settings, pair and noise, and a registration one of the clouds and
    /// its own settings: what two tasks have in common is done once, and the errors are the same.
    pub(crate) fn judged(&self, tasks: &[Task<'_>]) -> Result<Option<Vec<Judged>>, SensorError> {
        let groups = grouped(tasks.len(), |a, b| is_same_scan(&tasks[a], &tasks[b]));
        let done = groups.par_iter().map(|group| self.group(tasks, group));
        let Some(done) = done.collect::<Result<Option<Vec<_>>, SensorError>>()? else {
            return Ok(None);
        };
        let mut judged: Vec<(usize, Judged)> = done.into_iter().flatten().collect();
        judged.sort_by_key(|(task, _)| *task);
        Ok(Some(judged.into_iter().map(|(_, judged)| judged).collect()))
    }

    /// Tasks of one scan.
    fn group(
        &self,
        tasks: &[Task<'_>],
        group: &[usize],
    ) -> Result<Option<Vec<(usize, Judged)>>, SensorError> {
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
            let judged = Judged { error, cost };
            Some(same.iter().map(|&i| (group[i], judged.clone())).collect::<Vec<_>>())
        });
        let done: Option<Vec<_>> = done.collect();
        Ok(done.map(|done| done.into_iter().flatten().collect()))
    }
}

fn is_same_scan(a: &Task<'_>, b: &Task<'_>) -> bool {
    a.pair == b.pair && a.noise == b.noise && a.parameters.settings == b.parameters.settings
}

/// The numbers below `count` in groups of those that are the same, in order of their first.
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
