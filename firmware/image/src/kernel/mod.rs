//! The DSP's inner loops in this processor's instructions.

/// The fastest kernel of this processor.
pub type Fastest = echoloop_dsp::kernel::Scalar;

/// The fastest kernel of this processor.
pub const FASTEST: Fastest = echoloop_dsp::kernel::Scalar;
