//! Sensor on a microcontroller on sale: STM32F405, a Cortex-M4F of 168 MHz with 1 MB of flash.
//!
//! ```sh
//! cargo xtask firmware --target thumbv7em-none-eabihf      # builds, measures and checks it
//! ```
//!
//! Clocks, pins, serial ports and watchdog are stm32f4xx-hal's. The board has no front end: laser
//! driver and converter have to be added ([`echoloop_part::board`]).
//!
//! One ELF file runs on the part and in QEMU's `netduinoplus2`, which has no model of the clocks,
//! the flash interface and the independent watchdog. At its start it detects the emulator, and logs
//! it (`src/clock.rs`). The differences in the emulator:
//!
//! | | on the part | in QEMU |
//! |---|---|---|
//! | clocks | the HAL's, 168 MHz from the part's own 16 MHz | not set |
//! | settings | sectors 1 and 2 of the flash ([`flash`]) | a file, by semihosting |
//! | watchdog | the independent one, of the HAL | the tick's interrupt, and a reset by it |
//!
//! Serial ports, their interrupts, the ring buffer, log, link, session and DSP are the same code.
//! Code that QEMU cannot run is tested elsewhere: the flash driver against a model of its interface
//! (`firmware/stm32f4/tests/flash`), the clocks by the registers that they write
//! (`tests/tests/stm32f405`).
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
