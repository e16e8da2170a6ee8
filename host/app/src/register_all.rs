//! `echoloop register` of many pairs.

use std::fs;
use std::path::Path;
use std::sync::atomic::Ordering;

use super::exit::{Failure, print};
use super::interrupt::{INTERRUPTED, stop_on_interrupt};
use super::progress::Progress;
use super::register::RegisterArgs;
use echoloop_closed_loop::search::Observer;
use echoloop_clouds::Pose;
use echoloop_clouds::pose::read_trajectory;
use echoloop_files::say;
use echoloop_folders::{Batch, CSV_HEADING, Kept, PairFiles, Record, Tally, sequence};
use echoloop_registration::pair::Request;

/// Registers the pairs of a folder, of a table, or of consecutive scans.
pub(super) fn run(args: &RegisterArgs) -> Result<(), Failure> {
    let pairs = match args.sequence {
        true => PairFiles::consecutive(&args.target),
        false => PairFiles::list(&args.target),
    };
    let (pairs, request) = (pairs.map_err(Failure::usage)?, args.request());
    let has_initial = pairs.iter().any(|pair| pair.initial.is_some());
    request.check(has_initial).map_err(Failure::usage)?;
    let truths = args.truth.as_deref().map(|path| truths(path, &pairs)).transpose()?;
    let settings = settings(&request, args);
    let open = |folder| Kept::open(folder, &settings).map_err(Failure::usage);
    let mut kept = args.output.as_deref().map(open).transpose()?;
    let stop = stop_on_interrupt();
    let progress = Progress::new(args.common.quiet);
    progress.begin("registering", pairs.len() as u64);
    let mut printed = print(if args.common.json { "" } else { CSV_HEADING });
    let mut tell = |record: &Record| {
        progress.evaluated();
        let line = if args.common.json { record.to_json() } else { record.to_csv() };
        if printed.is_ok() {
            printed = print(&line);
        }
        if printed.is_err() {
            stop.store(true, Ordering::Relaxed);
        }
    };
    let batch = Batch {
        pairs: &pairs,
        truths: truths.as_deref().unwrap_or_default(),
        request: &request,
        scales: args.scales(),
    };
    let records = batch.run(kept.as_mut(), &stop, &mut tell).map_err(Failure::run)?;
    progress.end();
    printed?;
    if records.len() < pairs.len() {
        let done = records.len();
        return Err(Failure::new(INTERRUPTED, format!("interrupted; {done} pairs are done")));
    }
    if let Some(folder) = args.output.as_deref().filter(|_| args.sequence) {
        trajectories(folder, &records)?;
    }
    let tally = Tally::of(&records);
    if !args.common.quiet {
        say(&tally);
    }
    match tally.untried.len() {
        0 => Ok(()),
        untried => Err(Failure::usage(format!("{untried} pairs could not be tried"))),
    }
}

/// Truth of consecutive scans by the poses of a trajectory.
fn truths(path: &Path, pairs: &[PairFiles]) -> Result<Vec<Pose>, Failure> {
    let poses = read_trajectory(path).map_err(Failure::usage)?;
    let poses: Vec<Pose> = poses.into_iter().map(|stamped| stamped.pose).collect();
    sequence::truths(&poses, pairs.len()).ok_or_else(|| {
        let (path, scans) = (path.display(), pairs.len() + 1);
        Failure::usage(format!("{path}: expected {scans} poses, one a scan, found {}", poses.len()))
    })
}

/// The same text for the same registration.
fn settings(request: &Request, args: &RegisterArgs) -> String {
    let Request { method, refine, given, tuned } = request;
    let numbers: Vec<String> =
        given.numbers.iter().map(|(setting, value)| format!("{}={value}", setting.key)).collect();
    let (scales, mode, seed) = (args.scales(), given.mode, given.seed);
    let (sequence, words, name) = (args.sequence, numbers.join(" "), method.name());
    let tuned = tuned.map(|tuned| format!(" {tuned:?}")).unwrap_or_default();
    let head = format!("{name} refine={refine} mode={mode:?} seed={seed:?}");
    let text = format!("{head} scales={scales:?} sequence={sequence} {words}{tuned}");
    serde_json::json!({ "format": 1, "settings": text }).to_string()
}

/// Writes the chain of consecutive scans.
fn trajectories(folder: &Path, records: &[Record]) -> Result<(), Failure> {
    let poses = sequence::chain(records);
    for (name, text) in [
        ("poses_kitti.txt", sequence::to_kitti(&poses)),
        ("poses_tum.txt", sequence::to_tum(&poses)),
    ] {
        let path = folder.join(name);
        fs::write(&path, text)
            .map_err(|error| Failure::run(format!("{}: {error}", path.display())))?;
    }
    Ok(())
}
