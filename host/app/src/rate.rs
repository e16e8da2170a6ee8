//! `echoloop rate`.

use std::fmt::Write;
use std::sync::Arc;

use clap::Args;
use echoloop_dsp::{DetectorConfig, Echo, Echoes};
use echoloop_frontend::SceneResponse;
use echoloop_link::Times;
use echoloop_parameters::{Bounds, Kind};
use serde::Serialize;

use super::choice::hold_to;
use super::common::Setup;
use super::exit::{self, Failure};
use super::number::{flag, number_as, read};
use super::progress::Progress;
use echoloop_closed_loop::config::RunConfig;
use echoloop_closed_loop::cost::{Processor, Scanner};
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

/// A deadline is a whole number of microseconds, and one word.
fn hz(text: &str) -> Result<f64, String> {
    read(&flag(Kind::Number, Bounds::between(0.001, 10_000.0)), text)
}

fn cycles(text: &str) -> Result<f64, String> {
    read(&flag(Kind::Number, Bounds::between(0.1, 100.0)), text)
}

/// Speeds of lines, bits a second; a byte is ten.
const LINES: [u32; 3] = [115_200, 921_600, 12_000_000];

/// What a processor holds.
#[derive(Debug, Serialize)]
struct OnProcessor {
    processor: &'static str,
    loops: &'static str,
    part: &'static str,
    clock_mhz: f64,
    instructions_a_beam: f64,
    scans_a_second: f64,
    /// For the scans a second that are wanted.
    clock_mhz_needed: f64,
}

/// What a line carries.
#[derive(Debug, Serialize)]
struct OnLine {
    baud: u32,
    scans_a_second: f64,
}

/// All that limits the rate.
#[derive(Debug, Serialize)]
struct Rate {
    format: u32,
    hz: f64,
    beams: u32,
    samples: i32,
    taps: usize,
    shots: i32,
    echoes_a_beam: u32,
    cycles_per_instruction: f64,
    processors: Vec<OnProcessor>,
    /// One converter: a shot waits until the light of the one before could be back.
    light_scans_a_second: f64,
    bytes_a_scan: f64,
    lines: Vec<OnLine>,
    /// What a sensor that was asked for took.
    measured: Option<Times>,
    /// Whether it saw nothing in those scans, so that there were no echoes to report.
    measured_in_the_dark: bool,
}

pub(super) fn run(args: &RateArgs) -> Result<(), Failure> {
    let config = args.setup.source.load(Vec::new())?;
    let mut rate = estimate(args, &config)?;
    if !args.setup.sensor.is_in_process() {
        rate.measured = Some(measure(args, &config)?);
    }
    match args.setup.common.json {
        true => exit::print(&exit::json(&rate)?),
        false => exit::print(&rate.told()),
    }
}

fn estimate(args: &RateArgs, config: &RunConfig) -> Result<Rate, Failure> {
    let Model { pattern, hardware, .. } = Model::from(config);
    let settings = config.lidar.0;
    let refused = |refusal| Failure::usage(format!("[lidar]: {refusal}"));
    let detector = DetectorConfig::new(&settings, &hardware).map_err(refused)?;
    let echoes = args.echoes.unwrap_or(settings.echoes.unsigned_abs());
    let beams = pattern.beams();
    let on = |processor: &Processor| {
        let instructions_a_beam = processor.instructions(&settings, &hardware, echoes)?;
        let cycles = instructions_a_beam * args.cycles_per_instruction * f64::from(beams);
        Some(OnProcessor {
            processor: processor.name,
            loops: processor.loops,
            part: processor.part,
            clock_mhz: processor.clock_mhz,
            instructions_a_beam,
            scans_a_second: 1e6 * processor.clock_mhz / cycles,
            clock_mhz_needed: 1e-6 * cycles * args.hz,
        })
    };
    let scanner = Scanner::new(hardware, &pattern, config.motion.duration_s);
    let cost = scanner.cost(&settings, &usual_scan(beams, echoes));
    let line = |baud: u32| OnLine { baud, scans_a_second: f64::from(baud) / (cost.bits * 1.25) };
    Ok(Rate {
        format: 1,
        hz: args.hz,
        beams,
        samples: settings.bins,
        taps: detector.template().taps().len(),
        shots: settings.shots,
        echoes_a_beam: echoes,
        cycles_per_instruction: args.cycles_per_instruction,
        processors: Processor::ALL.iter().filter_map(on).collect(),
        light_scans_a_second: 1.0 / cost.seconds,
        bytes_a_scan: cost.bits / 8.0,
        lines: LINES.map(line).into(),
        measured: None,
        measured_in_the_dark: !args.setup.sensor.is_turned_by_others(),
    })
}

