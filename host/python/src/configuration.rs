//! Configurations of keywords and files, and documents of JSON as Python has them.

use std::path::Path;

use echoloop_closed_loop::config::{Override, RunConfig, load};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::arguments::{failed, value};

/// Configuration of a file, with keys laid over it.
pub(crate) fn configuration(
    settings: Option<&Bound<'_, PyDict>>,
    config: Option<&Path>,
) -> PyResult<RunConfig> {
    let mut overrides = Vec::new();
    for (key, setting) in settings.iter().flat_map(|settings| settings.iter()) {
        let key: String = key.extract()?;
        let own = match setting.extract::<String>() {
            Ok(word) => format!("{key}={word}").parse().map_err(|why: String| value(&key, why))?,
            Err(_) => Override::flag(&key, toml_value(&key, read(&key, &setting)?)?),
        };
        overrides.push(own.written(&format!("setting {key}")));
    }
    load(config, &overrides).map_err(failed)
}

/// Value of TOML that one of JSON is.
fn toml_value(key: &str, given: Value) -> PyResult<toml::Value> {
    let own = |given| toml_value(key, given);
    Ok(match given {
        Value::Null => return Err(value(key, "expected a number, a word or a list, found None")),
        Value::Bool(given) => given.into(),
        Value::String(given) => given.into(),
        Value::Number(given) => match (given.as_i64(), given.as_f64()) {
            (Some(whole), _) => whole.into(),
            (None, Some(number)) => number.into(),
            _ => return Err(value(key, format!("expected a smaller number, found {given}"))),
        },
        Value::Array(given) => given.into_iter().map(own).collect::<PyResult<Vec<_>>>()?.into(),
        Value::Object(given) => {
            let pairs = given.into_iter().map(|(name, given)| Ok((name, own(given)?)));
            pairs.collect::<PyResult<toml::Table>>()?.into()
        }
    })
}

/// `json.dumps` of Python; numbers and arrays of numpy are written as those of Python.
pub(crate) fn json(argument: &str, given: &Bound<'_, PyAny>) -> PyResult<String> {
    let py = given.py();
    let keywords = PyDict::new(py);
    let of_numpy = py.import("operator")?.call_method1("methodcaller", ("tolist",))?;
    keywords.set_item("default", of_numpy)?;
    let text = py.import("json")?.call_method("dumps", (given,), Some(&keywords));
    text.map_err(|error| value(argument, format!("expected numbers, words and lists: {error}")))?
        .extract()
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
    serde_json::from_str(&json(argument, given)?).map_err(|problem| value(argument, problem))
}
