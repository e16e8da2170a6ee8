//! Configurations of keywords and files, and documents of JSON as Python has them.

use std::path::Path;

use echoloop_closed_loop::config::{RunConfig, load};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::arguments::{failed, value};

/// Configuration of a file, with keys laid over it.
pub(crate) fn configuration(
    settings: Option<&Bound<'_, PyDict>>,
    config: Option<&Path>,
) -> PyResult<RunConfig> {
    let mut overrides = Vec::new();
    for (key, setting) in settings.iter().flat_map(|settings| settings.iter()) {
        let key: String = key.extract()?;
        let text = match setting.extract::<String>() {
            Ok(word) => word,
            Err(_) => json(&setting)?,
        };
        let setting = format!("{key}={text}").parse();
        overrides.push(setting.map_err(|problem: String| value(&key, problem))?);
    }
    load(config, &overrides).map_err(failed)
}

/// `json.dumps` of Python; numbers of numpy are written as floats.
pub(crate) fn json(given: &Bound<'_, PyAny>) -> PyResult<String> {
    let py = given.py();
    let keywords = PyDict::new(py);
    keywords.set_item("default", py.import("builtins")?.getattr("float")?)?;
    py.import("json")?.call_method("dumps", (given,), Some(&keywords))?.extract()
}

/// Document of Python that a text in JSON has.
pub(crate) fn document<'py>(py: Python<'py>, text: &str) -> PyResult<Bound<'py, PyAny>> {
    py.import("json")?.call_method1("loads", (text,))
}

/// The same of a value.
pub(crate) fn written<'py>(py: Python<'py>, of: &impl Serialize) -> PyResult<Bound<'py, PyAny>> {
    document(py, &serde_json::to_string(of).map_err(failed)?)
}

/// Value that a document of Python has.
pub(crate) fn read<T: DeserializeOwned>(argument: &str, given: &Bound<'_, PyAny>) -> PyResult<T> {
    serde_json::from_str(&json(given)?).map_err(|problem| value(argument, problem))
}
