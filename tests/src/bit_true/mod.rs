//! Bit-true model of the detector: it rounds where the DSP's tables say.
//!
//! It is written from those tables, not from the code: in `f64`, by sorting instead of counting,
//! with sums in any order. `f64` holds nearly every integer here exactly, and [`numbers`] the
//! products that it does not, so tests compare with `==`. Values are in LSB of the DSP's formats.
//! The model takes from the DSP only the constants that are computed in `f32`: the filter's taps
//! and their gain, the timing stage's constants, κ and the scale of reflectivity. Each of them has
//! its own test.
//!
//! | module | models |
//! |---|---|
//! | [`BitTrue`] | `config`, `accumulate` and `pipeline` |
//! | [`statistics`] | `statistics` |
//! | [`filter`] | `baseline`, `filter`, the threshold of `detect` |
//! | [`mod@peaks`] | `detect` |
//! | [`refine`] | `refine`, `height`, `dithered_edges` |
//! | [`split`] | `split` |
//! | [`noise`], [`pulse`], [`edges`], `near`, `ramp`, [`echo`] | modules of the same names |
//! | [`finder`] | the host's echo finder for recorded waveforms |

mod config;
mod dithered_edges;
pub mod echo;
pub mod edges;
pub mod filter;
pub mod finder;
mod height;
mod near;
pub mod noise;
pub mod numbers;
pub mod peaks;
mod pipeline;
pub mod pulse;
mod ramp;
pub mod refine;
pub mod split;
pub mod statistics;
mod values;

pub use config::{BitTrue, LIGHT, period_fs};
pub use noise::Noise;
pub use numbers::{nearest, saturated};
pub use peaks::{choose, climbs, hysteresis, peaks, separate};
pub use pulse::Pulse;
pub use refine::{Waveform, lagrange, rounded_lagrange};
pub use statistics::Order;
pub use values::{Echo, Peak, Refined, Statistics, Threshold};
