//! Program of the sensor for an nRF52840; `cargo xtask firmware` builds it.
#![cfg_attr(nrf52840, no_std, no_main)]

#[cfg(nrf52840)]
#[cortex_m_rt::entry]
fn start() -> ! {
    use echoloop_nrf52840::board;
    use echoloop_part::stop;
    use echoloop_sensor::{App, BUILD};

    let Some(board) = board::take() else { stop("taken before, or another watchdog runs") };
    defmt::info!("{=str}", BUILD);
    let mut app = App::new(board);
    loop {
        let _ = app.poll(); // a UART is never lost
        app.board_mut().idle();
    }
}

/// Only the start of the log can reach it, depending on its constants alone; `cargo xtask firmware`
/// fails on any other path to it.
#[cfg(nrf52840)]
#[panic_handler]
fn panicked(_: &core::panic::PanicInfo<'_>) -> ! {
    echoloop_part::stop("panic")
}

/// On anything else.
#[cfg(all(not(nrf52840), not(target_os = "none")))]
fn main() {
    eprintln!("this is an nRF52840's program; build it with: cargo xtask firmware");
    std::process::exit(2);
}
