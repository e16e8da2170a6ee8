//! A run whose scans and registrations are made by whoever drives it, wherever that is.
//!
//! The search is the one of [`TuneSearch`]. It runs in a thread of its own, and waits there for the
//! results of its tasks: the driver asks for tasks, and tells their results in any order. Result
//! and journal are those of `echoloop tune`, to the bit.

use std::collections::{BTreeMap, VecDeque};
use std::fmt::{Display, Formatter};
use std::fs;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::checksum::Checksum;
use crate::prepared::Prepared;
use crate::run_folder::journal::{Generation, Header, Journal, JournalError};
use crate::run_folder::provenance::About;
use crate::run_folder::run::{HISTORY, RESULT, RunFolder, RunResult};
use crate::search::{Elsewhere, Observer, ScanResult, ScanTask, TaskError, TuneSearch};
use crate::tuning::{tuned, write_run};

/// Search that a task belongs to: only equal ones have equal numbers.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Identity {
    /// Version of the program.
    pub program: String,
    /// Checksum of the configuration.
    pub configuration: String,
    /// Checksum of the sensor, the scene and all traced scans.
    pub scans: String,
}

impl Identity {
    /// Identity of the tasks of the search whose journal begins so.
    fn of(header: &Header) -> Self {
        let Header { program, link_schema, sensor, config, content, .. } = header;
        let scans = serde_json::json!([link_schema, sensor, content]);
        let sum = |document: &serde_json::Value| {
            Checksum::of(&[document.to_string().as_bytes()]).to_string()
        };
        Self { program: program.clone(), configuration: sum(config), scans: sum(&scans) }
    }
}

impl Display for Identity {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        let Self { program, configuration, scans } = self;
        write!(f, "{program}, configuration {configuration}, scans {scans}")
    }
}

/// A task, with its number and its search.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Numbered {
    /// Number in this process's part of the search, from 0.
    pub task: u64,
    /// The search.
    pub search: Identity,
    /// What is to be done.
    pub scan: ScanTask,
}

/// Result of a task, with its number.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Told {
    /// Number of the task.
    pub task: u64,
    /// The search.
    pub search: Identity,
    /// Checksum of the task: a search that goes on numbers others.
    pub check: String,
    /// Result.
    pub result: ScanResult,
}

/// A task or a result that is refused.
#[derive(Debug, Error)]
pub enum RefusedTask {
    /// Of another search.
    #[error("expected a task of {own}; found one of {other}")]
    OfAnother {
        /// This search.
        own: Box<Identity>,
        /// That of the task.
        other: Box<Identity>,
    },
    /// No such task was asked for.
    #[error("no task {0} was asked for")]
    NotAsked(u64),
    /// Of a task of the same number that is another one.
    #[error("task {0}: the result is of another task of that number, of this search before")]
    Before(u64),
    /// A result that no worker has.
    #[error("task {task}: {what}")]
    Odd {
        /// Number of the task.
        task: u64,
        /// What was expected, and what was found.
        what: String,
    },
    /// It cannot be done.
    #[error(transparent)]
    Task(#[from] TaskError),
}

/// Does the tasks of a search, in any process that has its configuration.
pub struct Worker {
    prepared: Arc<Prepared>,
    identity: Identity,
}

impl Worker {
    /// Worker for the searches of these pairs.
    pub fn new(prepared: Arc<Prepared>) -> Self {
        let identity = Identity::of(&prepared.search(&AtomicBool::new(false)).header());
        Self { prepared, identity }
    }

    /// Search whose tasks it does.
    pub fn identity(&self) -> &Identity {
        &self.identity
    }

