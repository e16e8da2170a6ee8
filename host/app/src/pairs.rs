//! `echoloop pairs`.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use clap::{Args, ValueHint};
use serde_json::json;

use super::cloud_output::{format_parser, other_endings};
use super::common::{Setup, on_threads};
use super::exit::{self, Failure};
use super::interrupt::stop_on_interrupt;
use super::method_choice::MethodChoice;
use super::prepared::{connect, traced_for};
use super::progress::Progress;
use echoloop_closed_loop::config::RunConfig;
use echoloop_closed_loop::prepared::PairSet;
use echoloop_closed_loop::run_folder::atomic_folder::AtomicFolder;
use echoloop_closed_loop::scan_folder::pairs::{ScannedPair, scan_pairs, write_pairs};
use echoloop_closed_loop::search::Observer;
use echoloop_clouds::CloudFormat;

/// Flags of `pairs`.
#[derive(Clone, Debug, Args)]
pub(crate) struct PairsArgs {
    #[command(flatten)]
    setup: Setup,
    #[command(flatten)]
    method: MethodChoice,
    #[arg(short, long, value_name = "FOLDER", value_hint = ValueHint::DirPath, help = format!(
        "Folder to make: NNN_target.ply, NNN_source.ply (or {}; sensor frame, m, with all that the \
         sensor tells of each point), the 4 × 4 matrices NNN_target_from_source.txt, \
         NNN_world_from_target.txt and NNN_world_from_source.txt for pair NNN = 000, 001, …; \
         pairs.json, which lists them with the scans' numbers; config.toml",
        other_endings()
    ))]
    output: PathBuf,
    /// Set of pairs.
    #[arg(long, default_value = "test")]
    pairs: PairSet,
    /// Format of the clouds.
    #[arg(long, value_parser = format_parser(), default_value = "ply")]
    format: CloudFormat,
}

pub(super) fn run(args: &PairsArgs) -> Result<(), Failure> {
    let config = args.setup.source.load(args.method.overrides())?;
    check_free(&args.output)?; // now: the scans take long
    let stop = stop_on_interrupt();
    on_threads(args.setup.common.threads, || scan_and_write(args, config, &stop))?
}

fn scan_and_write(args: &PairsArgs, config: RunConfig, stop: &AtomicBool) -> Result<(), Failure> {
    let progress = Progress::new(args.setup.common.quiet);
    let preparation = connect(config, &args.setup.sensor, &progress)?;
    let prepared = traced_for(preparation, args.pairs, &progress)?;
    progress.begin("listening", prepared.pairs(args.pairs).pairs.len() as u64);
    let scanned = scan_pairs(&prepared, args.pairs, stop, &|| progress.evaluated());
    progress.end();
    let scanned = scanned?;
    write_pairs(&args.output, &prepared, &scanned, args.format, stop)?;
    print(args, &scanned)
}

/// Refuses a folder of `--output` that holds something or cannot be made.
pub(super) fn check_free(folder: &Path) -> Result<(), Failure> {
    let refused = |why| Failure::usage(format!("--output {}: {why}", folder.display()));
    AtomicFolder::check_free(folder).map_err(refused)
}

fn print(args: &PairsArgs, scanned: &[ScannedPair<'_>]) -> Result<(), Failure> {
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
        exit::print_json(&document)?;
    } else {
        println!("wrote {} pairs to {folder}, {a_scan} points a scan", scanned.len());
    }
    Ok(())
}
