//! Tuning whose scans and registrations are made by whoever drives it.

use std::path::PathBuf;
use std::sync::Arc;

use echoloop_closed_loop::ask_tell;
use echoloop_closed_loop::config::{RunConfig, load};
use echoloop_closed_loop::dataset::fingerprint::of_library;
use echoloop_closed_loop::prepared::{Preparation, Prepared};
use echoloop_closed_loop::run_folder::run::{CONFIG, RunFolder};
use echoloop_sensors::sensor::{Model, Sensors};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::arguments::{failed, value};
use crate::configuration::{configuration, read, written};

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
/// candidate, and registrations of it.
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
        let config = match settings.is_none() && config.is_none() && own.exists() {
            true => load(Some(&own), &[]).map_err(failed)?,
            false => configuration(settings, config.as_deref())?,
        };
        of_library(py.import("echoloop._native")?.getattr("__file__")?.extract()?);
        py.detach(|| {
            let prepared = prepared(config)?;
            let folder = RunFolder::at(&run, &prepared.config).map_err(failed)?;
            let tuner = ask_tell::Tuner::new(prepared, folder).map_err(failed)?;
            Ok(Self { tuner })
        })
    }

    /// Tasks that nobody has yet, at most `most`. Waits for the search, unless results are missing.
    ///
    /// None of them means that results of others come first, or that the run has ended: `done`.
    #[pyo3(signature = (most = None))]
    fn ask<'py>(&self, py: Python<'py>, most: Option<usize>) -> PyResult<Bound<'py, PyList>> {
        let tasks = py.detach(|| self.tuner.ask(most.unwrap_or(usize::MAX)));
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
        py.detach(|| Ok(Self { worker: ask_tell::Worker::new(prepared(config)?) }))
    }

    /// Result of a task, to tell the Tuner.
    fn work<'py>(&self, py: Python<'py>, task: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let task = read("task", task)?;
        let told = py.detach(|| self.worker.work(&task));
        written(py, &told.map_err(|problem| value("task", problem))?)
    }

    fn __repr__(&self) -> String {
        format!("<Worker for {}>", self.worker.identity())
    }
}
