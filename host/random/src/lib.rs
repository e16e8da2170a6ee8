//! Seeded random numbers that are the same on every machine and on any number of threads.
//!
//! ```
//! use echoloop_random::{Generator, Stream, derive};
//!
//! let mut generator = Generator::new(1, 0);           // one number after the other
//! let length_m = generator.range(2.0, 5.0);
//! let third = Stream::new(1, 7, 42).normal(4);        // any number by its index, in any order
//! assert!((2.0..5.0).contains(&length_m) && third.is_finite());
//! assert_ne!(derive(1, 1, 0), derive(1, 2, 0));       // a seed for each purpose
//! ```
//!
//! | item | numbers | used for |
//! |---|---|---|
//! | [`Generator`] | ChaCha8, one after the other | scenes, the optimiser's samples |
//! | [`Stream`] | SplitMix64 by index, `f64` | jitter, drops, photons |
//! | [`normals()`] | a 32-bit mix by index, four tables, `f32` | the noise of samples |
//!
//! Uniform and normal numbers are made here from raw bits: a distribution crate may change its
//! sampling between versions. Logarithms and cosines are `libm`'s: those of the platforms differ in
//! the last bit.

mod generator;
mod normals;
mod split_mix;
mod stream;
mod uniform;

pub use generator::Generator;
pub use normals::{Key, normals, normals_baseline};
pub use split_mix::{derive, mix_64, split_mix_64};
pub use stream::Stream;
pub use uniform::box_muller;
