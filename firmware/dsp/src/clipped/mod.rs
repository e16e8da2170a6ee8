//! Echoes that saturate the ADC: time and height from the edges, which are still in range.

pub mod edges;
pub mod fine;
pub(crate) mod fine_config;
pub mod height;
pub mod pulse;
