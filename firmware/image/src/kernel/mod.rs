//! The DSP's inner loops in this processor's instructions.

#[cfg(dual_multiply)]
mod dual_multiply;

#[cfg(dual_multiply)]
pub use dual_multiply::{DualMultiply, count};

/// The fastest kernel of this processor.
#[cfg(dual_multiply)]
pub type Fastest = DualMultiply;

/// The fastest kernel of this processor.
#[cfg(dual_multiply)]
pub const FASTEST: Fastest = DualMultiply;

/// The fastest kernel of this processor.
#[cfg(not(dual_multiply))]
pub type Fastest = echoloop_dsp::kernel::Scalar;

/// The fastest kernel of this processor.
#[cfg(not(dual_multiply))]
pub const FASTEST: Fastest = echoloop_dsp::kernel::Scalar;
