//! `echoloop rate`.

use std::fmt::Write;
use std::sync::Arc;

use clap::Args;
use echoloop_frontend::SceneResponse;
use echoloop_link::Times;
use echoloop_parameters::{Bounds, Kind};
use serde::Serialize;

use super::common::Setup;
use super::exit::{self, Failure};
use super::number::{flag, number_as, read};
use super::progress::Progress;
use echoloop_closed_loop::config::RunConfig;
use echoloop_closed_loop::cost::{LineRate, Rate, RateOf};
use echoloop_sensors::sensor::{Model, View};

/// Flags of `rate`.
#[derive(Clone, Debug, Args)]
pub(crate) struct RateArgs {
    #[command(flatten)]
    setup: Setup,
    /// Scans a second that are wanted.
    #[arg(long, value_name = "HZ", default_value = "10", value_parser = hz)]
    hz: f64,
    /// Cycles that a processor takes for an instruction. An assumption: emulators count none.
    #[arg(long, value_name = "N", default_value = "1.5", value_parser = cycles)]
    cycles_per_instruction: f64,
    /// Echoes of a beam [default: as many as lidar.echoes keeps].
    #[arg(long, value_name = "N", value_parser = number_as::<u32>(ECHOES))]
    echoes: Option<u32>,
    /// With --sensor qemu or serial: scans that are timed.
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = number_as::<u32>(SCANS))]
    scans: u32,
}

const ECHOES: echoloop_parameters::Parameter = flag(Kind::Whole, Bounds::between(0.0, 4.0));
const SCANS: echoloop_parameters::Parameter = flag(Kind::Whole, Bounds::between(1.0, 10_000.0));

/// Reads `--hz`, bounded so that the deadline in whole µs fits a `u32`.
fn hz(text: &str) -> Result<f64, String> {
    read(&flag(Kind::Number, Bounds::between(0.001, 10_000.0)), text)
}

fn cycles(text: &str) -> Result<f64, String> {
    read(&flag(Kind::Number, Bounds::between(0.1, 100.0)), text)
}

/// Document of `rate`.
#[derive(Serialize)]
struct Document<'a> {
    #[serde(flatten)]
    rate: &'a Rate,
    /// Times that a sensor measured.
    measured: Option<Times>,
    /// True when those scans were of an empty scene, without echoes to report.
    measured_in_the_dark: bool,
}

pub(super) fn run(args: &RateArgs) -> Result<(), Failure> {
    let config = args.setup.source.load(Vec::new())?;
    let Model { pattern, hardware, .. } = Model::from(&config);
    let settings = config.lidar.0;
    let refused = |refusal| Failure::usage(format!("[lidar]: {refusal}"));
    let pattern = pattern.aimed(&settings).map_err(refused)?;
    let of = RateOf {
        settings: &settings,
        hardware,
        pattern: &pattern,
        duration_s: config.motion.scan_s(&pattern),
        hz: args.hz,
        cycles_per_instruction: args.cycles_per_instruction,
        echoes: args.echoes.unwrap_or(settings.echoes.unsigned_abs()),
    };
    let rate = of.estimate().map_err(refused)?;
    let is_measured = !args.setup.sensor.is_in_process();
    let document = Document {
        rate: &rate,
        measured: is_measured.then(|| measure(args, &config)).transpose()?,
        measured_in_the_dark: !args.setup.sensor.is_turned_by_others(),
    };
    match args.setup.common.json {
        true => exit::print_json(&document),
        false => exit::print(&text(&document)),
    }
}

/// Times of `--scans` scans by the sensor's own clock; a simulated sensor sees an empty scene.
fn measure(args: &RateArgs, config: &RunConfig) -> Result<Times, Failure> {
    let model = Model::from(config);
    let sensors = args.setup.sensor.sensors(model.clone())?;
    sensors.check(&sensors.identity()?, &model)?;
    let empty = Arc::new(SceneResponse::empty(model.pattern.beams()));
    let deadline_us = (1e6 / args.hz).round() as u32; // `as` saturates
    let progress = Progress::new(args.setup.common.quiet);
    let times = sensors.with(|sensor| {
        sensor.configure(&config.lidar.0)?;
        sensor.client.set_deadline(deadline_us)?;
        progress.begin("scans", args.scans.into());
        for scan in 1..=args.scans {
            sensor.scan(&View { scene: &empty, noise_seed: 0, scan, viewpoint: scan })?;
            progress.at(scan.into());
        }
        progress.end();
        sensor.client.read_times()
    })?;
    let is_complete = (times.deadline_us, times.scans) == (deadline_us, args.scans);
    if times.clock && !is_complete {
        let what = format!(
            "{} timed {} of {} scans: it started anew",
            sensors.name(),
            times.scans,
            args.scans
        );
        return Err(Failure::new(3, what));
    }
    Ok(times)
}

