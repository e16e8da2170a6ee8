//! Waveforms of other instruments, and their echoes.
//!
//! To read another format, add a file beside `csv`, `npy` and `hdf5`, and call it in [`read`].
//!
//! ```text
//! file ─ read → rows of numbers ─ codes → ADC codes ─ finder → samples ─ echoes → ns, file's units
//!                    └─ response: ringing and tail of the instrument ─────┘
//! ```
//!
//! [`read_waveforms`] reads a file. [`Finder::find`] takes its rows and, if there are any, the rows
//! of the emitted pulse. The detector, [`finder`], is not the sensor's. Tops that [`response`]
//! explains are not reported as echoes.
//!
//! ```
//! use echoloop_instruments::{Finder, Options};
//!
//! // 200 samples of 1 ns: a pulse of 7 ns at 80 ns, over an ambient of 10.
//! let pulse = |t: i32| 500.0 * (-f64::from((t - 80) * (t - 80)) / 18.0).exp();
//! let row: Vec<f64> = (0..200).map(|t| (10.0 + pulse(t)).round()).collect();
//! let finder = Finder::new(Options {
//!     sample_ns: 1.0,
//!     snr: 6.0,
//!     floor: 0.05,
//!     max_echoes: 8,
//!     min_separation_ns: 4.0,
//! });
//! let found = finder.find(&[row], &[]);
//! assert_eq!(found[0].echoes.len(), 1);
//! assert!((found[0].echoes[0].time_ns - 80.0).abs() < 0.1);
//! ```

mod array;
mod axis;
mod background;
pub mod codes;
mod csv;
pub mod echoes;
pub mod finder;
mod gaps;
mod hdf5;
mod missing;
mod noise;
mod npy;
mod polarity;
pub mod read;
pub mod response;
mod rows;
mod scope;

pub use axis::TimeAxis;
pub use echoes::{BadOption, DroppedTop, Echo, Finder, Options, POSSIBLE_REPEAT, Waveform};
pub use finder::Reason;
pub use hdf5::{Kind, Selection};
pub use noise::Noise;
pub use polarity::Polarity;
pub use read::{parse_waveforms, read_table, read_waveforms};
pub use response::Response;
pub use rows::Rows;
