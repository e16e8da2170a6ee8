//! The error of a setting out of bounds.

use echoloop_parameters::Bounds;

/// A setting out of bounds.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{field} is {value}, expected {bound}")]
pub struct ConfigError {
    /// The field of the method's configuration.
    pub field: &'static str,
    /// Its value.
    pub value: f64,
    /// Its bound.
    pub bound: Bounds,
}
