//! Program of the sensor for emulated microcontrollers; `cargo xtask firmware` builds it.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(all(target_os = "none", target_arch = "arm"))]
use cortex_m_rt::entry;
#[cfg(all(target_os = "none", target_arch = "riscv32"))]
use riscv_rt::entry;

#[cfg(target_os = "none")]
#[entry]
fn start() -> ! {
    use echoloop_image::{board::EmulatedBoard, stop};
    use echoloop_sensor::{App, BUILD};

    let Some(board) = EmulatedBoard::take() else { stop("no front end in memory, or no straps") };
    defmt::info!("{=str}", BUILD);
    let mut app = App::new(board);
    loop {
        let _ = app.poll(); // a UART is never lost
        app.board_mut().idle();
    }
}

/// On a PC.
#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!("this is a microcontroller's program; build it with: cargo xtask firmware");
    std::process::exit(2);
}
