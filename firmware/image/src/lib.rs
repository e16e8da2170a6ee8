//! What images for microcontrollers share: start-up, drivers, and the DSP's inner loops in their
//! instructions.
//!
//! Unsafe code lives here and nowhere else in the firmware: in accesses to registers and to what
//! survives a restart, in the log, in the sleep, in the inner loops, and in the exit of the program
//! that counts.
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

/// Says why and does nothing more; a watchdog that runs restarts the board.
pub fn stop(why: &str) -> ! {
    defmt::error!("{=str}", why);
    loop {
        core::hint::spin_loop();
    }
}

/// Nothing in an image reaches it: `cargo xtask firmware` looks for it there and fails when it
/// finds it.
#[panic_handler]
fn panicked(_: &core::panic::PanicInfo<'_>) -> ! {
    stop("panic")
}
