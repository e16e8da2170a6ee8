//! Flags that are numbers, refused with their bounds before any work.

use std::str::FromStr;

use clap::builder::{StringValueParser, TypedValueParser};
use echoloop_keys::{Key, Kind, Must, Value};

use echoloop_closed_loop::config::key;

/// Bound of a flag that is no key of the configuration.
pub(super) const fn flag(kind: Kind, must: Must) -> Key {
    Key { name: "", unit: "", kind, must, help: "" }
}

/// Bound of `--threads`.
pub(super) const THREADS: Key = flag(Kind::Whole, Must::between(0.0, 1024.0));

/// Bound of counts without a limit.
pub(super) const ANY: Key = flag(Kind::Whole, Must::at_least(0.0));

/// Parser of a number with the bound of a key.
pub(super) fn number_as<T>(key: Key) -> impl TypedValueParser<Value = T>
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
    number_as(key(name).copied().unwrap_or(flag(kind, Must::at_least(0.0))))
}

/// Reads a number within a bound.
pub(super) fn read<T: FromStr + Value>(key: &Key, text: &str) -> Result<T, String> {
    let number = text.parse().ok().filter(|number: &T| number.is_as(&key.must));
    number.ok_or_else(|| format!("expected {}", key.wanted()))
}

/// Reads a seed that a file can hold.
pub(super) fn seed(text: &str) -> Result<u64, String> {
    let seed = text.parse().ok().filter(|&seed: &u64| i64::try_from(seed).is_ok());
    seed.ok_or_else(|| format!("expected {}", Must::SEED))
}
