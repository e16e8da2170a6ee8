//! A value as documents have it: a whole number of what takes no others.

use serde::Serialize;

/// A value, ready to be written.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Written {
    /// Of a count or a choice: `20`.
    Whole(i64),
    /// Of anything else: `20.0`.
    Real(f64),
}

impl Written {
    /// Whole if what has it takes no other numbers, and this is none.
    pub fn new(value: f64, takes_whole: bool) -> Self {
        match value.fract() == 0.0 && takes_whole {
            true => Self::Whole(value as i64),
            false => Self::Real(value),
        }
    }
}
