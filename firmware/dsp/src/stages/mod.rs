//! Stages of the detector, each a file with its equation, formats and rounding. Their order is in
//! [`Pipeline::process`](crate::Pipeline::process).

pub mod accumulate;
pub mod baseline;
pub mod dark;
pub mod detect;
pub mod echo;
pub mod filter;
pub mod flags;
pub mod lagrange;
pub mod noise;
pub mod peak;
pub mod refine;
pub mod split;
pub mod statistics;
pub mod template;
pub mod timing;
