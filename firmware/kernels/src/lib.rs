//! Loops of the detector over samples, in a processor's own instructions.
//!
//! ```
//! use echoloop_dsp::{Hardware, Pipeline, Scratch, Settings};
//!
//! let pipeline = Pipeline::new(&Settings::default(), &Hardware::REFERENCE).expect("defaults run");
//! let echoes = echoloop_kernels::process(&pipeline, &[100; 1024], &mut Scratch::default());
//! assert!(echoes.is_empty());
//! ```
//!
//! | processor | loops |
//! |---|---|
//! | x86-64-v3 | `x86`: the same source compiled once more, and loops by hand for AVX2 |
//! | … with AVX-512 and its VNNI | the filter, 128 outputs at a time |
//! | Armv7E-M, Armv8-M with the DSP extension | `dual_multiply`: two samples an instruction |
//! | Armv8.1-M with MVE (`-C target-cpu=cortex-m55`) | `mve`: eight samples an instruction |
//! | any other | [`echoloop_dsp::loops::Portable`], [`echoloop_dsp::loops::Scalar`] |
//!
//! All of them give the same bytes; tests compare them.

#![cfg_attr(not(test), no_std)]

#[cfg(dual_multiply)]
mod dual_multiply;
#[cfg(any(mve, target_arch = "x86_64"))]
mod four_probes;
#[cfg(mve)]
mod mve;
#[cfg(target_arch = "x86_64")]
mod x86;

use echoloop_dsp::loops::Portable;
use echoloop_dsp::{Echoes, Pipeline, Scratch};

#[cfg(dual_multiply)]
pub use dual_multiply::{DualMultiply as Fastest, count};
#[cfg(not(any(dual_multiply, mve)))]
pub use echoloop_dsp::loops::Scalar as Fastest;
#[cfg(not(dual_multiply))]
pub use echoloop_dsp::statistics::count;
#[cfg(mve)]
pub use mve::Mve as Fastest;
#[cfg(target_arch = "x86_64")]
pub use x86::{process, process_compiled};

/// Fastest loops of this microcontroller.
pub const FASTEST: Fastest = Fastest;

/// Name of [`FASTEST`] in benches/record/cost.md; `None` where it is plain Rust.
pub const OWN_INSTRUCTIONS: Option<&str> = if cfg!(mve) {
    Some("mve")
} else if cfg!(dual_multiply) {
    Some("dual_multiply")
} else {
    None
};

/// [`Pipeline::process`] as compiled for the target's baseline.
#[inline(always)]
pub fn process_baseline(pipeline: &Pipeline, codes: &[u16], scratch: &mut Scratch) -> Echoes {
    pipeline.process(Portable, codes, scratch)
}

/// [`Pipeline::process`]; there are no loops by hand for this processor on a PC.
#[cfg(not(target_arch = "x86_64"))]
pub fn process(pipeline: &Pipeline, codes: &[u16], scratch: &mut Scratch) -> Echoes {
    process_baseline(pipeline, codes, scratch)
}

/// [`process`]: the same source, which the compiler vectorises as it stands.
#[cfg(not(target_arch = "x86_64"))]
pub fn process_compiled(pipeline: &Pipeline, codes: &[u16], scratch: &mut Scratch) -> Echoes {
    process_baseline(pipeline, codes, scratch)
}
