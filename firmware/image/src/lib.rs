//! Common part of the images for emulated microcontrollers: drivers, log, sleep, panic handler.
//!
//! ```sh
//! rustup target add thumbv7em-none-eabihf
//! cargo xtask firmware --target thumbv7em-none-eabihf          # builds the images, prints sizes
//! cargo run --release -- scan --sensor qemu -o cloud.ply       # runs one in an emulator
//! ```
//!
//! A board of your own needs a firmware of its own: `docs/porting.md`.
//!
//! Unsafe code is in accesses to registers, in the log, in the sleep, and in the exit of the
//! measuring program.
#![cfg(target_os = "none")]
#![no_std]
#![warn(
    clippy::indexing_slicing,
    clippy::arithmetic_side_effects,
    clippy::panic,
    clippy::undocumented_unsafe_blocks
)]

pub mod board;
pub mod clock;
pub mod flash;
pub mod front_end;
pub mod idle;
mod log;
pub mod measure;
pub mod mmio;
pub mod uart;
pub mod watchdog;

/// Logs the reason and stops; a running watchdog restarts the board.
pub fn stop(reason: &str) -> ! {
    defmt::error!("{=str}", reason);
    loop {
        core::hint::spin_loop();
    }
}

/// No code in an image reaches it: `cargo xtask firmware` fails when it finds it there.
#[panic_handler]
fn panicked(_: &core::panic::PanicInfo<'_>) -> ! {
    stop("panic")
}
