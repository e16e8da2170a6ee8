//! The bit-true model: it rounds where the DSP's tables say.
//!
//! Written from those tables, not from the code: in `f64`, by sorting instead of counting, with
//! sums in no particular order. `f64` holds nearly every integer here exactly, and [`numbers`] the
//! products it does not, so the comparison is `==`. Values are in LSB of the DSP's formats. Of the
//! DSP it takes only what is computed in `f32`: the filter's taps and their gain, the timing
//! stage's constants, κ and the scale of reflectivity, each of which has a test of its own; and
//! where more than one echo is asked for, which peaks hide under others, whose model is [`split`].
//!
//! | module | model of |
//! |---|---|
//! | [`BitTrue`] | `config`; its methods, of `accumulate` and `pipeline` |
//! | [`statistics`] | `statistics` |
//! | [`filter`] | `baseline`, `filter`, the threshold of `detect` |
//! | [`mod@peaks`] | `detect` |
//! | [`refine`] | `refine`, `height`, `fine` |
//! | [`noise`], [`pulse`], [`edges`], `near`, `ramp` | those |
//! | [`echo`] | `echo` |

mod config;
pub mod echo;
pub mod edges;
pub mod filter;
pub mod finder;
mod fine;
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
