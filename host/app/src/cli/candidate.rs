//! Values of a candidate that another's search has made.

use echoloop_files::shown;
use serde_json::Value;

use crate::experiment::params::choices;

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
