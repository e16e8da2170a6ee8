//! Number in a document: whole where only whole numbers are possible.

use serde::Serialize;

/// Number, ready to be written.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Written {
    /// Count or choice: `20`.
    Whole(i64),
    /// Any other number: `20.0`.
    Real(f64),
}

impl Written {
    /// [`Self::Whole`] when `takes_whole` and the value has no fraction.
    pub fn new(value: f64, takes_whole: bool) -> Self {
        match value.fract() == 0.0 && takes_whole {
            true => Self::Whole(value as i64),
            false => Self::Real(value),
        }
    }
}