/// Echoes with numbers of the usual length.
fn usual_scan(beams: u32, echoes: u32) -> Vec<Echoes> {
    let echo = Echo {
        range: 30_000 << 8,
        amplitude: 4_096,
        width: 115,
        snr: 3_200,
        deviation: 2_048,
        reflectivity: 512,
        ..Echo::default()
    };
    let beam: Echoes = (0..echoes).map(|_| echo).collect();
    vec![beam; beams as usize]
}

/// The sensor's own stopwatch, over some scans of what it sees; a simulated one sees nothing.
fn measure(args: &RateArgs, config: &RunConfig) -> Result<Times, Failure> {
    let model = Model::from(config);
    let sensors = args.setup.sensor.sensors(model.clone())?;
    hold_to(&sensors, &sensors.identity()?, &model)?;
    let nothing = Arc::new(SceneResponse::empty(model.pattern.beams()));
    let deadline_us = (1e6 / args.hz).round() as u32; // `as` saturates
    let progress = Progress::new(args.setup.common.quiet);
    let times = sensors.with(|sensor| {
        sensor.configure(&config.lidar.0)?;
        sensor.client().set_deadline(deadline_us)?;
        progress.begin("scans", args.scans.into());
        for scan in 1..=args.scans {
            sensor.scan(&View { scene: &nothing, noise_seed: 0, scan, viewpoint: scan })?;
            progress.at(scan.into());
        }
        progress.end();
        sensor.client().read_times()
    })?;
    let is_whole = (times.deadline_us, times.scans) == (deadline_us, args.scans);
    if times.clock && !is_whole {
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

impl Rate {
    fn told(&self) -> String {
        let mut text = self.load() + &self.table();
        let _ = writeln!(
            text,
            "\nlight, one shot after the other: {} scans/s",
            rounded(self.light_scans_a_second)
        );
        let of_line = |line: &OnLine| {
            format!("{} scans/s at {} baud", rounded(line.scans_a_second), line.baud)
        };
        let lines: Vec<String> = self.lines.iter().map(of_line).collect();
        let kb = self.bytes_a_scan / 1e3;
        let _ = writeln!(text, "echoes on the link, {kb:.1} kB a scan: {}", lines.join(", "));
        if let Some(times) = &self.measured {
            let seen = if self.measured_in_the_dark { " that saw nothing" } else { "" };
            text += &told_of(times, self.hz, seen);
        }
        text
    }

    /// What the processors have to do.
    fn load(&self) -> String {
        let Self { beams, samples, taps, shots, echoes_a_beam, cycles_per_instruction, .. } = self;
        let shots = if *shots == 1 { "1 shot".into() } else { format!("{shots} shots") };
        let echoes = match echoes_a_beam {
            1 => "1 echo".into(),
            n => format!("{n} echoes"),
        };
        format!(
            "{beams} beams of {samples} samples, a filter of {taps} taps, {shots} and {echoes} a \
             beam; {cycles_per_instruction} cycles an instruction assumed\n\n"
        )
    }

    fn table(&self) -> String {
        let needed = format!("MHz at {} Hz", self.hz);
        let mut text = format!(
            "{:<12} {:<14} {:<11} {:>5} {:>14} {:>9} {needed:>14}\n",
            "processor", "loops", "part", "MHz", "instr. a beam", "scans/s"
        );
        for p in &self.processors {
            let _ = writeln!(
                text,
                "{:<12} {:<14} {:<11} {:>5} {:>14.0} {:>9} {:>14.0}",
                p.processor,
                p.loops,
                p.part,
                p.clock_mhz,
                p.instructions_a_beam,
                rounded(p.scans_a_second),
                p.clock_mhz_needed
            );
        }
        text
    }
}

/// What a sensor's stopwatch says.
fn told_of(times: &Times, hz: f64, seen: &str) -> String {
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

/// Three digits.
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
    fn what_a_sensor_took_is_told_with_the_rate_that_holds() {
        let times =
            Times { clock: true, scans: 3, late: 1, longest_us: 125_000, ..Times::default() };
        let told = "the sensor: 1 of 3 scans late at 10 Hz; the longest took 125.0 ms, so 8.00 \
                    scans/s hold\n";
        assert_eq!(told_of(&times, 10.0, ""), told);
        assert!(told_of(&Times::default(), 10.0, "").contains("no clock"));
    }

    #[test]
    fn the_usual_scan_has_as_many_echoes_as_are_asked_for() {
        let scan = usual_scan(5, 3);
        assert!(scan.len() == 5 && scan.iter().all(|beam| beam.len() == 3));
    }
}