fn text(Document { rate, measured, measured_in_the_dark }: &Document<'_>) -> String {
    let mut text = workload(rate) + &table(rate);
    let _ = writeln!(
        text,
        "\nlight, one shot after the other: {} scans/s",
        rounded(rate.light_scans_a_second)
    );
    let of_line =
        |line: &LineRate| format!("{} scans/s at {} baud", rounded(line.scans_a_second), line.baud);
    let lines: Vec<String> = rate.lines.iter().map(of_line).collect();
    let kb = rate.bytes_a_scan / 1e3;
    let _ = writeln!(text, "echoes on the link, {kb:.1} kB a scan: {}", lines.join(", "));
    if let Some(times) = measured {
        let seen = if *measured_in_the_dark { " that saw nothing" } else { "" };
        text += &times_text(times, rate.hz, seen);
    }
    text
}

/// Line with the workload: beams, samples, taps, shots and echoes.
fn workload(rate: &Rate) -> String {
    let Rate { beams, samples, taps, shots, echoes_a_beam, cycles_per_instruction, .. } = rate;
    let shots = if *shots == 1 { "1 shot".into() } else { format!("{shots} shots") };
    let echoes = match echoes_a_beam {
        1 => "1 echo".into(),
        n => format!("{n} echoes"),
    };
    format!(
        "{beams} beams of {samples} samples, a filter of {taps} taps, {shots} and {echoes} a beam; \
         {cycles_per_instruction} cycles an instruction assumed\n\n"
    )
}

fn table(rate: &Rate) -> String {
    let needed = format!("MHz at {} Hz", rate.hz);
    let mut text = format!(
        "{:<12} {:<14} {:<11} {:>5} {:>14} {:>9} {needed:>14}\n",
        "processor", "loops", "part", "MHz", "instr. a beam", "scans/s"
    );
    for p in &rate.processors {
        let _ = writeln!(
            text,
            "{:<12} {:<14} {:<11} {:>5} {:>14.0} {:>9} {:>14.0}",
            p.processor.name,
            p.processor.loops,
            p.processor.part,
            p.processor.clock_mhz,
            p.instructions_a_beam,
            rounded(p.scans_a_second),
            p.clock_mhz_needed
        );
    }
    text
}

/// Times that a sensor measured.
fn times_text(times: &Times, hz: f64, seen: &str) -> String {
    let Times { clock, scans, late, longest_us, .. } = times;
    if !clock {
        return "the sensor has no clock: it cannot say how long its scans take\n".into();
    }
    let longest_ms = f64::from(*longest_us) / 1e3;
    format!(
        "the sensor: {late} of {scans} scans{seen} late at {hz} Hz; the longest took \
         {longest_ms:.1} ms, so {} scans/s hold\n",
        rounded(1e3 / longest_ms)
    )
}

/// At least three significant digits.
fn rounded(value: f64) -> String {
    match value {
        v if v >= 100.0 => format!("{v:.0}"),
        v if v >= 10.0 => format!("{v:.1}"),
        v => format!("{v:.2}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_times_of_a_sensor_are_printed_with_the_rate_that_holds() {
        let times =
            Times { clock: true, scans: 3, late: 1, longest_us: 125_000, ..Times::default() };
        let text = "the sensor: 1 of 3 scans late at 10 Hz; the longest took 125.0 ms, so 8.00 \
                    scans/s hold\n";
        assert_eq!(times_text(&times, 10.0, ""), text);
        assert!(times_text(&Times::default(), 10.0, "").contains("no clock"));
    }
}
