//! The closed loop: candidates go to the sensor, scans come back, errors go to the optimiser.
//!
//! A run is one search or several ([`TuneSearch::stages`]). Under [`Strategy::Paper`] there is one,
//! and its best candidate is the choice. Under [`Strategy::Fast`] each half is searched from the
//! start, registration's on scans that all candidates share; then the sensor's axes from
//! registration's winner, then all together. The winners of the halves meet those of the whole in a
//! race on all training pairs.

mod batch;
mod external_candidate;
mod final_selection;
mod fitness;
mod origin;
mod replay;
mod search_loop;
mod stage;
mod tune_search;

use echoloop_cmaes::Constants;

#[cfg(doc)]
use crate::config::preset::Strategy;
pub(super) use batch::{Crew, Task};
pub use external_candidate::Judge;
pub(super) use fitness::mean_cost;
pub use origin::Origin;
pub use stage::{Stage, stages};
pub use tune_search::{Check, Finalist, Observer, Silent, TuneError, TuneSearch, Tuned};

/// The optimiser's constants: those that all records were made with. Its default, pycma's, need
/// some 3 % less where there are as many axes as here, up to 7 % where there are five.
pub const CONSTANTS: Constants = Constants::Tutorial;
