//! Echo detection for a full-waveform LiDAR: ADC codes in, echoes out.
//!
//! ```
//! use echoloop_dsp::loops::Portable;
//! use echoloop_dsp::{Hardware, Pipeline, Scratch, Settings};
//!
//! // 800 codes of darkness at 100, and the echo of a 5 ns pulse around sample 300.
//! let mut codes = [100u16; 800];
//! let pulse = [14, 52, 103, 152, 190, 205, 190, 152, 103, 52, 14];
//! for (code, height) in codes[295..].iter_mut().zip(pulse) {
//!     *code += height * 10;
//! }
//!
//! let pipeline = Pipeline::new(&Settings::default(), &Hardware::REFERENCE)?;
//! let mut scratch = Scratch::new(); // 30 kB, reused for every waveform
//! let echoes = pipeline.process(Portable, &codes, &mut scratch);
//!
//! // Sample 0 lies at 1 m; 800 samples span 119 m.
//! let expected_m = 1.0 + 300.0 * 119.0 / 800.0;
//! assert_eq!(echoes.len(), 1);
//! assert!((echoes[0].range_m() - expected_m).abs() < 0.01);
//! # Ok::<(), echoloop_dsp::Refusal>(())
//! ```
//!
//! Fixed point throughout the sample path, no allocation, no clock, no I/O. The stages, in the
//! order they run:
//!
//! | stage | module | in | out |
//! |---|---|---|---|
//! | ambient light, noise | [`statistics`] | codes | ambient Q1.15, σ̂ Q13.19 |
//! | saturation, baseline | [`baseline`], [`near`] | codes | `x`, Q1.15 |
//! | matched filter | [`filter`] | `x` | `y`, Q1.15 |
//! | thresholds, peaks | [`detect`] | `y` | candidates |
//! | overlapping echoes | [`split`] | `x`, candidates | candidates |
//! | choice of echoes | [`detect`], [`height`] | candidates | at most four |
//! | sub-sample time | [`refine`], [`edges`], [`dithered_edges`] | a candidate | time, width |
//! | range, amplitude, SNR | [`echo`] | the refined peak | [`Echo`] |
//!
//! [`Settings`] holds all that a user may set; its one table is [`PARAMETERS`]. [`DetectorConfig`]
//! holds the constants of the stages, derived from the settings once. [`Pipeline`] runs the stages;
//! the loops over every sample are behind [`SampleLoops`]. Every format and rounding rule is stated
//! at its stage, and a model in `f64` in the tests follows it bit for bit. Derivations are in
//! `benches/record/detector.md`.
//!
//! | feature | brings | for |
//! |---|---|---|
//! | `wire`, on by default | serde, postcard-schema | settings and echoes as messages |
//! | `nalgebra`, on by default | nalgebra | beams and points as its vectors |
//! | `defmt` | defmt | settings and echoes in a log |
//!
//! With none of them the crate needs fixed, heapless, libm and micromath, and the echoes are the
//! same.
#![no_std]
#![forbid(unsafe_code)]
// No input reaches a panic, in any build: the proof is a type, or a bound stated beside the code.
#![warn(
    clippy::arithmetic_side_effects,
    clippy::expect_used,
    clippy::indexing_slicing,
    clippy::panic,
    clippy::unreachable
)]
#![cfg_attr(test, allow(clippy::arithmetic_side_effects, clippy::indexing_slicing))]

mod clipped;
pub mod config;
pub mod limits;
pub mod loops;
pub mod pipeline;
pub mod q;
mod rising_gain;
pub mod scan_pattern;
pub mod settings;
mod stages;

// One level of names for users, whatever folder a file is in.
pub use clipped::{dithered_edges, edges, height, pulse};
pub use rising_gain::{near, ramp};
pub use settings::{choice, hardware, reason, refusal};
pub use stages::{
    accumulate, baseline, dark, detect, echo, filter, flags, lagrange, noise, peak, refine, split,
    statistics, template, timing,
};

pub use choice::{AmbientEstimator, Choices, DenoiseFilter, EchoChoice, TimingMethod};
pub use config::DetectorConfig;
pub use echo::{Echo, Echoes};
pub use flags::Flags;
pub use hardware::Hardware;
pub use limits::{MAX_CODES, MAX_ECHOES, MAX_SAMPLES, MAX_TAPS, PRE_TRIGGER};
pub use loops::SampleLoops;
pub use pipeline::{Pipeline, Scratch};
pub use reason::Reason;
pub use refusal::Refusal;
pub use scan_pattern::ScanPattern;
pub use scan_pattern::grid::Grid;
pub use scan_pattern::rosette::Rosette;
pub use scan_pattern::spinning::{Spinning, SpinningModel};
pub use scan_pattern::steered::{Aim, Steered};
pub use scan_pattern::table::BeamTable;
pub use settings::check::pulse_energy_pj;
pub use settings::{Kind, PARAMETERS, Parameter, ParameterId, Settings};

/// The README's example runs as written there.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
