//! Sensor on a microcontroller on sale: nRF52840, a Cortex-M4F of 64 MHz with 1 MB of flash.
//!
//! ```sh
//! cargo xtask firmware --target thumbv7em-none-eabihf      # builds, measures and checks it
//! ```
//!
//! Clocks, pins, timers and watchdog are nrf52840-hal's. Board, ring, log and sleep are shared with
//! the STM32F405's image ([`echoloop_part`]). QEMU has no model of this part, so the image has
//! never run: it is built, linked and measured, and the flash driver is tested against a model of
//! its controller (`firmware/nrf52840/tests/flash.rs`).
#![no_std]
#![warn(
    clippy::indexing_slicing,
    clippy::arithmetic_side_effects,
    clippy::panic,
    clippy::undocumented_unsafe_blocks
)]

pub mod flash;

#[cfg(nrf52840)]
pub mod board;
#[cfg(nrf52840)]
mod controller;
#[cfg(nrf52840)]
mod link;
#[cfg(nrf52840)]
mod log;
#[cfg(nrf52840)]
mod times;
#[cfg(nrf52840)]
mod watchdog;
