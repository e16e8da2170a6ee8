//! One key, and how a value of it is refused.

use std::fmt::Display;

use crate::must::{Case, Must};
use crate::value::{Kind, Value};

/// A key of a configuration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Key {
    /// Section and key, with a dot between.
    pub name: &'static str,
    /// Its unit; empty for what has none.
    pub unit: &'static str,
    /// How it is written.
    pub kind: Kind,
    /// What it must be.
    pub must: Must,
    /// What it is, in a sentence or two.
    pub help: &'static str,
}

/// A value that a key does not take.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{key} = {value} must be {expected}")]
pub struct Refused {
    /// The key.
    pub key: &'static str,
    /// The value.
    pub value: String,
    /// What it must be.
    pub expected: String,
}

impl Key {
    /// Refuses a value that is not as it must be.
    ///
    /// # Errors
    ///
    /// [`Refused`] names the key and its bound.
    pub fn check(&self, value: &impl Value) -> Result<(), Refused> {
        if value.is_as(&self.must) {
            Ok(())
        } else {
            Err(self.refused(value.shown(), self.expected()))
        }
    }

    /// Refuses a number that is not as it must be in one of the key's cases; one without a case of
    /// that name holds.
    ///
    /// # Errors
    ///
    /// [`Refused`] names the key, the bound and the case.
    pub fn check_in(&self, when: &str, number: f64) -> Result<(), Refused> {
        let Must::Cases(cases) = self.must else { return self.check(&number) };
        let is_outside = |case: &&Case| case.when == when && !case.range.holds(number);
        match cases.iter().find(is_outside) {
            Some(case) => Err(self.refused(number, case)),
            None => Ok(()),
        }
    }

    /// What must be said of a value that is none of this key's.
    pub fn refused(&self, value: impl Display, expected: impl Display) -> Refused {
        Refused { key: self.name, value: value.to_string(), expected: expected.to_string() }
    }

    /// What a text must be that is none of this key's: its kind, and its bound.
    pub fn wanted(&self) -> String {
        match (self.kind, self.must) {
            (_, Must::Read(words)) => words.to_owned(),
            (Kind::Whole, must) => format!("a whole number, {must}"),
            (Kind::Number, must) => format!("a number, {must}"),
            (Kind::List, must) => format!("a list, as [1, 2, 3], of {must}"),
            _ => self.expected(),
        }
    }

    /// What a value must be, as the end of a sentence.
    pub fn expected(&self) -> String {
        match self.kind {
            Kind::Numbers(2) => format!("two numbers, {}", self.must),
            Kind::Numbers(3) => format!("three numbers, {}", self.must),
            Kind::Numbers(count) => format!("{count} numbers, {}", self.must),
            _ => self.must.to_string(),
        }
    }
}
