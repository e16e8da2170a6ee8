//! `echoloop pairs`.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

use clap::{Args, ValueHint};
use rayon::prelude::*;
use serde_json::{Value, json};

use super::atomic_folder::{Draft, check_free, go_on};
use super::cloud_output::format_parser;
use super::common::{Setup, on_threads};
use super::exit::{self, Failure};
use super::interrupt::stop_on_interrupt;
use super::method_choice::MethodChoice;
use super::prepared::{PairSet, Prepared};
use super::progress::Progress;
use echoloop_closed_loop::config::RunConfig;
use echoloop_closed_loop::dataset::{Facts, ScanPair};
use echoloop_closed_loop::evaluation::scan_cloud::recorded_from_scan;
use echoloop_closed_loop::search::Observer;
use echoloop_registration::cloud::{CloudFormat, Recorded};
use echoloop_registration::pose::{Pose, to_rows};
use echoloop_sensors::sensor::View;

/// Flags of `pairs`.
#[derive(Clone, Debug, Args)]
pub(crate) struct PairsArgs {
    #[command(flatten)]
    setup: Setup,
    #[command(flatten)]
    method: MethodChoice,
    /// Folder to make: NNN_target.ply, NNN_source.ply (or .pcd; sensor frame, m, with all that the
    /// sensor tells of each point), the 4 × 4 matrices
    /// NNN_target_from_source.txt, NNN_world_from_target.txt and NNN_world_from_source.txt for pair
    /// NNN = 000, 001, …; pairs.json, which lists them with the scans' numbers; config.toml.
    #[arg(short, long, value_name = "FOLDER", value_hint = ValueHint::DirPath)]
    output: PathBuf,
    /// Which pairs.
    #[arg(long, default_value = "test")]
    pairs: PairSet,
    /// Format of the clouds.
    #[arg(long, value_parser = format_parser(), default_value = "ply")]
    format: CloudFormat,
}

/// A pair as it came back.
struct Scanned<'a> {
    pair: &'a ScanPair,
    /// First and second, which a registration calls target and source.
    clouds: [Recorded; 2],
}

pub(super) fn run(args: &PairsArgs) -> Result<(), Failure> {
    let config = args.setup.source.load(args.method.overrides())?;
    check_free(&args.output)?; // now: the scans take long
    let stop = stop_on_interrupt();
    on_threads(args.setup.common.threads, || scan_and_write(args, config, &stop))?
}

fn scan_and_write(args: &PairsArgs, config: RunConfig, stop: &AtomicBool) -> Result<(), Failure> {
    let progress = Progress::new(args.setup.common.quiet);
    let prepared = Prepared::new(config, &args.setup.sensor, &progress)?;
    // The noise that `evaluate` gives them.
    let noisy = prepared.pairs(args.pairs);
    progress.begin("listening", noisy.pairs.len() as u64);
    let scanned: Result<Vec<Scanned<'_>>, Failure> = noisy
        .pairs
        .par_iter()
        .enumerate()
        .map(|(index, pair)| {
            go_on(stop)?;
            let scanned = scan(&prepared, pair, noisy.noise_seed(index));
            progress.evaluated();
            scanned
        })
        .collect();
    progress.end();
    let scanned = scanned?;
    write(args, &prepared, &scanned, stop)?;
    print(args, &scanned)
}

/// Both scans with the configured settings.
fn scan<'a>(
    prepared: &Prepared,
    pair: &'a ScanPair,
    noise_seed: u64,
) -> Result<Scanned<'a>, Failure> {
    let views = [(&pair.first, 1), (&pair.second, 2)];
    let scans = prepared.sensors.with(|sensor| {
        sensor.configure(&prepared.start.settings)?;
        let mut look = |at: usize| {
            let (scene, scan) = views[at];
            sensor.scan(&View { scene, noise_seed, scan, viewpoint: pair.viewpoints[at] })
        };
        Ok([look(0)?, look(1)?])
    })?;
    let (beams, duration_s) = (&prepared.dataset.beams, prepared.config.motion.duration_s);
    let recorded = |i: usize| recorded_from_scan(&scans[i], beams, pair.viewpoints[i], duration_s);
    let clouds = [recorded(0), recorded(1)];
    match clouds.iter().position(|scan| scan.cloud.points.is_empty()) {
        Some(at) => Err(Failure::run(format!(
            "scan {}: no beam returned an echo (is the sensor inside something, or too weak?)",
            pair.viewpoints[at]
        ))),
        None => Ok(Scanned { pair, clouds }),
    }
}

