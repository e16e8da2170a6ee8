//! How registration runs: Θ_reg of each method.

mod features;
mod fgr;
mod gicp;
mod icp;
mod mac;
mod method;

pub use features::{Convention, FeatureConfig};
pub use fgr::{FgrConfig, FgrMode};
pub use gicp::GicpConfig;
pub use icp::IcpConfig;
pub use mac::MacConfig;
pub use method::{Method, MethodConfig, current_key, former_key};

/// More neighbours make no better normal, and take their time: some tens are usual.
const MAX_NEIGHBOURS: usize = 1000;

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

fn require(
    field: &'static str,
    value: f64,
    holds: bool,
    bound: &'static str,
) -> Result<(), ConfigError> {
    if holds { Ok(()) } else { Err(ConfigError { field, value, bound }) }
}

fn require_lengths(lengths: &[(&'static str, f64)]) -> Result<(), ConfigError> {
    lengths.iter().try_for_each(|&(field, m)| {
        require(field, m, m > 0.0 && m <= 1e6, "a length above 0 m, at most 1e6 m")
    })
}

/// Those of features are kept for all points at once, so they are bounded more tightly: 500 for
/// each of 100,000 points are 0.4 GB.
const MAX_FEATURE_NEIGHBOURS: usize = 500;

fn require_feature_neighbours(field: &'static str, count: usize) -> Result<(), ConfigError> {
    require(field, count as f64, (3..=MAX_FEATURE_NEIGHBOURS).contains(&count), "3 to 500")
}

fn require_neighbours(field: &'static str, count: usize) -> Result<(), ConfigError> {
    require(field, count as f64, (3..=MAX_NEIGHBOURS).contains(&count), "3 to 1000")
}
