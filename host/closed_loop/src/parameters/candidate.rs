//! Candidates that another's search has made.

use std::collections::BTreeMap;
use std::path::Path;

use echoloop_files::{MOST_TEXT, read_text, shown, text_from};
use serde::Deserialize;
use serde_json::Value;

use super::exit::Failure;
use echoloop_closed_loop::parameters::{Values, choices};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Candidate {
    parameters: BTreeMap<String, Value>,
}

/// The parameters of a candidate's file; `-` is standard input.
pub(super) fn candidate_values(path: &Path) -> Result<Values, Failure> {
    let is_stdin = path == Path::new("-");
    let text =
        if is_stdin { text_from(std::io::stdin(), MOST_TEXT) } else { read_text(path, MOST_TEXT) }
            .map_err(|error| Failure::usage(format!("cannot read {}: {error}", path.display())))?;
    let refused = |problem| Failure::usage(format!("{}: {problem}", path.display()));
    let candidate: Candidate =
        serde_json::from_str(&text).map_err(|error| refused(shown(&error.to_string())))?;
    let value = |(name, given): (String, Value)| number(&name, &given).map(|value| (name, value));
    candidate.parameters.into_iter().map(value).collect::<Result<_, _>>().map_err(refused)
}

/// The number that a candidate gives a named parameter: itself or, of a choice, its name.
pub(super) fn number(name: &str, given: &Value) -> Result<f64, String> {
    told_number(name, given).map_err(|problem| shown(&problem))
}

fn told_number(name: &str, given: &Value) -> Result<f64, String> {
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
