//! The sensor on a microcontroller on sale: STM32F405, a Cortex-M4F of 168 MHz with 1 MB of flash.
//!
//! ```sh
//! cargo xtask firmware --target thumbv7em-none-eabihf      # builds, measures and checks it
//! ```
//!
//! Clocks, pins, serial ports and watchdog are stm32f4xx-hal's. The board has no front end: what
//! fires a laser, and the converter, are for whoever builds one ([`echoloop_part::board`]).
//!
//! One ELF file runs on the part and in QEMU's `netduinoplus2`, which has no model of the clocks,
//! the flash interface and the independent watchdog. It finds out at its start where it is, and
//! says so in its log (`src/clock.rs`). What differs in the emulator:
//!
//! | | on the part | in QEMU |
//! |---|---|---|
//! | clocks | the HAL's, 168 MHz from the part's own 16 MHz | as they are |
//! | settings | sectors 1 and 2 of the flash ([`flash`]) | a file, by semihosting |
//! | watchdog | the independent one, of the HAL | the tick's interrupt, and a reset by it |
//!
//! Serial ports, their interrupts, the ring buffer, log, link, session and DSP are the same code.
//! What QEMU cannot run is tested elsewhere: the flash's driver against a model of its interface
//! (`firmware/stm32f4/tests/flash`), the clocks by what they write (`tests/tests/stm32f405`).
#![no_std]
#![warn(
    clippy::indexing_slicing,
    clippy::arithmetic_side_effects,
    clippy::panic,
    clippy::undocumented_unsafe_blocks
)]

pub mod flash;

#[cfg(stm32f405)]
pub mod board;
#[cfg(stm32f405)]
pub mod clock;
#[cfg(stm32f405)]
mod file;
#[cfg(stm32f405)]
mod link;
#[cfg(stm32f405)]
mod log;
#[cfg(stm32f405)]
mod microseconds;
#[cfg(stm32f405)]
mod registers;
#[cfg(stm32f405)]
mod store;
#[cfg(stm32f405)]
mod watchdog;
