//! Times our waveform path, for `benches/peers/waveforms.py`.
//!
//! ```text
//! waveform_path --serve CODES  # answers each line of input, as "pipeline v3", with {"cpu_ms": …}
//! waveform_path --growth       # growth with beams, samples, taps and echoes, in Markdown
//! ```
//!
//! With `--serve`, it first writes the waveforms that both sides process to CODES, and prints a
//! line of JSON with the parameters of the work.

mod growth;

use std::io::{BufRead, Write, stdin, stdout};
use std::path::{Path, PathBuf};

use clap::Parser;
use cpu_time::ProcessTime;
use echoloop_benches::Result;
use echoloop_benches::waveforms::{BATCH, SAMPLES, Stage, returns, settings};
use echoloop_frontend::{Receiver, Return};
use serde_json::{Value, json};

#[derive(Parser)]
struct Args {
    /// Writes the waveforms here, 16 bits a code, little endian, and answers requests.
    #[arg(long, required_unless_present = "growth")]
    serve: Option<PathBuf>,
    /// Prints the tables.
    #[arg(long, conflicts_with = "serve")]
    growth: bool,
    /// Takes seconds instead of minutes, to check that everything runs.
    #[arg(long)]
    quick: bool,
}

fn main() -> Result<()> {
    let args = Args::parse();
    match &args.serve {
        Some(path) => serve(path),
        None => growth::print(args.quick),
    }
}

fn serve(path: &Path) -> Result<()> {
    let mut stage = Stage::new(settings(SAMPLES, 6_200))?;
    let bytes: Vec<u8> =
        stage.waveforms().concat().iter().flat_map(|code| code.to_le_bytes()).collect();
    std::fs::write(path, bytes)?;
    println!("{}", constants(&mut stage));
    for line in stdin().lock().lines() {
        println!(
            "{}",
            answer(&mut stage, &line?).unwrap_or_else(|error| json!({"error": error.to_string()}))
        );
        stdout().flush()?;
    }
    Ok(())
}

fn answer(stage: &mut Stage, name: &str) -> Result<Value> {
    let clock = ProcessTime::try_now()?;
    stage.run(name)?;
    Ok(json!({"cpu_ms": 1e3 * clock.try_elapsed()?.as_secs_f64()}))
}

/// Parameters that a peer needs for the same work, and our result: the range of each waveform's
/// strongest echo, m.
fn constants(stage: &mut Stage) -> Value {
    let ranges = stage.ranges_m();
    let (config, analog, receiver) =
        (stage.pipeline().config(), stage.analog(), Receiver::default());
    let current_ua =
        |range_m, strength| receiver.peak_current_ua(analog.power_w, range_m, strength);
    let of = |echo: Return| {
        let range_m = f64::from(echo.range_m);
        [range_m, current_ua(range_m, f64::from(echo.strength_per_m2))]
    };
    let echoes: Vec<Vec<_>> =
        (0..BATCH as u32).map(|beam| returns(beam, 2).map(of).collect()).collect();
    json!({
        "waveforms": BATCH, "samples": SAMPLES, "ranges_m": ranges, "full_scale_code": 4095,
        "taps": config.template.taps(),
        "noise_gain": f64::from(config.template.noise_gain) / 32_768.0,
        "clip_code": config.clip_code,
        "floor": f64::from(config.floor) / 32_768.0, "snr_threshold": 4.7,
        "range_min_m": 1.0, "range_step_m": config.range_step as f64 / 256.0 / 65_536.0 / 1e3,
        "period_ns": analog.sample_period_ns, "delay_ns": analog.delay_ns,
        "width_ns": analog.pulse_width_ns,
        "echoes": echoes, "full_scale_ua": receiver.full_scale_ua,
        "quiet_ua": receiver.quiescent_current_ua(),
        "quiet_variance_ua2": receiver.quiescent_variance_ua2(),
        "shot_variance_ua": receiver.shot_variance_ua(),
    })
}
