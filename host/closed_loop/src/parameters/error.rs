//! Why a parameter value is refused.

use echoloop_registration::ConfigError;

/// A parameter value that is none.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ValueError {
    /// No such parameter.
    #[error("unknown parameter `{0}`; expected one of {1}")]
    Unknown(String, String),
    /// Out of its range.
    #[error("{name} = {value} is outside {min} to {max}{unit}")]
    Range {
        /// The parameter.
        name: String,
        /// Its value.
        value: f64,
        /// Least.
        min: f64,
        /// Greatest.
        max: f64,
        /// Unit, with a blank before it.
        unit: String,
    },
    /// The search cannot move it as the user wants.
    #[error("tune.axes.{name}: {problem}")]
    Axis {
        /// The parameter.
        name: String,
        /// What is wrong.
        problem: String,
    },
    /// A fraction where whole numbers go.
    #[error("{name} = {value} must be a whole number")]
    Fraction {
        /// The parameter.
        name: String,
        /// Its value.
        value: f64,
    },
    /// Not a number, or without bound.
    #[error("{name} = {value} must be finite")]
    NotFinite {
        /// The parameter.
        name: String,
        /// Its value.
        value: f64,
    },
    /// Not a setting of the chosen method.
    #[error("registration.{key} is no setting of {method}")]
    NotOfMethod {
        /// The key.
        key: String,
        /// The method's name.
        method: &'static str,
    },
    /// A local method ends where refinement would.
    #[error("registration.refine goes with a global method, not with {0}")]
    NotRefined(&'static str),
    /// Refused by the method's own rules.
    #[error("registration.{0}")]
    Method(#[from] ConfigError),
    /// Refused by the sensor's own rules.
    #[error("lidar.{0}")]
    Refused(#[from] echoloop_dsp::Refusal),
}
