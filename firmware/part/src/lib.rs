//! Common part of the sensor's images for microcontrollers on sale: the board without a front end,
//! the link's receiving side, the log, and the sleep.
//!
//! The crate of each microcontroller adds clocks, pins, interrupts, flash and watchdog:
//! `firmware/stm32f4`, `firmware/nrf52840`.
#![no_std]
#![warn(
    clippy::indexing_slicing,
    clippy::arithmetic_side_effects,
    clippy::panic,
    clippy::undocumented_unsafe_blocks
)]

pub mod board;
pub mod link;
#[cfg(all(target_arch = "arm", target_os = "none"))]
pub mod log;
pub mod ring;

/// Sleeps until an interrupt, unless `is_awake` finds that there is something to do.
#[cfg(all(target_arch = "arm", target_os = "none"))]
fn sleep_unless(is_awake: impl FnOnce() -> bool) {
    // Interrupts are masked, so that a byte that comes after the check still wakes the processor;
    // its handler runs when the mask is removed.
    cortex_m::interrupt::disable();
    if !is_awake() {
        cortex_m::asm::wfi();
    }
    // SAFETY: no critical section is open that this would end.
    unsafe { cortex_m::interrupt::enable() };
}

/// Logs the reason and stops; the watchdog, if it runs, restarts the board.
#[cfg(all(target_arch = "arm", target_os = "none"))]
pub fn stop(why: &str) -> ! {
    defmt::error!("{=str}", why);
    loop {
        core::hint::spin_loop();
    }
}
