//! Echoes that saturate the ADC: their time and height come from the edges, which are not clipped.

pub(crate) mod dithered_config;
pub mod dithered_edges;
pub mod edges;
pub mod height;
pub mod pulse;
