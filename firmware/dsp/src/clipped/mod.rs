//! Echoes that saturate the ADC: time and height from the edges, which are still in range.

pub(crate) mod dithered_config;
pub mod dithered_edges;
pub mod edges;
pub mod height;
pub mod pulse;
