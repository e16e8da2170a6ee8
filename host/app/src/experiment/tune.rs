//! The closed loop: candidates go to the sensor, scans come back, errors go to the optimiser.
//!
//! A run is one search or several ([`TuneSearch::stages`]). Under [`Strategy::Paper`] there is one,
//! and its best candidate is the choice. Under [`Strategy::Fast`] each half is searched from the
//! start, registration's on scans that all candidates share; then the sensor's axes from
//! registration's winner, then all together. The winners of the halves meet those of the whole in a
//! race on all training pairs.

mod course;
mod judge;
mod origin;
mod price;
mod race;
mod replay;
mod search;
mod stage;
mod tasks;

use echoloop_cmaes::Constants;

#[cfg(doc)]
use crate::experiment::preset::Strategy;
pub use judge::Judge;
pub use origin::Origin;
pub(super) use price::mean_cost;
pub use search::{Check, Finalist, Observer, Silent, TuneError, TuneSearch, Tuned};
pub use stage::{Stage, stages};
pub(super) use tasks::{Crew, Task};

/// The optimiser's constants: those that all records were made with. Its default, pycma's, need
/// some 3 % less where there are as many axes as here, up to 7 % where there are five.
pub(crate) const CONSTANTS: Constants = Constants::Tutorial;
