//! The sensor program: one application, three lives. On a board, in QEMU and in process on a PC only the
//! [`Board`](board::Board) differs.
#![no_std]
#![forbid(unsafe_code)]

pub mod afe;
pub mod app;
pub mod board;
pub mod mailbox;

pub use app::{App, BUILD};
pub use board::Board;
