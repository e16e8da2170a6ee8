//! What a file may have as a sample.

/// A number of a waveform.
pub trait Sample: Copy + PartialEq + Into<f64> {}

impl Sample for f64 {}
impl Sample for u8 {}
