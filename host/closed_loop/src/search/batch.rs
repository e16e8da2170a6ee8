//! Evaluation of many registrations: a pair is scanned once for all that share settings and noise.

use std::cmp::Reverse;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use rayon::prelude::*;

use super::elsewhere::{Elsewhere, PairsOf, ScanTask};
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

/// Samples of a beam that take as long as its share of a registration.
const OF_A_REGISTRATION: u64 = 400;

/// Results by index of the task.
type ByTask = Vec<(usize, PairResult)>;

/// Times of the registrations that share one scan.
#[derive(Clone, Debug)]
pub struct ScanTimes {
    /// Time of both scans, which come first.
    pub scan: Duration,
    /// Times of the registrations, which are independent of each other.
    pub registrations: Vec<Duration>,
}

/// Scans and registers pairs on the threads of the pool.
pub(crate) struct Evaluator<'a> {
    pub bench: Bench<'a>,
    /// Set of the pairs to register.
    pub set: PairsOf,
    pub stop: &'a AtomicBool,
    pub observer: &'a dyn Observer,
    /// Cost model of a scan, where costs count.
    pub scanner: Option<Scanner>,
    /// Those who scan and register instead of the threads of the pool.
    pub elsewhere: Option<&'a dyn Elsewhere>,
}

impl<'a> Evaluator<'a> {
    /// Pairs to register.
    pub(crate) fn pairs(&self) -> &'a [ScanPair] {
        self.set.pairs(self.bench.dataset)
    }

    /// Results in the order of the tasks; `None` when interrupted.
    ///
    /// A scan is a function of settings, pair and noise; a registration is one of the clouds and
    /// its own settings. A scan or registration that several tasks share is made once.
    pub(crate) fn evaluate(
        &self,
        tasks: &[Task<'_>],
    ) -> Result<Option<Vec<PairResult>>, SensorError> {
        let mut groups = grouped(tasks.len(), |a, b| is_same_scan(&tasks[a], &tasks[b]));
        // What takes long begins first, in this order on any thread that is free: at the end of a
        // batch other threads wait for the last of it.
        groups.sort_by_cached_key(|group| Reverse(self.work(tasks, group)));
        if let Some(others) = self.elsewhere {
            return Ok(self.left_to(others, tasks, &groups));
        }
        let done: Vec<OnceLock<_>> = groups.iter().map(|_| OnceLock::new()).collect();
        let has_failed = &AtomicBool::new(false);
        rayon::scope_fifo(|scope| {
            for (group, done) in groups.iter().zip(&done) {
                scope.spawn_fifo(move |_| {
                    if !has_failed.load(Ordering::Relaxed) {
                        let result = done.get_or_init(|| self.group(tasks, group));
                        has_failed.fetch_or(result.is_err(), Ordering::Relaxed);
                    }
                });
            }
        });
        let done = done.into_iter().filter_map(OnceLock::into_inner);
        let Some(done) = done.collect::<Result<Option<Vec<_>>, SensorError>>()? else {
            return Ok(None);
        };
        let (results, times): (Vec<_>, Vec<_>) = done.into_iter().unzip();
        self.observer.batch(&times);
        let mut results: Vec<(usize, PairResult)> = results.into_iter().flatten().collect();
        results.sort_by_key(|(task, _)| *task);
        Ok(Some(results.into_iter().map(|(_, result)| result).collect()))
    }

    /// The same, done by others.
    fn left_to(
        &self,
        others: &dyn Elsewhere,
        tasks: &[Task<'_>],
        groups: &[Vec<usize>],
    ) -> Option<Vec<PairResult>> {
        // Tasks of each registration of each group.
        let same: Vec<Vec<Vec<usize>>> =
            groups.iter().map(|group| same_registrations(tasks, group)).collect();
        let first_of_each = |same: &Vec<Vec<usize>>| {
            let each: Vec<Task<'_>> = same.iter().map(|own| tasks[own[0]]).collect();
            ScanTask::of(self.set, &each)
        };
        let results = others.results(same.iter().filter_map(first_of_each).collect())?;
        let mut by_task: Vec<Option<PairResult>> = vec![None; tasks.len()];
        for (same, result) in same.iter().zip(results) {
            let cost = self.scanner.and_then(|_| ScanCost::mean(&result.costs));
            for (own, error) in same.iter().zip(result.errors) {
                for &task in own {
                    by_task[task] = Some(PairResult { error: error.clone(), cost });
                }
            }
        }
        by_task.into_iter().collect()
    }

    /// About as much work as a group is: samples of a scan. A registration takes as long as the
    /// samples of [`OF_A_REGISTRATION`] of each beam.
    fn work(&self, tasks: &[Task<'_>], group: &[usize]) -> u64 {
        let settings = &tasks[group[0]].parameters.settings;
        let pattern = self.bench.dataset.beams.pattern();
        let beams = pattern.aimed(settings).unwrap_or(*pattern).beams();
        let samples: u64 = (settings.bins * settings.shots).unsigned_abs().into();
        u64::from(beams) * (samples + OF_A_REGISTRATION * group.len() as u64)
    }

    /// Results of the tasks that share one scan, by index of the task, and their times.
    fn group(
        &self,
        tasks: &[Task<'_>],
        group: &[usize],
    ) -> Result<Option<(ByTask, ScanTimes)>, SensorError> {
        let Task { parameters, pair, noise } = tasks[group[0]];
        if self.stop.load(Ordering::Relaxed) {
            return Ok(None);
        }
        let begun = Instant::now();
        let own = &self.pairs()[pair];
        let scanned = self.bench.scan(&parameters.settings, pair, own, noise)?;
        let cost = self.scanner.and_then(|scanner| {
            let weighed = |scan| scanner.cost(&parameters.settings, scan);
            ScanCost::mean(&scanned.scans.each_ref().map(|scan| weighed(scan)))
        });
        let scan = begun.elapsed();
        let same = same_registrations(tasks, group);
        let done = same.par_iter().map(|same| {
            if self.stop.load(Ordering::Relaxed) {
                return None;
            }
            let begun = Instant::now();
            let (error, _) = scanned.register(&tasks[same[0]].parameters.registration);
            let time = begun.elapsed();
            same.iter().for_each(|_| self.observer.evaluated());
            let result = PairResult { error, cost };
            Some((same.iter().map(|&task| (task, result.clone())).collect::<Vec<_>>(), time))
        });
        let done: Option<Vec<_>> = done.collect();
        Ok(done.map(|done| {
            let (results, registrations): (Vec<_>, _) = done.into_iter().unzip();
            (results.into_iter().flatten().collect(), ScanTimes { scan, registrations })
        }))
    }
}

fn is_same_scan(a: &Task<'_>, b: &Task<'_>) -> bool {
    a.pair == b.pair && a.noise == b.noise && a.parameters.settings == b.parameters.settings
}

/// Tasks of a group, grouped by their registration.
fn same_registrations(tasks: &[Task<'_>], group: &[usize]) -> Vec<Vec<usize>> {
    let registration = |i: usize| &tasks[group[i]].parameters.registration;
    let same = grouped(group.len(), |a, b| registration(a) == registration(b));
    same.into_iter().map(|own| own.into_iter().map(|i| group[i]).collect()).collect()
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