    /// Does a task.
    ///
    /// # Errors
    ///
    /// [`RefusedTask`] of a task of another search, or of the sensor.
    pub fn work(&self, task: &Numbered) -> Result<Told, RefusedTask> {
        expect_same(&self.identity, &task.search)?;
        let result = self.prepared.work(&task.scan)?;
        let (search, check) = (self.identity.clone(), check(&task.scan));
        Ok(Told { task: task.task, search, check, result })
    }
}

/// Checksum of a task.
fn check(task: &ScanTask) -> String {
    // Numbers and words alone: it is always written.
    Checksum::of(&[&serde_json::to_vec(task).unwrap_or_default()]).to_string()
}

/// Reason why a result is not one of a task.
fn odd(task: &ScanTask, result: &ScanResult) -> Option<String> {
    let (expected, found) = (task.registrations.len(), result.errors.len());
    if found != expected {
        return Some(format!("expected {expected} errors, found {found}"));
    }
    let is_length = |value: f64| value.is_finite() && value >= 0.0;
    result.errors.iter().find_map(|error| {
        let lengths = [error.translation_m, error.rotation_deg, error.frobenius];
        if error.pair != task.pair {
            return Some(format!("expected errors of pair {}, found {}", task.pair, error.pair));
        }
        (!lengths.into_iter().all(is_length)).then(|| format!("expected errors, found {lengths:?}"))
    })
}

fn expect_same(own: &Identity, other: &Identity) -> Result<(), RefusedTask> {
    let boxed = |identity: &Identity| Box::new(identity.clone());
    match own == other {
        true => Ok(()),
        false => Err(RefusedTask::OfAnother { own: boxed(own), other: boxed(other) }),
    }
}

/// Progress of a run.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Progress {
    /// Part of the work, in words.
    pub stage: String,
    /// Registrations of this part.
    pub of: usize,
    /// Those that are done.
    pub done: usize,
}

/// A run that waits for the results of its tasks.
pub struct Tuner {
    prepared: Arc<Prepared>,
    identity: Identity,
    desk: Arc<Desk>,
    /// Thread of the search, and the process that it is in.
    search: Mutex<Option<(u32, JoinHandle<()>)>>,
}

/// Place where search and driver meet.
#[derive(Default)]
struct Desk {
    state: Mutex<State>,
    changed: Condvar,
    /// The driver is gone: the search is to end.
    stop: AtomicBool,
}

#[derive(Default)]
struct State {
    /// Number of the next task.
    next: u64,
    /// Tasks that nobody has yet.
    waiting: VecDeque<(u64, ScanTask)>,
    /// Tasks that somebody has and whose result is missing.
    out: BTreeMap<u64, ScanTask>,
    /// Results that the search has not taken yet.
    results: BTreeMap<u64, ScanResult>,
    progress: Progress,
    ended: Option<Result<Box<RunResult>, String>>,
}

impl Desk {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn wait<'a>(&self, state: MutexGuard<'a, State>) -> MutexGuard<'a, State> {
        self.changed.wait(state).unwrap_or_else(PoisonError::into_inner)
    }
}

impl Elsewhere for Desk {
    fn results(&self, tasks: Vec<ScanTask>) -> Option<Vec<ScanResult>> {
        let mut state = self.state();
        let numbers = state.next..state.next + tasks.len() as u64;
        state.next = numbers.end;
        state.waiting.extend(numbers.clone().zip(tasks));
        self.changed.notify_all();
        while !numbers.clone().all(|number| state.results.contains_key(&number)) {
            if self.stop.load(Ordering::Relaxed) {
                return None;
            }
            state = self.wait(state);
        }
        numbers.map(|number| state.results.remove(&number)).collect()
    }
}

impl Observer for Desk {
    fn stage(&self, name: &str, registrations: usize) {
        self.state().progress = Progress { stage: name.into(), of: registrations, done: 0 };
    }
}

