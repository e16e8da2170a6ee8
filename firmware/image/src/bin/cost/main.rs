//! Program that counts the instructions of every stage, after checking that the kernels agree;
//! `cargo xtask cost` builds and runs it.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(all(target_os = "none", target_arch = "arm"))]
use cortex_m_rt::entry;
#[cfg(all(target_os = "none", target_arch = "riscv32"))]
use riscv_rt::entry;

#[cfg(target_os = "none")]
mod portable_forms;
#[cfg(target_os = "none")]
mod stages;
#[cfg(target_os = "none")]
mod waveforms;

#[cfg(target_os = "none")]
#[entry]
fn start() -> ! {
    use core::fmt::Write;

    use echoloop_image::measure::{Text, end};

    let mut text = Text::new();
    let outcome = portable_forms::agree().and_then(|compared| {
        writeln!(text, "equal {compared}").map_err(|_| "no text")?;
        stages::count(&mut text)
    });
    let _ = match outcome {
        Ok(()) => writeln!(text, "end"),
        Err(what) => writeln!(text, "FAIL {what}"),
    };
    end(outcome.is_ok())
}

/// On a PC.
#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!("this is a microcontroller's program; build and run it with: cargo xtask cost");
    std::process::exit(2);
}
