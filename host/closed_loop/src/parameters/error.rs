//! Refusals of a set of parameters.

use echoloop_parameters::Refused;

use crate::budget::Exceeded;
use echoloop_registration::ConfigError;

/// A refused set of parameters.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ValueError {
    /// Unknown name, and the names there are.
    #[error("unknown parameter `{0}`; expected one of {1}")]
    Unknown(String, String),
    /// One value by itself.
    #[error(transparent)]
    Refused(#[from] Refused),
    /// An axis that a search cannot have.
    #[error("tune.axes.{name}: {problem}")]
    Axis {
        /// Name of the parameter.
        name: String,
        /// Problem.
        problem: String,
    },
    /// A setting that the method does not have.
    #[error("registration.{key} is no setting of {method}")]
    NotOfMethod {
        /// Key.
        key: String,
        /// Name of the method.
        method: &'static str,
    },
    /// Refinement of a local method, which ends where refinement would.
    #[error("registration.refine goes with a global method, not with {0}")]
    NotRefined(&'static str),
    /// The rules of the method.
    #[error("registration.{0}")]
    Method(#[from] ConfigError),
    /// The rules of the sensor.
    #[error("lidar.{0}")]
    Sensor(#[from] echoloop_dsp::Refusal),
    /// More than the budget has.
    #[error("budget: {0}")]
    Budget(Exceeded),
}
