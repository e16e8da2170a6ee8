//! Points described by what surrounds them, and matched by that: what global methods start from.

mod described;
mod feature;
pub mod fpfh;
mod matches;
pub mod matching;

pub use described::Described;
pub use feature::{DIMENSIONS, Features};
pub use matches::{Match, PointPair, pairs};
