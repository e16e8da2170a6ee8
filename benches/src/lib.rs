//! Parts that several benches and programs share.

pub mod cpu;
pub mod pairs;
pub mod waveforms;

use std::error::Error;

/// Result with any error, which may be passed between threads.
pub type Result<T> = std::result::Result<T, Box<dyn Error + Send + Sync>>;
