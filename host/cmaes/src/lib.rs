//! CMA-ES: ask, tell, stop.
//!
//! Hansen, "The CMA Evolution Strategy: A Tutorial" (arXiv:1604.00772), with active covariance
//! updates. Own code, because bounds, replay and what a report shows sit inside the update.

mod bounds;
mod cmaes;
mod config;
mod margin;
mod random;
mod strategy;

pub use bounds::reflect;
pub use cmaes::{Candidate, CmaEs};
pub use config::{Config, ConfigError, StopReason, Stops, TellError};
pub use strategy::{Constants, Strategy};
