//! Echoloop in firmware of your own: copy this crate, and fill in your HAL.
//!
//! ```sh
//! cargo build --release -p echoloop-own-firmware --target thumbv7em-none-eabihf   # an ELF file
//! cargo test -p echoloop-own-firmware                                  # on the PC
//! ```
//!
//! | you want | use |
//! |---|---|
//! | echoes from codes of your firmware | [`Detector`] |
//! | the whole sensor, which `echoloop tune --sensor serial:…` drives | [`OwnBoard`], [`serve`] |
//!
//! `src/bin/sensor/main.rs` has the entry and the panic handler, `memory.x` flash and RAM,
//! `build.rs` the linker's arguments. How to make a crate of the copy, and what each function of a
//! board must do, with timing, buffers, flash and watchdog: docs/porting.md.
#![no_std]
#![forbid(unsafe_code)]

mod board;
mod detector;

pub use board::{Buffer, OwnBoard, Watchdog};
pub use detector::Detector;

use echoloop_sensor::{App, Board};

/// Main loop of a sensor; `sleep` waits for a byte on the link or some milliseconds.
pub fn serve(board: impl Board, mut sleep: impl FnMut()) -> ! {
    let mut app = App::new(board);
    loop {
        // After a lost line the loop goes on: no request is left half done.
        let _ = app.poll();
        sleep();
    }
}
