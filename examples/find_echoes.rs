//! The sensor's detector on one waveform, on a PC.
//!
//! ```sh
//! cargo run --release -p echoloop-examples --example find_echoes
//! ```
//!
//! This is the sensor's DSP, which knows the emitted pulse and the converter. For records of
//! unknown instruments, see `echoloop echoes`. For firmware of your own, see `own_firmware` beside
//! this file.

use std::error::Error;
use std::f64::consts::PI;

use echoloop_dsp::hardware::sample_period_fs;
use echoloop_dsp::{Hardware, Pipeline, Scratch, Settings};

/// Codes of a 12-bit converter: ambient light, some noise, and pulses, each (range in m, height in
/// codes).
fn waveform(settings: &Settings, hardware: &Hardware, echoes: &[(f64, f64)]) -> Vec<u16> {
    let period_ns = f64::from(sample_period_fs(settings.bins as u32, hardware)) / 1e6;
    let duration_ns = 2.0 * f64::from(settings.pulse_width_ps) / 1e3;
    let metres_per_ns = 0.299_792_458 / 2.0;
    let mut random = 1_u32;
    let mut code = |n: i32| {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let noise = f64::from(random >> 16) / 65_536.0 * 16.0;
        let pulse = |&(range_m, height): &(f64, f64)| {
            let middle_ns = (range_m - f64::from(hardware.range_min_mm) / 1e3) / metres_per_ns;
            let t = (f64::from(n) * period_ns - middle_ns) / duration_ns + 0.5;
            if (0.0..1.0).contains(&t) { height * (PI * t).sin().powi(2) } else { 0.0 }
        };
        (200.0 + noise + echoes.iter().map(pulse).sum::<f64>()).min(4_095.0) as u16
    };
    (0..settings.bins).map(&mut code).collect()
}

fn main() -> Result<(), Box<dyn Error>> {
    let hardware = Hardware::REFERENCE; // 12 bits, 1 to 120 m
    let settings = Settings { echoes: 4, ..Settings::default() };
    let codes = waveform(&settings, &hardware, &[(12.5, 900.0), (14.2, 400.0), (60.0, 8_000.0)]);

    let pipeline = Pipeline::new(&settings, &hardware)?;
    let mut scratch = Scratch::new();
    for echo in echoloop_kernels::process(&pipeline, &codes, &mut scratch) {
        println!(
            "{:.3} m ± {} mm, SNR {:.0}, {:?}",
            echo.range_m(),
            echo.deviation_mm(),
            echo.snr_ratio(),
            echo.flags
        );
    }
    Ok(())
}
