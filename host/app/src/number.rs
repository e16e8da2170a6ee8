//! Flags that are numbers: what they take is said with the flag, before any work.

use std::str::FromStr;

use clap::builder::{StringValueParser, TypedValueParser};
use echoloop_parameters::{Key, Kind, Must, Value};

use echoloop_closed_loop::config::key;

/// A flag's bound, where it is no key of the configuration.
pub(super) const fn flag(kind: Kind, must: Must) -> Key {
    Key { name: "", unit: "", kind, must, help: "" }
}

/// Threads. More are none of a processor's.
pub(super) const THREADS: Key = flag(Kind::Whole, Must::between(0.0, 1024.0));

/// As many as one likes.
pub(super) const ANY: Key = flag(Kind::Whole, Must::at_least(0.0));

/// Reads a number that is as a key must be.
pub(super) fn number_as<T>(key: Key) -> impl TypedValueParser<Value = T>
where
    T: FromStr + Value + Clone + Send + Sync + 'static,
{
    StringValueParser::new().try_map(move |text| read(&key, &text))
}

/// Reads a number that sets the key of that name.
pub(super) fn number_of<T>(name: &'static str) -> impl TypedValueParser<Value = T>
where
    T: FromStr + Value + Clone + Send + Sync + 'static,
{
    // A name that is no key's takes any number of its type; the tests know every flag's.
    let kind = if T::KIND == Kind::Whole { Kind::Whole } else { Kind::Number };
    number_as(key(name).copied().unwrap_or(flag(kind, Must::at_least(0.0))))
}

/// The number of a text.
pub(super) fn read<T: FromStr + Value>(key: &Key, text: &str) -> Result<T, String> {
    let number = text.parse().ok().filter(|number: &T| number.is_as(&key.must));
    number.ok_or_else(|| format!("expected {}", key.wanted()))
}

/// Reads a seed: one that a file can hold.
pub(super) fn seed(text: &str) -> Result<u64, String> {
    let seed = text.parse().ok().filter(|&seed: &u64| i64::try_from(seed).is_ok());
    seed.ok_or_else(|| format!("expected {}", Must::SEED))
}
