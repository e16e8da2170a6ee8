//! The link between a sensor and its host, as bytes: a command goes out as a frame, the sensor's
//! [`Session`] answers it, and the answer comes back in a frame of the same number.
//!
//! ```
//! use echoloop_dsp::{Hardware, Grid, ScanPattern, Settings};
//! use echoloop_link::{Answer, Command, Decoder, FrameError, Greeting, MAX_FRAME, Report, Session};
//! use echoloop_link::{decode, encode};
//!
//! # fn main() -> Result<(), FrameError> {
//! // The host numbers a command and puts it on the line.
//! let mut there = [0; MAX_FRAME];
//! let sent = encode(7, &Command::Hello(Greeting::OURS), &mut there)?;
//!
//! // The sensor collects bytes until a frame is whole, reads it and answers.
//! let grid = Grid { columns: 8, rows: 4, azimuth_cdeg: 18_000, elevation_cdeg: 9_000 };
//! let pattern = ScanPattern::Grid(grid);
//! let mut session = Session::new(Hardware::REFERENCE, pattern, "mine 1.0", Settings::default());
//! let (mut decoder, mut back) = (Decoder::new(), [0; MAX_FRAME]);
//! let mut length = 0;
//! for &byte in sent {
//!     let Some(frame) = decoder.push(byte) else { continue };
//!     let (number, command) = decode::<Command>(frame?)?;
//!     if let Answer::Report(report) = session.handle(command) {
//!         length = encode(number, &report, &mut back)?.len();
//!     }
//! }
//!
//! // The host reads the answer the same way.
//! let (mut decoder, mut answer) = (Decoder::new(), None);
//! for &byte in &back[..length] {
//!     let Some(frame) = decoder.push(byte) else { continue };
//!     answer = Some(decode::<Report>(frame?)?);
//! }
//! assert!(matches!(answer, Some((7, Report::Hello { hardware: Hardware::REFERENCE, .. }))));
//! # Ok(())
//! # }
//! ```
//!
//! A host need not do this by hand: `Client` in the crate `echoloop-sensors` (host/sensors) says
//! hello, repeats a command when no answer comes, and reads whole scans, over any `Transport`.
//!
//! | module | holds |
//! |---|---|
//! | [`frame`] | `00 · COBS(sequence · postcard body · CRC-32C) · 00`: made and read |
//! | [`message`] | the bodies: commands and reports |
//! | [`packed`] | codes of a converter without gaps |
//! | [`session`] | the sensor's side of the conversation |
//!
//! Slices in, slices out: no I/O, no clock, no allocation, the same code on both sides. WIRE.md,
//! beside the sources, has the format with worked bytes. No input makes this code panic: there is
//! no index and no unchecked sum, and lints keep it so.
#![no_std]
#![forbid(unsafe_code)]
#![warn(
    clippy::arithmetic_side_effects,
    clippy::expect_used,
    clippy::indexing_slicing,
    clippy::panic
)]
#![warn(clippy::unreachable)]
#![cfg_attr(
    test,
    allow(
        clippy::arithmetic_side_effects,
        clippy::indexing_slicing,
        clippy::panic,
        reason = "tests"
    )
)]

mod cobs;

pub mod frame;
pub mod message;
pub mod packed;
pub mod session;

pub use frame::{
    Decoder, FrameError, MAX_FRAME, MAX_PAYLOAD, Message, Way, checksum, decode, encode,
    encode_for, open,
};
pub use message::{
    BEAMS_PER_REPORT, Command, Counters, Greeting, MAGIC, Nack, Noise, PACKED_BYTES, PROTOCOL,
    Place, Report, Room, SCHEMA, SETTINGS_SCHEMA, Times, settings_hash,
};
pub use session::{Answer, Session};

/// The README's example runs as written there.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
