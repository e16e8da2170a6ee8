//! The search: stages of the closed loop, and the choice among their winners.
//!
//! | file | holds |
//! |---|---|
//! | `closed_loop.rs` | the loop of Sec. 4.2: ask, scan, register, tell, stop |
//! | `generation.rs` | one generation: candidates, pairs, evaluation |
//! | `strategies.rs` | order of the stages, and the choice at the end |
//! | `elsewhere.rs` | registrations that are left to other processes |
//! | `stage.rs` | axes, generations and pairs of each stage |
//! | `survey.rs` | aims among which the search begins |
//! | `final_selection.rs` | finalists compared pair by pair on all training pairs |
//!
//! Under [`Strategy::Paper`] there is one stage, and its best candidate is the choice. Under
//! [`Strategy::Fast`] it begins at the best of a survey of aims. Each half is searched from there,
//! side by side, registration's on scans that all candidates share; then each again from the
//! other's winner; then registration's axes, and all axes, from the best so far. The winners meet
//! in the final selection, and the choice is checked on pairs that no search has seen.

mod batch;
mod closed_loop;
mod elsewhere;
mod external_candidate;
mod final_selection;
mod fitness;
mod generation;
mod origin;
mod replay;
mod search_run;
mod shortlist;
mod stage;
mod strategies;
mod survey;
mod tune_search;

use echoloop_cmaes::Constants;

#[cfg(doc)]
use crate::config::preset::Strategy;
pub use batch::ScanTimes;
pub(super) use batch::{Evaluator, Task};
pub use elsewhere::{Elsewhere, PairsOf, ScanResult, ScanTask, TaskError, TaskRegistration};
pub use external_candidate::{Judge, Started};
pub(super) use fitness::mean_cost;
pub use origin::Origin;
pub(super) use replay::difference;
pub use stage::{Place, Stage, stages};
pub use tune_search::{Check, Finalist, Observer, Silent, TuneError, TuneSearch, Tuned};

/// Constants of the optimiser, with which all records were made. Its defaults, pycma's, need some
/// 3 % fewer evaluations with as many axes as here, up to 7 % with five.
pub const CONSTANTS: Constants = Constants::Tutorial;
