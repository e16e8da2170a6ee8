//! Simulated waveform front end of a LiDAR: from returned light to ADC codes.
//!
//! ```
//! use echoloop_frontend::*;
//!
//! let analog = Analog { delay_ns: 0.0, ..Analog::USUAL };
//! let range_m = 45.0_f32; // a wall of reflectance 0.1, square to the beam
//! let wall = Return { range_m, strength_per_m2: 0.1 / std::f32::consts::PI / range_m.powi(2) };
//! let exposure = Exposure {
//!     receiver: &Receiver::default(),
//!     analog: &analog,
//!     returns: &[wall],
//!     background: &[],
//!     key: noise_key(1, Trigger { frame: 0, beam: 0, shot: 0 }),
//! };
//! let mut codes = vec![0; 400];
//! synthesise(&exposure, &mut ShotBuffers::default(), &mut codes);
//! let peak = (0..400).max_by_key(|&n| codes[n]).expect("400 samples");
//! assert!((303..=307).contains(&peak)); // 2R/c = 300 ns, and half the pulse
//! ```
//!
//! | stage | items |
//! |---|---|
//! | returns of a scene, by beam | [`SceneResponse`], [`Return`] |
//! | fog, rain, snow: extinction, drops, backscatter | [`Weather`] |
//! | pulse, receiver equation, ambient light | [`Receiver`] |
//! | shot and amplifier noise, gain, clip, overload, converter | [`synthesise`] |
//! | light scattered by the optics | [`Glare`] |
//! | pulses of another LiDAR | [`OtherLight`] |
//! | dead and weak channels, jitter | [`Channel`], [`Receiver`] |
//! | all of them, behind a sensor's registers | [`WaveformFrontEnd`] |
//! | photon counts in arbitrary units, to compare simulators | [`litl`] |
//!
//! Every sample is a pure function of seed, scan, beam and shot: the same on any number of threads.
//! The equations and their sources are in benches/record/physics.md, the switches in
//! benches/record/front-end.md.

mod aerosol;
mod backscatter;
mod board;
mod channel;
mod digitiser;
mod exposure;
mod hydrometeors;
mod light;
pub mod litl;
mod litl_units;
mod mode;
mod noise;
mod other_lidar;
mod pulse;
mod receiver;
mod shares;
mod synthesis;
mod waveform_front_end;
mod weather;

pub use board::{Analog, FrontEnd, ScanNoise, Trigger};
pub use channel::Channel;
pub use exposure::{Exposure, ShotBuffers};
pub use light::{Glare, OtherLight, Return, SceneResponse};
pub use mode::Mode;
pub use noise::{before_the_trigger, noise_key, shaking};
pub use receiver::Receiver;
pub use synthesis::{synthesise, synthesise_baseline};
pub use waveform_front_end::WaveformFrontEnd;
pub use weather::{Air, Precipitation, Weather};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
