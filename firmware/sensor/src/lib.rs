//! The sensor program: implement [`Board`] for the hardware, hand it to an [`App`], and poll.
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
//! One application, three lives: on a microcontroller (`echoloop-image`, firmware/image), the same
//! image in QEMU, and in process on a PC (`PcSensor` in `echoloop-sim`). Only the board differs.
//!
//! | module | holds |
//! |---|---|
//! | [`board`] | what the application needs of the hardware |
//! | [`app`] | bytes in, answers out |
//! | `program` | what a command does: front end and DSP at work |
//! | `waveforms` | codes that come over the link, where the board has no front end |
//! | `stopwatch` | how long scans take, and which are late |
//! | [`afe`] | laser driver, amplifier and converter, by their registers |
//! | [`store`] | the settings of the next start, in NOR flash |
//! | [`mailbox`] | the front end of an emulated board, as shared memory |
//!
//! Nothing here panics, whatever arrives or is stored: no index, no unchecked sum, and lints that
//! keep it so.
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
