//! The sensor program: one application, three lives. On a board, in QEMU and in process on a PC
//! only the [`Board`](board::Board) differs.
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
pub mod store;

pub use app::{App, BUILD};
pub use board::Board;
