//! The closed loop: candidates go to the sensor, scans come back, errors go to the optimiser.
//!
//! A run is one search or several ([`TuneSearch::stages`]), each from the winner of the one before.
//! Under [`Strategy::Paper`] there is one, and its best candidate is the choice. Under
//! [`Strategy::Fast`] registration's axes come first, on scans that all candidates share, then the
//! sensor's, then all together; the winners of the halves meet those of the whole in a race on all
//! training pairs.

mod course;
mod judge;
mod price;
mod race;
mod replay;
mod search;
mod stage;
mod tasks;

#[cfg(doc)]
use crate::experiment::preset::Strategy;
pub use judge::Judge;
pub(super) use price::mean_cost;
pub use search::{Finalist, Observer, Silent, TuneError, TuneSearch, Tuned};
pub use stage::{Stage, stages};
pub(super) use tasks::{Crew, Task};
