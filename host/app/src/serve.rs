//! `echoloop serve`.

use std::sync::atomic::Ordering;

use clap::{Args, ValueHint};

use super::common::{ConfigSource, on_threads};
use super::exit::Failure;
use super::interrupt::stop_once_listening;
use super::number::{THREADS, number_as};
use super::prepared::all_pairs;
use super::progress::Progress;
use echoloop_closed_loop::config::RunConfig;
use echoloop_closed_loop::seed::scan_noise;
use echoloop_sensors::sensor::{Detector, Model, Port, SensorError};
use echoloop_sensors::serve::{Viewpoints, serve};
use echoloop_sensors::transport::Serial;

/// Flags of `serve`.
#[derive(Clone, Debug, Args)]
pub(crate) struct ServeArgs {
    #[command(flatten)]
    source: ConfigSource,
    /// No progress, no remarks.
    #[arg(short, long)]
    quiet: bool,
    /// Threads to trace the viewpoints with; 0: as many as there are processors.
    #[arg(long, default_value_t = 0, value_name = "N", value_parser = number_as::<usize>(THREADS))]
    threads: usize,
    /// Serial port or pseudo-terminal to answer on, as /dev/pts/5 or /dev/ttyUSB0@115200.
    #[arg(value_name = "PORT[@BAUD]", value_hint = ValueHint::FilePath)]
    port: Port,
}

pub(super) fn run(args: &ServeArgs) -> Result<(), Failure> {
    let config = args.source.load(Vec::new())?;
    if config.detector.kind == Detector::Ideal {
        let problem = "detector.kind = ideal is for --sensor in-process, not for one on a line";
        return Err(Failure::usage(problem));
    }
    let (is_steered, moves) = (config.device().steered().is_some(), !config.motion.is_still());
    if is_steered && moves {
        let problem = "motion: a steered sensor that is served stands still, as each of its aims \
                       would see the scene along a path of its own";
        return Err(Failure::usage(problem));
    }
    on_threads(args.threads, || answer(args, &config))?
}

fn answer(args: &ServeArgs, config: &RunConfig) -> Result<(), Failure> {
    let stop = stop_once_listening(); // the scenes are traced with nobody listening
    let port = Serial::open(&args.port.path, args.port.baud);
    let mut port = port.map_err(|reason| SensorError::open(&args.port, reason))?;
    let progress = Progress::new(args.quiet);
    let dataset = all_pairs(config, &progress)?;
    progress.end();
    stop.listen();
    let viewpoints = 2 * dataset.pairs().count();
    if config.device().steered().is_some() && config.has_one_aim() {
        progress.say("stored pairs have the beams of one aim: settings with another see nothing");
    }
    progress.say(&format!("serving {viewpoints} viewpoints on {} until ^C", args.port));
    let mut sensor =
        Viewpoints::new(&Model::from(config), dataset, scan_noise(config.seed)).sensor();
    serve(&mut port, &mut sensor, &|| stop.asked.load(Ordering::Relaxed))
        .map_err(|error| SensorError::client(&args.port)(error.into()).into())
}
