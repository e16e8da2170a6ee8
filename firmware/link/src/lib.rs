//! The link between a sensor and its host.
//!
//! Slices in, slices out: no I/O, no clock, no allocation, the same code on both sides. A frame is
//! `00 · COBS(sequence · postcard body · CRC-32C) · 00`; [`frame`] makes and reads it, [`message`]
//! holds what the bodies may be, [`session`] is the sensor's side of the conversation. WIRE.md has
//! the format with worked bytes.
//!
//! Nothing here panics, whatever arrives: no index, no unchecked sum, and lints that keep it so.
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
pub mod session;

pub use frame::{Decoder, FrameError, MAX_FRAME, MAX_PAYLOAD, checksum, decode, encode, open};
pub use message::{
    BEAMS_PER_REPORT, Command, Counters, Greeting, MAGIC, Nack, PROTOCOL, Report, SCHEMA,
    SETTINGS_SCHEMA, settings_hash,
};
pub use session::{Answer, Session};
