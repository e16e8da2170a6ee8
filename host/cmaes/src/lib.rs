//! CMA-ES: ask, tell, stop.
//!
//! An example: `README.md`.
//!
//! Candidate i of generation g is a function of the seed and of the values told, the same on every
//! machine and any number of threads. To resume a search, tell it the same values again.
//!
//! | feature | method |
//! |---|---|
//! | bounds | the unit cube, by reflection ([`reflect`]) |
//! | whole numbers | cells of 0 to 1, with margin (arXiv:2205.13482): [`Coordinate::Whole`] |
//! | choices | a probability for each name, CatCMA (arXiv:2405.09962): [`Coordinate::Choice`] |
//! | constants | of the tutorial or of pycma 4.5: [`Constants`] |
//! | two objectives | NSGA-II, by ask and tell as well: [`Pareto`] |
//! | stops | generations, target, too small or large steps, condition: [`Stops`] |
//!
//! After Hansen, "The CMA Evolution Strategy: A Tutorial" (arXiv:1604.00772), with active
//! covariance updates. Written here instead of taken from a crate, because bounds, resuming and the
//! quantities that a report shows sit inside the update.

mod bounds;
mod choices;
mod cmaes;
mod config;
mod gaussian;
mod margin;
mod pareto;
mod random;
mod strategy;

pub use bounds::reflect;
pub use cmaes::{Candidate, CmaEs};
pub use config::{CmaEsConfig, ConfigError, Coordinate, StopReason, Stops, TellError};
pub use pareto::{
    Objectives, Pareto, ParetoConfig, Valued, dominates, hypervolume, ranks, sorted_by_crowding,
};
pub use strategy::{Constants, Strategy};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
