//! Common part of the images for emulated microcontrollers: drivers, log, sleep, panic handler.
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
pub fn stop(why: &str) -> ! {
    defmt::error!("{=str}", why);
    loop {
        core::hint::spin_loop();
    }
}

/// No code in an image reaches it: `cargo xtask firmware` fails when it finds it there.
#[panic_handler]
fn panicked(_: &core::panic::PanicInfo<'_>) -> ! {
    stop("panic")
}
