//! Echo detection for a full-waveform LiDAR: ADC codes in, echoes out.
//!
//! Fixed point throughout the sample path, no allocation, no clock, no I/O. The stages, in the
//! order they run:
//!
//! | stage | module | in | out |
//! |---|---|---|---|
//! | ambient light, noise | [`statistics`] | codes | ambient Q1.15, σ̂ Q13.19 |
//! | saturation, baseline | [`baseline`] | codes | `x`, Q1.15 |
//! | matched filter | [`filter`] | `x` | `y`, Q1.15 |
//! | thresholds, peaks | [`detect`] | `y` | candidates |
//! | sub-sample time | [`refine`] | `y` around a candidate | time Q16.16, height, width |
//! | peaks under peaks | [`split`] | `x`, candidates | candidates |
//! | range, amplitude, SNR | [`echo`] | the refined peak | [`Echo`] |
//!
//! [`Settings`] is what a user may set, with its one table [`PARAMETERS`]; [`Config`] is what the
//! stages read, derived from it once; [`Pipeline`] runs them, with the loops over every sample
//! behind [`Kernel`]. Every format and rounding rule is stated at its stage and followed, bit for
//! bit, by an `f64` twin in the tests.
#![no_std]
#![forbid(unsafe_code)]
// No input reaches a panic, in any build: what cannot be proven by a type is proven by a bound,
// next to it.
#![warn(
    clippy::arithmetic_side_effects,
    clippy::expect_used,
    clippy::indexing_slicing,
    clippy::panic,
    clippy::unreachable
)]
#![cfg_attr(test, allow(clippy::arithmetic_side_effects, clippy::indexing_slicing))]

pub mod accumulate;
pub mod baseline;
pub mod config;
pub mod detect;
pub mod echo;
pub mod edges;
pub mod filter;
pub mod kernel;
pub mod noise;
pub mod pipeline;
pub mod project;
pub mod pulse;
pub mod q;
pub mod refine;
pub mod refusal;
pub mod settings;
pub mod split;
pub mod statistics;
pub mod template;
pub mod timing;

pub use config::{Config, Hardware};
pub use echo::{Echo, Echoes, Flags};
pub use kernel::Kernel;
pub use pipeline::{Pipeline, Scratch};
pub use project::ScanPattern;
pub use refusal::{Reason, Refusal};
pub use settings::{Kind, PARAMETERS, Parameter, ParameterId, Settings};

/// Samples a waveform may hold: the widest waveform resolution of [`PARAMETERS`].
pub const MAX_SAMPLES: usize = 2400;

/// Samples that are taken before the trigger, when the ambient light is measured there.
pub const PRE_TRIGGER: usize = 128;

/// Samples of a shot: those before the trigger and the waveform.
pub const MAX_CODES: usize = PRE_TRIGGER + MAX_SAMPLES;

/// Taps a template may hold: 20 ns at 3.02 GS/s need 121.
pub const MAX_TAPS: usize = 127;

/// Echoes a waveform may yield.
pub const MAX_ECHOES: usize = 4;
