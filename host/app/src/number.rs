//! Flags that are numbers, refused with their bounds before any work.

use std::str::FromStr;

use clap::builder::{StringValueParser, TypedValueParser};
use echoloop_parameters::{Bounds, Kind, Parameter, Value};

use echoloop_closed_loop::config::key;

/// Bounds of a flag that is no key of the configuration.
pub(super) const fn flag(kind: Kind, bounds: Bounds) -> Parameter {
    Parameter { key: "", unit: "", kind, bounds, help: "" }
}

/// Number of threads; no processor has more than the bound.
pub(super) const THREADS: Parameter = flag(Kind::Whole, Bounds::between(0.0, 1024.0));

/// Any whole number from 0.
pub(super) const ANY: Parameter = flag(Kind::Whole, Bounds::at_least(0.0));

/// Reads a number within a key's bounds.
pub(super) fn number_as<T>(key: Parameter) -> impl TypedValueParser<Value = T>
where
    T: FromStr + Value + Clone + Send + Sync + 'static,
{
    StringValueParser::new().try_map(move |text| read(&key, &text))
}

/// Parser of a number that sets a key of the configuration.
pub(super) fn number_of<T>(name: &'static str) -> impl TypedValueParser<Value = T>
where
    T: FromStr + Value + Clone + Send + Sync + 'static,
{
    // A name that is no key takes any number; tests hold the bound of every flag.
    let kind = if T::KIND == Kind::Whole { Kind::Whole } else { Kind::Number };
    number_as(key(name).copied().unwrap_or(flag(kind, Bounds::at_least(0.0))))
}

/// The number of a text.
pub(super) fn read<T: FromStr + Value>(key: &Parameter, text: &str) -> Result<T, String> {
    let number = text.parse().ok().filter(|number: &T| number.is_within(&key.bounds));
    number.ok_or_else(|| format!("expected {}", key.expected_of_text()))
}

/// Reads a seed that a file can hold.
pub(super) fn seed(text: &str) -> Result<u64, String> {
    let seed = text.parse().ok().filter(|&seed: &u64| i64::try_from(seed).is_ok());
    seed.ok_or_else(|| format!("expected {}", Bounds::SEED))
}
