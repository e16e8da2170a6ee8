//! Tuning whose scans and registrations are made by whoever drives it.

use std::fs;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use echoloop_closed_loop::ask_tell;
use echoloop_closed_loop::config::{RunConfig, load};
use echoloop_closed_loop::prepared::{Preparation, Prepared};
use echoloop_closed_loop::run_folder::run::{CONFIG, RunFolder};
use echoloop_sensors::sensor::{Model, Sensors};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyTuple};

use crate::arguments::{failed, value};
use crate::configuration::{configuration, read, written};
use crate::threads::detached;

/// Part of a wait, between which signals are looked at.
const PART: Duration = Duration::from_millis(200);

/// Pairs of a search, traced.
fn prepared(config: RunConfig) -> PyResult<Arc<Prepared>> {
    let sensors = Sensors::in_process(Model::from(&config));
    let preparation = Preparation::new(config, sensors, &|_| ()).map_err(failed)?;
    let preparation = preparation.for_a_search().map_err(failed)?;
    preparation.traced_for_a_search(&|_, _| ()).map(Arc::new).map_err(failed)
}

/// Search for better parameters whose tasks run wherever you put them.
///
/// `run` is the folder of the run, made or gone on with; its journal and results are those of
/// `echoloop tune` with the same configuration. `settings` are keys of the configuration, laid over
/// those of the file `config`; of neither, the run's own. Scenes are traced once.
///
/// A task is a dict of plain numbers, lists and words: one pair, scanned with the settings of one
/// candidate, and registrations of it. The run is closed with `close`, or at the end of a `with`.
#[pyclass(frozen, module = "echoloop")]
pub(crate) struct Tuner {
    tuner: ask_tell::Tuner,
}

#[pymethods]
impl Tuner {
    #[new]
    #[pyo3(signature = (run, settings = None, *, config = None))]
    fn new(
        py: Python<'_>,
        run: PathBuf,
        settings: Option<&Bound<'_, PyDict>>,
        config: Option<PathBuf>,
    ) -> PyResult<Self> {
        let own = run.join(CONFIG);
        let kept = own.exists().then(|| load(Some(&own), &[])).transpose().map_err(failed)?;
        let is_begun = settings.is_none() && config.is_none();
        let config = match kept.clone().filter(|_| is_begun) {
            Some(kept) => kept,
            None => configuration(settings, config.as_deref())?,
        };
        let is_empty = || fs::read_dir(&run).map_or(true, |mut files| files.next().is_none());
        match kept {
            Some(kept) if kept != config => {
                return Err(value("run", format!("{} is of another configuration", own.display())));
            }
            None if !is_empty() => {
                let what = "expected a run's folder, or none, or an empty one";
                return Err(value("run", format!("{}: {what}", run.display())));
            }
            _ => {}
        }
        detached(py, || {
            let prepared = prepared(config)?;
            let folder = RunFolder::at(&run, &prepared.config).map_err(failed)?;
            let tuner = ask_tell::Tuner::new(prepared, folder).map_err(failed)?;
            Ok(Self { tuner })
        })
    }

    /// Tasks to do, at most `most`: those that nobody has yet.
    ///
    /// While results are missing it waits `patience_s` seconds at most for the tasks that follow
    /// from them. An empty list means that they come first, or that the run has ended: `done`.
    /// `again` also hands out tasks whose result is missing, as of a worker that is lost.
    #[pyo3(signature = (most = None, *, patience_s = 0.0, again = false))]
    fn ask<'py>(
        &self,
        py: Python<'py>,
        most: Option<usize>,
        patience_s: f64,
        again: bool,
    ) -> PyResult<Bound<'py, PyList>> {
        let most = most.unwrap_or(usize::MAX);
        let patience = Duration::try_from_secs_f64(patience_s)
            .map_err(|_| value("patience_s", format!("expected seconds, found {patience_s}")))?;
        let missing = if again { self.tuner.missing() } else { Vec::new() };
        let patience = if missing.is_empty() { patience } else { Duration::ZERO };
        let begun = Instant::now();
        let mut tasks = Vec::new();
        // In parts, so that ^C is heard.
        loop {
            let left = patience.saturating_sub(begun.elapsed());
            tasks.extend(py.detach(|| self.tuner.ask(most, left.min(PART))));
            if left <= PART || !tasks.is_empty() || self.done() {
                break;
            }
            py.check_signals()?;
        }
        tasks.extend(missing.into_iter().take(most.saturating_sub(tasks.len())));
        let tasks = tasks.iter().map(|task| written(py, task));
        PyList::new(py, tasks.collect::<PyResult<Vec<_>>>()?)
    }

    /// Takes the result of a task; results may come in any order.
    ///
    /// False if the task has one already: this one is dropped. Raises ValueError of a result of no
    /// task of this search.
    fn tell(&self, py: Python<'_>, result: &Bound<'_, PyAny>) -> PyResult<bool> {
        let told = read("result", result)?;
        py.detach(|| self.tuner.tell(told)).map_err(|problem| value("result", problem))
    }

    /// Ends the search and lets go of the folder; the run goes on later.
    fn close(&self, py: Python<'_>) {
        py.detach(|| self.tuner.close());
    }

    fn __enter__(own: PyRef<'_, Self>) -> PyRef<'_, Self> {
        own
    }

    #[pyo3(signature = (*_exception))]
    fn __exit__(&self, py: Python<'_>, _exception: &Bound<'_, PyTuple>) {
        self.close(py);
    }

    /// Worker of this process, which shares the traced pairs.
    fn worker(&self) -> Worker {
        Worker { worker: self.tuner.worker() }
    }

    /// True once the run has ended.
    #[getter]
    fn done(&self) -> bool {
        self.tuner.result().is_some()
    }

    /// The part of the work: stage, of (its registrations) and done.
    #[getter]
    fn progress<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        written(py, &self.tuner.progress())
    }

    /// The run's result, as result.json has it; None before the end. Raises RuntimeError of a run
    /// that has failed.
    #[getter]
    fn result<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        match self.tuner.result() {
            None => Ok(None),
            Some(Ok(result)) => written(py, &result).map(Some),
            Some(Err(problem)) => Err(PyRuntimeError::new_err(problem)),
        }
    }

    fn __repr__(&self) -> String {
        let ask_tell::Progress { stage, of, done } = self.tuner.progress();
        format!("<Tuner: {stage}, {done} of {of} registrations>")
    }
}

/// Does the tasks of a Tuner, in any process: it traces the same pairs from the same configuration.
///
/// The numbers are the same wherever a task runs. A task of another version, configuration or scene
/// is refused.
#[pyclass(frozen, module = "echoloop")]
pub(crate) struct Worker {
    worker: ask_tell::Worker,
}

#[pymethods]
impl Worker {
    #[new]
    #[pyo3(signature = (settings = None, *, config = None))]
    fn new(
        py: Python<'_>,
        settings: Option<&Bound<'_, PyDict>>,
        config: Option<PathBuf>,
    ) -> PyResult<Self> {
        let config = configuration(settings, config.as_deref())?;
        detached(py, || Ok(Self { worker: ask_tell::Worker::new(prepared(config)?) }))
    }

    /// Result of a task, to tell the Tuner.
    fn work<'py>(&self, py: Python<'py>, task: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let task = read("task", task)?;
        let told = detached(py, || self.worker.work(&task));
        written(py, &told.map_err(|problem| value("task", problem))?)
    }

    fn __repr__(&self) -> String {
        format!("<Worker for {}>", self.worker.identity())
    }
}
