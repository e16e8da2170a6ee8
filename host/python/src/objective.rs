//! Errors of parameters on simulated pairs, for an optimiser of Python's.

use std::path::PathBuf;

use echoloop_closed_loop::config::load;
use echoloop_closed_loop::external_search::ExternalSearch;
use echoloop_closed_loop::parameters::values_json;
use echoloop_closed_loop::prepared::{PairSet, Preparation, Prepared};
use echoloop_closed_loop::search::Started;
use echoloop_sensors::sensor::{Model, Sensors};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arguments::value;

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
        let mut overrides = Vec::new();
        for (key, setting) in settings.iter().flat_map(|settings| settings.iter()) {
            let key: String = key.extract()?;
            let text = match setting.extract::<String>() {
                Ok(word) => word,
                Err(_) => json(py, "dumps", &setting)?.extract()?,
            };
            let setting = format!("{key}={text}").parse();
            overrides.push(setting.map_err(|problem: String| value(&key, problem))?);
        }
        let failed = |error: &dyn std::fmt::Display| PyValueError::new_err(error.to_string());
        py.detach(|| {
            let config = load(config.as_deref(), &overrides).map_err(|error| failed(&error))?;
            let sensors = Sensors::in_process(Model::from(&config));
            let preparation =
                Preparation::new(config, sensors, &|_| ()).map_err(|error| failed(&error))?;
            let prepared =
                preparation.traced_for(which, &|_, _| ()).map_err(|error| failed(&error))?;
            let search = ExternalSearch::new(&prepared, which, &|| ());
            let start = search.map_err(|error| failed(&error))?.started();
            Ok(Self { prepared, which, start })
        })
    }

    /// Axes of the search: name, unit, scale ("linear", "log", …), min, max, and choices, a list of
    /// words or None.
    #[getter]
    fn axes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let axes = &self.search().greeting()["axes"];
        json(py, "loads", axes.to_string().into_pyobject(py)?.as_any())
    }

    /// Parameters of the configuration, with which a search begins, by name in their units.
    #[getter]
    fn start<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let values = values_json(&self.prepared.start.values(&self.prepared.config));
        json(py, "loads", values.to_string().into_pyobject(py)?.as_any())
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
        let line: String = json(py, "dumps", line.as_any())?.extract()?;
        let answer = py.detach(|| self.search().answer_to(&line));
        let answer = answer.map_err(|error| PyRuntimeError::new_err(error.to_string()))?;
        if let Some(problem) = answer["infeasible"].as_str() {
            return Err(Infeasible::new_err(problem.to_owned()));
        }
        if let Some(problem) = answer["error"].as_str() {
            return Err(value("candidate", problem));
        }
        json(py, "loads", answer.to_string().into_pyobject(py)?.as_any())
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

/// `json.dumps` or `json.loads` of Python; numbers of numpy are written as floats.
fn json<'py>(
    py: Python<'py>,
    function: &str,
    given: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyAny>> {
    let keywords = PyDict::new(py);
    if function == "dumps" {
        keywords.set_item("default", py.import("builtins")?.getattr("float")?)?;
    }
    py.import("json")?.call_method(function, (given,), Some(&keywords))
}
