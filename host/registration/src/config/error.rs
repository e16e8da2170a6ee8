//! Why settings cannot run.

/// A setting that cannot run: which one, what it is, what it must be.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{field} is {value}, expected {bound}")]
pub struct ConfigError {
    /// The field of the method's configuration.
    pub field: &'static str,
    /// Its value.
    pub value: f64,
    /// What it must be.
    pub bound: &'static str,
}
