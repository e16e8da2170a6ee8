//! One parameter, and the refusal of a value of it.

use std::fmt::Display;

use crate::bounds::{Bounds, Case};
use crate::value::{Kind, Value};

/// A parameter of a run: a key of its configuration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    /// Section and key, with a dot between.
    pub key: &'static str,
    /// Unit; empty for plain numbers.
    pub unit: &'static str,
    /// Kind of its value.
    pub kind: Kind,
    /// Bounds of its value.
    pub bounds: Bounds,
    /// Meaning, in a sentence or two.
    pub help: &'static str,
}

/// A value that is refused: key, value and the problem.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{key} = {value}{problem}")]
pub struct Refused {
    /// Key.
    pub key: &'static str,
    /// Value.
    pub value: String,
    /// Problem, as the end of the sentence: ` must be 0 to 1`.
    pub problem: String,
}

impl Refused {
    /// The refusal of a value that must be something else.
    pub fn new(key: &'static str, value: impl Display, expected: impl Display) -> Self {
        Self { key, value: value.to_string(), problem: format!(" must be {expected}") }
    }
}

impl Parameter {
    /// Checks a value by itself.
    ///
    /// # Errors
    ///
    /// [`Refused`] names the key and its bounds.
    pub fn check(&self, value: &impl Value) -> Result<(), Refused> {
        match value.is_within(&self.bounds) {
            true => Ok(()),
            false => Err(self.refused(value.printed(), self.expected())),
        }
    }

    /// Checks a number under one condition of its bounds. A number without such a condition is
    /// allowed.
    ///
    /// # Errors
    ///
    /// [`Refused`] names the key, the bounds and the condition.
    pub fn check_in(&self, when: &str, number: f64) -> Result<(), Refused> {
        let Bounds::Cases(cases) = self.bounds else { return self.check(&number) };
        let is_outside = |case: &&Case| case.when == when && !case.range.contains(number);
        match cases.iter().find(is_outside) {
            Some(case) => Err(self.refused(number, case)),
            None => Ok(()),
        }
    }

    /// The refusal of a value that must be something else.
    pub fn refused(&self, value: impl Display, expected: impl Display) -> Refused {
        Refused::new(self.key, value, expected)
    }

    /// Kind and bounds, to follow "expected": the message for text that is no such value.
    pub fn expected_of_text(&self) -> String {
        match (self.kind, self.bounds) {
            (_, Bounds::Words(words)) => words.to_owned(),
            (Kind::Whole, bounds) => format!("a whole number, {bounds}"),
            (Kind::Number, bounds) => format!("a number, {bounds}"),
            (Kind::List, bounds) => format!("a list, as [1, 2, 3], of {bounds}"),
            _ => self.expected(),
        }
    }

    /// Bounds, to follow "must be".
    pub fn expected(&self) -> String {
        match self.kind {
            Kind::Numbers(2) => format!("two numbers, {}", self.bounds),
            Kind::Numbers(3) => format!("three numbers, {}", self.bounds),
            Kind::Numbers(count) => format!("{count} numbers, {}", self.bounds),
            _ => self.bounds.to_string(),
        }
    }
}
