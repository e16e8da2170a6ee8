//! Types of a file's samples.

/// A sample of a waveform.
pub trait Sample: Copy + PartialEq + Into<f64> {}

impl Sample for f64 {}
impl Sample for u8 {}
