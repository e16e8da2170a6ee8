//! Features that describe the surroundings of points, and their matches: the start of global
//! methods.

mod described;
mod feature;
pub mod fpfh;
mod matches;
pub mod matching;

pub use described::Described;
pub use feature::{DIMENSIONS, Features};
pub use matches::{Match, PointPair, pairs};
