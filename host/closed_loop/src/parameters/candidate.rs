//! Candidates of another program's search, as JSON.

use std::collections::BTreeMap;
use std::io;
use std::path::Path;

use echoloop_files::{MOST_TEXT, one_line, read_text, text_from};
use serde::Deserialize;
use serde_json::Value;

use super::{Values, choices};
use crate::config::LoadError;
use crate::run_folder::files::file_error;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Candidate {
    parameters: BTreeMap<String, Value>,
}

/// Reads a candidate, `{"parameters": {"lidar.power": 50, …}}`; `-` is standard input.
///
/// # Errors
///
/// [`LoadError`] names the file.
pub fn read_candidate(path: &Path) -> Result<Values, LoadError> {
    let is_stdin = path == Path::new("-");
    let text =
        if is_stdin { text_from(io::stdin(), MOST_TEXT) } else { read_text(path, MOST_TEXT) }
            .map_err(file_error("read", path))?;
    let malformed = |message| LoadError::Parse { path: path.to_owned(), message };
    let candidate: Candidate =
        serde_json::from_str(&text).map_err(|error| malformed(one_line(&error.to_string())))?;
    candidate_values(candidate.parameters).map_err(malformed)
}

/// Parameters of a candidate: numbers, and choices by name or number.
///
/// # Errors
///
/// Name, value and what was expected instead.
pub fn candidate_values(given: BTreeMap<String, Value>) -> Result<Values, String> {
    let value = |(name, given): (String, Value)| match number(&name, &given) {
        Ok(value) => Ok((name, value)),
        Err(problem) => Err(one_line(&problem)),
    };
    given.into_iter().map(value).collect()
}

fn number(name: &str, given: &Value) -> Result<f64, String> {
    let names = choices(name);
    let index = names.iter().zip(0u32..).find(|(choice, _)| given.as_str() == Some(**choice));
    match index {
        Some((_, index)) => Ok(f64::from(index)),
        None if given.is_number() => {
            given.as_f64().ok_or_else(|| format!("{name} = {given} must be finite"))
        }
        None if names.is_empty() => Err(format!("{name} = {given} must be a number")),
        None => Err(format!("{name} = {given} must be one of {}", names.join(", "))),
    }
}