impl Tuner {
    /// Begins a run in a folder, or goes on with the one that the folder holds. One that has ended
    /// has its result at once.
    ///
    /// # Errors
    ///
    /// [`JournalError`] of a folder that holds another run, or cannot be written.
    pub fn new(prepared: Arc<Prepared>, folder: RunFolder) -> Result<Self, JournalError> {
        let desk = Arc::new(Desk::default());
        let header = prepared.search(&AtomicBool::new(false)).header();
        let identity = Identity::of(&header);
        let path = folder.file(HISTORY);
        let (mut journal, done) = match path.exists() {
            true => Journal::resume(&path, &header, false)?,
            false => (Journal::create(&path, &header)?, Vec::new()),
        };
        let kept = fs::read(folder.file(RESULT)).ok();
        let kept = kept.and_then(|bytes| serde_json::from_slice::<serde_json::Value>(&bytes).ok());
        if let Some(result) = kept.and_then(|document| serde_json::from_value(document).ok()) {
            desk.state().ended = Some(Ok(result));
            return Ok(Self { prepared, identity, desk, search: Mutex::default() });
        }
        About::read(folder.path()).and_then(|about| about.record(&folder))?;
        let (own, of_search) = (Arc::clone(&prepared), Arc::clone(&desk));
        let search = std::thread::spawn(move || {
            let search = || run(&own, &folder, (&mut journal, done), &of_search);
            let ended = std::panic::catch_unwind(std::panic::AssertUnwindSafe(search));
            let ended = ended.unwrap_or_else(|panic| {
                let why = panic.downcast_ref::<String>().map(String::as_str);
                let why = why.or_else(|| panic.downcast_ref::<&str>().copied());
                Err(format!("the search has failed: {}", why.unwrap_or("no reason known")))
            });
            of_search.state().ended = Some(ended);
            of_search.changed.notify_all();
        });
        let search = Mutex::new(Some((std::process::id(), search)));
        Ok(Self { prepared, identity, desk, search })
    }

    /// Worker in this process, which shares its traced pairs.
    pub fn worker(&self) -> Worker {
        Worker { prepared: Arc::clone(&self.prepared), identity: self.identity.clone() }
    }

    /// Tasks that nobody has yet, at most so many. Waits for the search where no result is missing,
    /// else at most `patience` for what others tell. None: their results come first, or the run has
    /// ended.
    pub fn ask(&self, most: usize, patience: Duration) -> Vec<Numbered> {
        let until = Instant::now().checked_add(patience);
        let mut state = self.desk.state();
        while state.waiting.is_empty() && state.ended.is_none() {
            let left = until.map(|until| until.saturating_duration_since(Instant::now()));
            state = match left.filter(|_| !state.out.is_empty()) {
                Some(Duration::ZERO) => break,
                Some(left) => {
                    let waited = self.desk.changed.wait_timeout(state, left);
                    waited.unwrap_or_else(PoisonError::into_inner).0
                }
                None => self.desk.wait(state),
            };
        }
        let count = most.min(state.waiting.len());
        let taken: Vec<(u64, ScanTask)> = state.waiting.drain(..count).collect();
        state.out.extend(taken.iter().cloned());
        taken.into_iter().map(|task| self.numbered(task)).collect()
    }

    /// Tasks that somebody has and whose result is missing: for another, if a worker is lost.
    pub fn missing(&self) -> Vec<Numbered> {
        let out = self.desk.state().out.clone();
        out.into_iter().map(|task| self.numbered(task)).collect()
    }

    fn numbered(&self, (task, scan): (u64, ScanTask)) -> Numbered {
        Numbered { task, search: self.identity.clone(), scan }
    }

    /// Takes the result of a task. False: it has one already, and this one is dropped.
    ///
    /// # Errors
    ///
    /// [`RefusedTask`] of a result that is of no task of this search.
    pub fn tell(&self, told: Told) -> Result<bool, RefusedTask> {
        expect_same(&self.identity, &told.search)?;
        let Told { task, result, check: of, .. } = told;
        let mut state = self.desk.state();
        let next = state.waiting.front().map_or(state.next, |(next, _)| *next);
        let Some(scan) = state.out.get(&task) else {
            return if task < next { Ok(false) } else { Err(RefusedTask::NotAsked(task)) };
        };
        if check(scan) != of {
            return Err(RefusedTask::Before(task));
        }
        if let Some(what) = odd(scan, &result) {
            return Err(RefusedTask::Odd { task, what });
        }
        state.out.remove(&task);
        state.progress.done += result.errors.len();
        state.results.insert(task, result);
        drop(state);
        self.desk.changed.notify_all();
        Ok(true)
    }

    /// Progress.
    pub fn progress(&self) -> Progress {
        self.desk.state().progress.clone()
    }

    /// Result of the run, once it has ended; the reason, if it has none.
    pub fn result(&self) -> Option<Result<Box<RunResult>, String>> {
        self.desk.state().ended.clone()
    }

