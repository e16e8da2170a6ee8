//! What the sensor's images for microcontrollers on sale share: the board without a front end, the
//! link's receiving side, the log, and the sleep.
//!
//! A part's own crate brings its clocks, pins, interrupts, flash and watchdog: `firmware/stm32f4`,
//! `firmware/nrf52840`.
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

/// Sleeps until an interrupt, unless there is something to do already.
#[cfg(all(target_arch = "arm", target_os = "none"))]
fn sleep_unless(is_awake: impl FnOnce() -> bool) {
    // Masked, so that a byte that comes after the look wakes the processor and is not slept over:
    // it is taken when the mask goes.
    cortex_m::interrupt::disable();
    if !is_awake() {
        cortex_m::asm::wfi();
    }
    // SAFETY: no section is under way that this would cut short.
    unsafe { cortex_m::interrupt::enable() };
}

/// Says why and does nothing more; the watchdog, once it runs, restarts the board.
#[cfg(all(target_arch = "arm", target_os = "none"))]
pub fn stop(why: &str) -> ! {
    defmt::error!("{=str}", why);
    loop {
        core::hint::spin_loop();
    }
}
