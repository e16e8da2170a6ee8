//! Errors of parameters on simulated pairs, for an optimiser of Python's.

use std::path::PathBuf;

use echoloop_closed_loop::external_search::ExternalSearch;
use echoloop_closed_loop::parameters::values_json;
use echoloop_closed_loop::prepared::{PairSet, Preparation, Prepared};
use echoloop_closed_loop::search::Started;
use echoloop_sensors::sensor::{Model, Sensors};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arguments::{failed, value};
use crate::configuration::{configuration, json, written};
use crate::threads::detached;

pyo3::create_exception!(
    echoloop,
    Infeasible,
    PyValueError,
    "Parameters with which nothing can be scanned or registered."
);

/// Objective of tuning: the error of sensor and registration parameters on simulated scan pairs.
///
/// `settings` are keys of the configuration, as `{"scene.source": "structured", "seed": 3}`, laid
/// over those of the file `config`. Scenes are traced once; `pairs` are "train", or "test", which
/// no search should see. The same numbers as of `echoloop evaluate --stream`.
#[pyclass(frozen, module = "echoloop")]
pub(crate) struct Objective {
    prepared: Prepared,
    which: PairSet,
    start: Started,
}

#[pymethods]
impl Objective {
    #[new]
    #[pyo3(signature = (settings = None, *, config = None, pairs = "train"))]
    fn new(
        py: Python<'_>,
        settings: Option<&Bound<'_, PyDict>>,
        config: Option<PathBuf>,
        pairs: &str,
    ) -> PyResult<Self> {
        let known = PairSet::ALL.into_iter().find(|set| set.name() == pairs);
        let expected = || format!("expected one of {}, found {pairs:?}", PairSet::NAMES.join(", "));
        let which = known.ok_or_else(|| value("pairs", expected()))?;
        let config = configuration(settings, config.as_deref())?;
        detached(py, || {
            let sensors = Sensors::in_process(Model::from(&config));
            let preparation = Preparation::new(config, sensors, &|_| ()).map_err(failed)?;
            let prepared = preparation.traced_for(which, &|_, _| ()).map_err(failed)?;
            let search = ExternalSearch::new(&prepared, which, &|| ());
            let start = search.map_err(failed)?.started();
            Ok(Self { prepared, which, start })
        })
    }

    /// Axes of the search: name, unit, scale ("linear", "log", …), min, max, and choices, a list of
    /// words or None.
    #[getter]
    fn axes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        written(py, &self.search().greeting()["axes"])
    }

    /// Parameters of the configuration, with which a search begins, by name in their units.
    #[getter]
    fn start<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        written(py, &values_json(&self.prepared.start.values(&self.prepared.config)))
    }

    /// The same as a point of the unit cube of the axes.
    #[getter]
    fn start_point(&self) -> Vec<f64> {
        self.prepared.space.start_point()
    }

    /// All about a candidate: fitness, its parameters, and a summary with the error of each pair.
    ///
    /// `candidate` is a dict of parameters by name, laid over the start, or a point of the unit
    /// cube of the axes, which is repaired where its parameters do not go together. Raises
    /// Infeasible, or ValueError of what is no candidate.
    fn evaluate<'py>(
        &self,
        py: Python<'py>,
        candidate: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let line = PyDict::new(py);
        let is_dict = candidate.is_instance_of::<PyDict>();
        let given = match is_dict {
            true => candidate.clone(),
            false => py.import("builtins")?.call_method1("list", (candidate,))?,
        };
        line.set_item(if is_dict { "parameters" } else { "point" }, given)?;
        let line = json("candidate", line.as_any())?;
        let answer = detached(py, || self.search().answer_to(&line));
        let answer = answer.map_err(|error| PyRuntimeError::new_err(error.to_string()))?;
        if let Some(problem) = answer["infeasible"].as_str() {
            return Err(Infeasible::new_err(problem.to_owned()));
        }
        if let Some(problem) = answer["error"].as_str() {
            return Err(value("candidate", problem));
        }
        written(py, &answer)
    }

    /// Fitness of a candidate, smaller is better; infinite if it is infeasible.
    fn __call__(&self, py: Python<'_>, candidate: &Bound<'_, PyAny>) -> PyResult<f64> {
        match self.evaluate(py, candidate) {
            Ok(answer) => answer.get_item("fitness")?.extract(),
            Err(error) if error.is_instance_of::<Infeasible>(py) => Ok(f64::INFINITY),
            Err(error) => Err(error),
        }
    }

    /// Number of pairs.
    fn __len__(&self) -> usize {
        self.prepared.pairs(self.which).pairs.len()
    }

    fn __repr__(&self) -> String {
        let axes = self.prepared.space.axes().len();
        format!("<Objective of {} {} pairs and {axes} axes>", self.__len__(), self.which.name())
    }
}

impl Objective {
    fn search(&self) -> ExternalSearch<'_> {
        ExternalSearch::against(&self.prepared, self.which, self.start.clone())
    }
}