    /// Ends the search and lets go of the folder. The journal holds each whole generation: the run
    /// goes on later.
    pub fn close(&self) {
        let search = self.search.lock().unwrap_or_else(PoisonError::into_inner).take();
        // A process that was forked off has no such thread.
        let Some((_, search)) = search.filter(|(process, _)| *process == std::process::id()) else {
            return;
        };
        self.desk.stop.store(true, Ordering::Relaxed);
        drop(self.desk.state()); // the search either waits, or sees it before it waits
        self.desk.changed.notify_all();
        let _ = search.join(); // its panic is caught within
    }
}

impl Drop for Tuner {
    fn drop(&mut self) {
        self.close();
    }
}

/// Searches to the end, and writes the folder.
fn run(
    prepared: &Prepared,
    folder: &RunFolder,
    journal: (&mut Journal, Vec<Generation>),
    desk: &Desk,
) -> Result<Box<RunResult>, String> {
    let search = TuneSearch { elsewhere: Some(desk), ..prepared.search(&desk.stop) };
    let found = tuned(&search, journal, folder, false, desk);
    let (parameters, result) = found.map_err(|error| error.to_string())?;
    write_run(folder, prepared, &parameters, &result).map_err(|error| error.to_string())?;
    Ok(Box::new(result))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::load;
    use crate::evaluation::objective::PairError;
    use crate::prepared::Preparation;
    use crate::search::Silent;
    use echoloop_sensors::sensor::{Model, Sensors};

    /// A run with a search of both halves, a check and a front.
    fn prepared(seed: u64) -> Arc<Prepared> {
        let small = [
            "scene.source=structured",
            "scene.towns=[1]",
            "scanner.pattern=grid",
            "scanner.columns=24",
            "scanner.rows=8",
            "data.train_pairs=2",
            "data.test_pairs=1",
            "data.check_pairs=2",
            "tune.generations=3",
            "tune.population=3",
            "tune.shortlist=1",
            "front.cost=energy",
            "front.generations=2",
            "front.population=4",
            "front.points=2",
        ];
        let mut overrides: Vec<_> = small.iter().map(|text| text.parse().unwrap()).collect();
        overrides.push(format!("seed={seed}").parse().unwrap());
        let config = load(None, &overrides).unwrap();
        let sensors = Sensors::in_process(Model::from(&config));
        let preparation = Preparation::new(config, sensors, &|_| ()).unwrap();
        let preparation = preparation.for_a_search().unwrap();
        Arc::new(preparation.traced_for_a_search(&|_, _| ()).unwrap())
    }

    /// Bytes of result and journals.
    fn files(folder: &std::path::Path) -> Vec<Vec<u8>> {
        let names = [RESULT, HISTORY, "front.jsonl", "tuned.toml", "before.ply", "after.ply"];
        names.iter().map(|name| fs::read(folder.join(name)).unwrap()).collect()
    }

    fn in_json<T: Serialize + for<'de> Deserialize<'de>>(value: &T) -> T {
        serde_json::from_str(&serde_json::to_string(value).unwrap()).unwrap()
    }

    /// Does all tasks, the last of each batch first, until so many are done or the run ends.
    fn drive(tuner: &Tuner, worker: &Worker, most: usize) -> usize {
        let mut done = 0;
        while tuner.result().is_none() && done < most {
            let mut tasks = tuner.ask(5, Duration::ZERO);
            tasks.extend(tuner.ask(usize::MAX, Duration::ZERO));
            for task in tasks.iter().rev() {
                assert!(tuner.tell(in_json(&worker.work(&in_json(task)).unwrap())).unwrap());
                done += 1;
            }
        }
        done
    }

    #[test]
    fn a_run_by_tasks_in_any_order_is_the_run_of_the_program_to_the_byte() {
        let (prepared, runs) = (prepared(3), tempfile::tempdir().unwrap());
        let own = RunFolder::at(&runs.path().join("own"), &prepared.config).unwrap();
        let stop = AtomicBool::new(false);
        let search = prepared.search(&stop);
        let mut journal = Journal::create(&own.file(HISTORY), &search.header()).unwrap();
        let journal = (&mut journal, Vec::new());
        let (parameters, result) = tuned(&search, journal, &own, false, &Silent).unwrap();
        write_run(&own, &prepared, &parameters, &result).unwrap();

        let path = runs.path().join("by tasks");
        let begin = || {
            let folder = RunFolder::at(&path, &prepared.config).unwrap();
            Tuner::new(Arc::clone(&prepared), folder).unwrap()
        };
        let tuner = begin();
        let worker = Worker::new(Arc::clone(&prepared));
        let interrupted_after = drive(&tuner, &worker, 60);
        assert!(tuner.result().is_none(), "{interrupted_after}");
        let left = tuner.ask(1, Duration::ZERO);
        assert_eq!(tuner.missing(), left);
        let begun = Instant::now();
        assert!(tuner.ask(0, Duration::from_millis(30)).is_empty());
        let all = tuner.ask(usize::MAX, Duration::ZERO);
        assert!(tuner.ask(9, Duration::from_millis(30)).is_empty(), "{}", all.len());
        assert!(begun.elapsed() >= Duration::from_millis(30), "it waits for others");
        let late = worker.work(&left[0]).unwrap();
        drop(tuner); // with a task out
        let tuner = begin();
        // Now the task of that number is another one.
        let other = tuner.ask(1 + late.task as usize, Duration::ZERO);
        assert_ne!(other.iter().find(|task| task.task == late.task), left.first());
        let said = tuner.tell(late).unwrap_err().to_string();
        assert!(said.contains("another task of that number") || said.contains("no task"), "{said}");
        for task in tuner.missing() {
            tuner.tell(worker.work(&task).unwrap()).unwrap();
        }
        drive(&tuner, &worker, usize::MAX);
        assert_eq!(*tuner.result().unwrap().unwrap(), result);
        drop(tuner);
        let ended = begin();
        let written = |result: &RunResult| serde_json::to_value(result).unwrap();
        let kept = ended.result().unwrap().unwrap();
        assert!(written(&kept) == written(&result), "a run that has ended has its result");
        assert!(ended.ask(9, Duration::ZERO).is_empty());
        drop(ended);
        assert_eq!(files(&path), files(own.path()));
    }

    #[test]
    fn a_result_counts_once_and_only_for_the_task_that_it_is_of() {
        let (own, runs) = (prepared(3), tempfile::tempdir().unwrap());
        let folder = RunFolder::at(runs.path(), &own.config).unwrap();
        let tuner = Tuner::new(own, folder).unwrap();
        let worker = tuner.worker();
        let task = tuner.ask(1, Duration::ZERO).remove(0);
        let told = worker.work(&task).unwrap();
        let said = |told: Told| tuner.tell(told).unwrap_err().to_string();
        assert_eq!(said(Told { task: task.task + 1, ..told.clone() }), "no task 1 was asked for");
        let none = ScanResult { errors: Vec::new(), ..told.result.clone() };
        let problem = said(Told { result: none, ..told.clone() });
        assert_eq!(problem, "task 0: expected 1 errors, found 0");
        let changes: [fn(&mut PairError); 2] = [|e| e.pair = 77, |e| e.frobenius = f64::NAN];
        for change in changes {
            let mut odd = told.clone();
            change(&mut odd.result.errors[0]);
            assert!(said(odd).contains("task 0: expected errors"));
        }
        assert!(tuner.tell(told.clone()).unwrap());
        assert_eq!(tuner.progress().done, 1);
        assert!(!tuner.tell(told.clone()).unwrap(), "it is told already");
        assert_eq!(tuner.progress().done, 1);

        let other = Worker::new(prepared(4));
        let problem = other.work(&task).unwrap_err().to_string();
        for identity in [other.identity(), worker.identity()] {
            assert!(problem.contains(&identity.to_string()), "{problem}");
        }
        let foreign = Told { search: other.identity().clone(), ..told };
        assert!(said(foreign).contains(&other.identity().to_string()));
        let mut unknown = task;
        unknown.scan.pair = 7;
        assert_eq!(worker.work(&unknown).unwrap_err().to_string(), "pair 7: the set has 2");
    }
}
