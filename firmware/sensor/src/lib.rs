//! Program of the sensor: implement [`Board`] for the hardware, give it to an [`App`], and poll.
//!
//! ```
//! use echoloop_sensor::{App, Board, app::LinkLost};
//!
//! fn run(board: impl Board) -> LinkLost {
//!     let mut app = App::new(board); // with the settings that were saved, or the defaults
//!     loop {
//!         if let Err(lost) = app.poll() {
//!             return lost;
//!         }
//!     }
//! }
//! ```
//!
//! The same application runs on a microcontroller (`echoloop-image`, firmware/image), in QEMU, and
//! in process on a PC (`PcSensor` in `echoloop-sensors`). Only the board differs.
//!
//! | module | holds |
//! |---|---|
//! | [`board`] | interface that the application needs of the hardware |
//! | [`app`] | bytes in, answers out |
//! | `program` | actions of the commands: drive the front end, run the DSP |
//! | `waveforms` | codes that come over the link, where the board has no front end |
//! | `stopwatch` | times of scans, and their deadline |
//! | [`afe`] | laser driver, amplifier and converter, by their registers |
//! | [`store`] | settings saved for the next start, in NOR flash |
//! | [`mailbox`] | the front end of an emulated board, as shared memory |
//!
//! No input and no stored byte makes this code panic: there is no index and no unchecked sum, and
//! lints keep it so.
#![no_std]
#![forbid(unsafe_code)]
#![warn(
    clippy::arithmetic_side_effects,
    clippy::expect_used,
    clippy::indexing_slicing,
    clippy::panic
)]
#![warn(clippy::unreachable)]

pub mod afe;
pub mod app;
pub mod board;
pub mod mailbox;
mod program;
mod state;
mod stopwatch;
pub mod store;
mod waveforms;

pub use app::{App, BUILD};
pub use board::Board;
