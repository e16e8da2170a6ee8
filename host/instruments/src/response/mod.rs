//! The response of an instrument: what it records of a short echo, its ringing and tail with it.
//!
//! ```text
//! recording ─ strong ──── estimate ──── model ─────── explain ───────▶ verdicts
//!             echoes that  level and     Response,     tops of a record:
//!             stand alone  spread        text: a file  echoes or explained
//! ```
//!
//! In `f64`: unlike the finder this is no candidate for an image. Why it is done so:
//! benches/record/finder.md, The instrument's response.

mod curve;
mod estimate;
mod explain;
mod fit;
mod model;
mod robust;
mod strong;
mod text;

pub use estimate::LEAST_ECHOES;
pub(super) use explain::{Candidate, Record, Verdict};
pub use model::{Later, NoResponse, Response};
pub(super) use strong::at_rest;
