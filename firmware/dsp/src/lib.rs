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
mod check;
pub mod choice;
pub mod config;
pub mod detect;
pub mod echo;
pub mod edges;
pub mod filter;
pub mod flags;
pub mod hardware;
pub mod kernel;
pub mod lagrange;
pub mod limits;
pub mod noise;
pub mod peak;
pub mod pipeline;
pub mod project;
pub mod pulse;
pub mod q;
pub mod reason;
pub mod refine;
pub mod refusal;
pub mod settings;
pub mod split;
pub mod statistics;
pub mod template;
pub mod timing;

pub use check::Choices;
pub use choice::{AmbientEstimator, DenoiseFilter, EchoChoice, TimingMethod};
pub use config::Config;
pub use echo::{Echo, Echoes};
pub use flags::Flags;
pub use hardware::Hardware;
pub use kernel::Kernel;
pub use limits::{MAX_CODES, MAX_ECHOES, MAX_SAMPLES, MAX_TAPS, PRE_TRIGGER};
pub use pipeline::{Pipeline, Scratch};
pub use project::ScanPattern;
pub use reason::Reason;
pub use refusal::Refusal;
pub use settings::{Kind, PARAMETERS, Parameter, ParameterId, Settings};
