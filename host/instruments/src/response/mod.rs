//! Response of an instrument: its record of a short echo, with ringing and tail.
//!
//! ```text
//! recording ─ strong ──── estimate ──── model ─────── explain ───────▶ verdicts
//!             lone echoes  level and     Response,     tops of a record:
//!                          spread        text: a file  echoes or explained
//! ```
//!
//! In `f64`: unlike the finder it will not run on a sensor. Derived in benches/record/finder.md,
//! The instrument's response.

mod curve;
mod doubt;
mod estimate;
mod explain;
mod fit;
mod hidden;
mod missed;
mod model;
pub(super) mod robust;
mod strong;
mod text;

pub use estimate::LEAST_ECHOES;
pub(super) use explain::{Candidate, Explained, Record, Verdict};
pub(super) use hidden::Split;
pub use model::{Later, NoResponse, Response};
pub(super) use strong::{at_rest, beginning, own_sigma};
