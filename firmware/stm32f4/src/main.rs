//! Program of the sensor for an STM32F405; `cargo xtask firmware` builds it.
#![cfg_attr(stm32f405, no_std, no_main)]

#[cfg(stm32f405)]
#[cortex_m_rt::entry]
fn start() -> ! {
    use echoloop_part::stop;
    use echoloop_sensor::{App, BUILD};
    use echoloop_stm32f4::board;

    let Some(board) = board::take() else { stop("a port, or the emulator's file, is missing") };
    defmt::info!("{=str}", BUILD);
    let mut app = App::new(board);
    loop {
        let _ = app.poll(); // a UART is never lost
        app.board_mut().idle();
    }
}

/// Only the start of clocks and log can reach it, depending on their constants alone; `cargo xtask
/// firmware` fails on any other path to it.
#[cfg(stm32f405)]
#[panic_handler]
fn panicked(_: &core::panic::PanicInfo<'_>) -> ! {
    echoloop_part::stop("panic")
}

/// On anything else.
#[cfg(all(not(stm32f405), not(target_os = "none")))]
fn main() {
    eprintln!("this is an STM32F405's program; build it with: cargo xtask firmware");
    std::process::exit(2);
}