fn write(
    args: &PairsArgs,
    prepared: &Prepared,
    scanned: &[Scanned<'_>],
    stop: &AtomicBool,
) -> Result<(), Failure> {
    let draft = Draft::beside(&args.output)?;
    for (index, scanned) in scanned.iter().enumerate() {
        go_on(stop)?;
        write_pair(&draft, index, scanned, args.format)?;
    }
    draft.write("config.toml", toml::to_string(&prepared.config).map_err(Failure::run)?)?;
    let listed = |(index, scanned)| listed(index, scanned);
    let list = json!({
        "format": 1,
        "sensor": prepared.sensor,
        "set": Facts::new(&prepared.dataset),
        "pairs": scanned.iter().enumerate().map(listed).collect::<Vec<_>>(),
    });
    draft.write("pairs.json", exit::json(&list)?)?;
    Ok(draft.become_folder(&args.output)?)
}

fn write_pair(
    draft: &Draft,
    index: usize,
    scanned: &Scanned<'_>,
    format: CloudFormat,
) -> Result<(), Failure> {
    let name = name(index);
    let [world_from_target, world_from_source] = &scanned.pair.world_from_sensor;
    for (end, Recorded { cloud, columns, .. }) in
        ["target", "source"].into_iter().zip(&scanned.clouds)
    {
        let file = format!("{name}_{end}.{}", format.name());
        draft.write(&file, format.bytes(cloud, columns))?;
    }
    draft.write(&format!("{name}_target_from_source.txt"), matrix(&scanned.pair.truth))?;
    draft.write(&format!("{name}_world_from_target.txt"), matrix(world_from_target))?;
    draft.write(&format!("{name}_world_from_source.txt"), matrix(world_from_source))
}

fn name(index: usize) -> String {
    format!("{index:03}")
}

/// Four rows of four, every digit: what `register --initial` reads.
fn matrix(pose: &Pose) -> String {
    to_rows(pose).chunks(4).fold(String::new(), |mut text, row| {
        let _ = writeln!(text, "{} {} {} {}", row[0], row[1], row[2], row[3]);
        text
    })
}

/// The entry of a pair in the list. The frame is the number that the firmware writes to the
/// emitter's FRAME register.
fn listed(index: usize, Scanned { pair, clouds }: &Scanned<'_>) -> Value {
    json!({
        "name": name(index),
        "place": pair.place,
        "frames": pair.viewpoints,
        "points": clouds.each_ref().map(|scan| scan.cloud.points.len()),
        "baseline_m": pair.truth.translation.vector.norm(),
        "turn_deg": pair.truth.rotation.angle().to_degrees(),
        "overlap": pair.overlap,
    })
}

fn print(args: &PairsArgs, scanned: &[Scanned<'_>]) -> Result<(), Failure> {
    let points: usize = scanned
        .iter()
        .flat_map(|scanned| &scanned.clouds)
        .map(|scan| scan.cloud.points.len())
        .sum();
    let a_scan = points / (2 * scanned.len()).max(1);
    let folder = args.output.display();
    if args.setup.common.json {
        let document = json!({
            "format": 1,
            "folder": folder.to_string(),
            "pairs": scanned.len(),
            "mean_points": a_scan,
        });
        exit::print(&exit::json(&document)?)?;
    } else {
        println!("wrote {} pairs to {folder}, {a_scan} points a scan", scanned.len());
    }
    Ok(())
}
