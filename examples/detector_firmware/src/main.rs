//! The detector alone in a firmware of one's own, from a converter's buffer to echoes, without
//! link, session and board.
//!
//! ```sh
//! cargo build --release -p echoloop-detector-firmware --target thumbv7em-none-eabihf
//! ```
//!
//! The same file serves Cortex-M0 and RISC-V. How to copy it: docs/porting.md.
#![cfg_attr(target_os = "none", no_std, no_main)]
#![cfg_attr(not(target_os = "none"), allow(dead_code, reason = "a PC says how to build it"))]

use core::hint::{black_box, spin_loop};
use core::sync::atomic::Ordering::{Acquire, Relaxed, Release};
use core::sync::atomic::{AtomicBool, AtomicU16, AtomicU32};

#[cfg(all(target_os = "none", target_arch = "arm"))]
use cortex_m_rt::entry;
use echoloop_dsp::{Echo, Echoes, Hardware, MAX_ECHOES, Pipeline, Scratch, Settings};
use echoloop_kernels::FASTEST;
#[cfg(all(target_os = "none", target_arch = "riscv32"))]
use riscv_rt::entry;

/// Codes of a shot: `Settings::bins`, and 128 before the trigger if `ambient` asks for them.
const SAMPLES: usize = 800;

/// Codes, right-aligned, filled by DMA. Atomic, because the program does not write them.
static ADC_CODES: [AtomicU16; SAMPLES] = [const { AtomicU16::new(0) }; SAMPLES];
/// True when the buffer holds a shot: set by DMA's interrupt, cleared here.
static ADC_FULL: AtomicBool = AtomicBool::new(false);

/// Echoes of the last shot, four words each: see [`words`].
static ECHO_WORDS: [[AtomicU32; 4]; MAX_ECHOES] =
    [const { [const { AtomicU32::new(0) }; 4] }; MAX_ECHOES];
/// Number of echoes of the last shot.
static ECHO_COUNT: AtomicU32 = AtomicU32::new(0);
/// Number of processed shots, counted when their echoes are written.
static SHOTS: AtomicU32 = AtomicU32::new(0);

/// Your HAL's part: give DMA the buffer and start the converter's timer. DMA must fill the buffer
/// only while `ADC_FULL` is false, or codes of two shots mix. This example only exposes the
/// addresses, for a debugger that takes the place of DMA.
fn start_converter() {
    black_box((&ADC_CODES, &ADC_FULL, &ECHO_WORDS, &ECHO_COUNT, &SHOTS));
}

/// Your converter, window and laser, and the settings to begin with.
fn detector() -> Option<Pipeline> {
    let hardware = Hardware {
        adc_bits: 12,
        range_min_mm: 1_000,
        range_max_mm: 120_000,
        ..Hardware::REFERENCE
    };
    let settings =
        Settings { bins: SAMPLES as i32, echoes: MAX_ECHOES as i32, ..Settings::default() };
    Pipeline::new(&settings, &hardware).ok() // or report the field that it refuses
}

/// Waits for a shot and copies it, so that DMA can fill the buffer again.
fn take_shot(codes: &mut [u16; SAMPLES]) {
    while !ADC_FULL.load(Acquire) {
        spin_loop(); // or sleep until the interrupt
    }
    codes.iter_mut().zip(&ADC_CODES).for_each(|(code, filled)| *code = filled.load(Relaxed));
    ADC_FULL.store(false, Release);
}

/// Words of an echo: range in 1/256 mm; amplitude, width; SNR, σ of the range; reflectivity, flags.
/// Units: [`Echo`].
fn words(echo: &Echo) -> [u32; 4] {
    let pair = |high: u16, low: u16| u32::from(high) << 16 | u32::from(low);
    [
        echo.range,
        pair(echo.amplitude, echo.width),
        pair(echo.snr, echo.deviation),
        pair(echo.reflectivity, echo.flags.0.into()),
    ]
}

/// Passes the echoes on: here to memory, in your firmware to a bus or a display.
fn hand_out(echoes: &Echoes) {
    for (places, echo) in ECHO_WORDS.iter().zip(echoes) {
        places.iter().zip(words(echo)).for_each(|(place, word)| place.store(word, Relaxed));
    }
    ECHO_COUNT.store(echoes.len() as u32, Relaxed);
    SHOTS.store(SHOTS.load(Relaxed).wrapping_add(1), Release);
}

fn run() -> ! {
    let Some(pipeline) = detector() else { stop() };
    let (mut scratch, mut codes) = (Scratch::new(), [0; SAMPLES]);
    start_converter();
    loop {
        take_shot(&mut codes);
        hand_out(&pipeline.process(FASTEST, &codes, &mut scratch));
    }
}

/// Reached with refused settings; the program itself has no panic.
fn stop() -> ! {
    loop {
        spin_loop();
    }
}

#[cfg(target_os = "none")]
#[entry]
fn start() -> ! {
    run()
}

#[cfg(target_os = "none")]
#[panic_handler]
fn panicked(_: &core::panic::PanicInfo<'_>) -> ! {
    stop()
}

/// On a PC.
#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!("this is a microcontroller's program; build it with --target thumbv7em-none-eabihf");
    std::process::exit(2);
}
