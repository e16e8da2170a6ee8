//! A firmware that links: entry, memory map, panic handler. Replace each `Nothing` by a part of
//! your HAL.
//!
//! ```sh
//! cargo build --release -p echoloop-own-firmware --target thumbv7em-none-eabihf
//! ```
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(all(target_os = "none", target_arch = "arm"))]
mod nothing;

#[cfg(all(target_os = "none", target_arch = "arm"))]
#[cortex_m_rt::entry]
fn start() -> ! {
    use echoloop_own_firmware::{OwnBoard, serve};
    use nothing::Nothing;

    // First initialise clocks, pins and peripherals with your HAL.
    let board = OwnBoard {
        emitter: Nothing, // an `SpiDevice` of embedded-hal: the laser driver, chip select included
        adc: Nothing,     // an `SpiDevice`: amplifier and converter
        link: Nothing,    // `Read`, `ReadReady`, `Write` of embedded-io: a UART or USB serial line
        flash: Nothing,   // a `NorFlash` of embedded-storage: two slots that memory.x leaves out
        buffer: Nothing,  // `Buffer`: filled by DMA when the emitter fires; armed
        watchdog: Nothing, // `Watchdog`: already started
        restarts: 0,
        now_us: || None, // a timer of 1 MHz, if there is one
    };
    // Use `cortex_m::asm::wfi` once an interrupt of the link or a timer ends the sleep.
    serve(board, core::hint::spin_loop)
}

/// Not reached by Echoloop's code. The watchdog restarts the board.
#[cfg(target_os = "none")]
#[panic_handler]
fn panicked(_: &core::panic::PanicInfo<'_>) -> ! {
    loop {
        core::hint::spin_loop();
    }
}

/// On a PC.
#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!("this is a microcontroller's program; build it with --target thumbv7em-none-eabihf");
    std::process::exit(2);
}
