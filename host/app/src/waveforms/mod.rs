//! Waveforms that other instruments recorded, and their echoes.
//!
//! ```text
//! file ─ read → rows of numbers ─ codes → ADC codes ─ finder → samples ─ echoes → ns, own units
//! ```

pub mod codes;
mod csv;
pub mod echoes;
pub mod finder;
mod npy;
mod problem;
pub mod read;

pub use echoes::{Echo, Finder, Options, Waveform};
pub use read::{WaveformError, parse_waveforms, read_waveforms};
