//! Settings of the sensor: the table of parameters, the built hardware, and the checks that refuse
//! a set of values with field and bound.

pub(crate) mod check;
pub mod choice;
pub mod hardware;
mod parameters;
pub mod reason;
pub mod refusal;

pub use parameters::{Kind, PARAMETERS, Parameter, ParameterId, Settings};
