//! `echoloop register` of many pairs.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

use super::exit::{Failure, print};
use super::interrupt::{INTERRUPTED, stop_on_interrupt};
use super::progress::Progress;
use super::register::RegisterArgs;
use echoloop_closed_loop::run_folder::files::{FileError, Lock, Output, make_folders};
use echoloop_closed_loop::search::Observer;
use echoloop_clouds::pose::to_kitti;
use echoloop_files::say;
use echoloop_folders::{
    Batch, CSV_HEADING, Kept, PairFiles, Record, Tally, overwritten, sequence, worst,
};
use echoloop_registration::pair::Request;
use echoloop_report::{RegisteredPage, ShownPair, fixed};

/// Registers the pairs of a folder, of a table, or of consecutive scans.
pub(super) fn run(args: &RegisterArgs) -> Result<(), Failure> {
    if args.initial.is_some() {
        let own = "each pair has its own, as NAME_initial.txt or in a column of the table";
        return Err(Failure::usage(format!("--initial goes with SOURCE: {own}")));
    }
    if args.format.is_some() {
        return Err(Failure::usage("--format goes with SOURCE: many sources are written as PLY"));
    }
    let pairs = match args.sequence {
        true => PairFiles::consecutive(&args.target),
        false => PairFiles::list(&args.target),
    };
    let (pairs, request) = (pairs.map_err(Failure::usage)?, args.request());
    let has_initial = pairs.iter().any(|pair| pair.initial.is_some());
    request.check(has_initial).map_err(Failure::usage)?;
    let truths = |poses| sequence::truths(&args.target, poses, pairs.len());
    let truths = args.truth.as_deref().map(truths).transpose().map_err(Failure::usage)?;
    refuse_inputs(args, &pairs)?;
    let _lock = args.output.as_deref().map(locked).transpose()?;
    let settings = settings(&request, args);
    let open = |folder| Kept::open(folder, &settings).map_err(Failure::usage);
    let mut kept = args.output.as_deref().map(open).transpose()?;
    let report = args.report.as_deref().map(Output::at).transpose()?; // before the work
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
    if let Some(output) = &report {
        output.write(page(args, &batch, &records, &tally).to_html().as_bytes())?;
    }
    if !args.common.quiet {
        if args.sequence && args.output.is_some() {
            say_gaps(&records);
        }
        say(&tally);
    }
    match tally.untried.len() {
        0 => Ok(()),
        untried => Err(Failure::usage(format!("{untried} pairs could not be tried"))),
    }
}

/// Refuses outputs that are inputs: a scan laid in its own folder would be moved for good.
fn refuse_inputs(args: &RegisterArgs, pairs: &[PairFiles]) -> Result<(), Failure> {
    let kept = args.output.iter().flat_map(|folder| {
        let chain = TRAJECTORIES.map(|name| folder.join(name));
        Kept::files(folder, pairs).into_iter().chain(chain.into_iter().filter(|_| args.sequence))
    });
    let outputs: Vec<PathBuf> = kept.chain(args.report.clone()).collect();
    let read: Vec<&Path> =
        [Some(&*args.target), args.truth.as_deref()].into_iter().flatten().collect();
    match overwritten(&outputs, pairs, &read) {
        Some(path) => Err(Failure::usage(format!(
            "{}: is an input, and would be overwritten: take another folder or name for the output",
            path.display()
        ))),
        None => Ok(()),
    }
}

/// Makes the output's folder, and keeps it from other processes: lines of two would mix, and both
/// lay the same sources.
fn locked(folder: &Path) -> Result<Lock, FileError> {
    make_folders(folder)?;
    Lock::take(&folder.join("registered.lock"))
}

/// The same text for the same registration.
fn settings(request: &Request, args: &RegisterArgs) -> String {
    let Request { method, refine, given, tuned, .. } = request;
    let numbers: Vec<String> =
        given.numbers.iter().map(|(setting, value)| format!("{}={value}", setting.key)).collect();
    let (scales, mode, seed) = (args.scales(), given.mode, given.seed);
    let (sequence, words, name) = (args.sequence, numbers.join(" "), method.name());
    let tuned = tuned.map(|tuned| format!(" {tuned:?}")).unwrap_or_default();
    let head = format!("{name} refine={refine} mode={mode:?} seed={seed:?}");
    let text = format!("{head} scales={scales:?} sequence={sequence} {words}{tuned}");
    serde_json::json!({ "format": 1, "settings": text }).to_string()
}

/// Page of all pairs, with the worst in three dimensions.
fn page(
    args: &RegisterArgs,
    batch: &Batch<'_>,
    records: &[Record],
    tally: &Tally,
) -> RegisteredPage {
    let number = |of: Option<f64>, scale: f64, digits: usize| {
        of.map_or_else(|| "–".into(), |of| fixed(scale * of, digits))
    };
    let cells = |record: &Record| {
        vec![
            record.name.clone(),
            record.stop.clone(),
            number(record.translation_error_m, 100.0, 2),
            number(record.rotation_error_deg, 1.0, 3),
            number(record.supported, 100.0, 1),
            number(record.known, 100.0, 0),
            number(record.lead, 1.0, 1),
        ]
    };
    let off = |record: &Record| match (record.translation_error_m, record.rotation_error_deg) {
        (Some(m), Some(deg)) => format!("{} cm and {}° off", fixed(100.0 * m, 1), fixed(deg, 2)),
        _ => "error unknown".into(),
    };
    let shown = worst(records).and_then(|index| {
        let record = &records[index];
        let clouds = batch.clouds(index, &record.motion()?).ok()?;
        let lead = format!("{}, the worst of all", record.name);
        Some(ShownPair { lead, off: [String::new(), off(record)], clouds })
    });
    let said = tally.to_string();
    let (title, method) = (args.target.display().to_string(), batch.request.method.name());
    let facts = [("method", method), ("outcome", said.lines().next().unwrap_or_default())];
    RegisteredPage {
        title,
        facts: facts.map(|(name, value)| (name.into(), value.into())).to_vec(),
        heads: HEADS.map(str::to_owned).to_vec(),
        rows: records.iter().map(cells).collect(),
        shown,
    }
}

/// Heads of the page's table.
const HEADS: [&str; 7] = [
    "pair",
    "outcome",
    "error, cm",
    "error, °",
    "on the other cloud, %",
    "known to it, %",
    "lead, sd",
];

/// Files of the chain of consecutive scans.
const TRAJECTORIES: [&str; 2] = ["poses_kitti.txt", "poses_tum.txt"];

/// Writes the chain of consecutive scans.
fn trajectories(folder: &Path, records: &[Record]) -> Result<(), Failure> {
    let poses = sequence::chain(records);
    for (name, text) in TRAJECTORIES.into_iter().zip([to_kitti(&poses), sequence::to_tum(&poses)]) {
        let path = folder.join(name);
        fs::write(&path, text)
            .map_err(|error| Failure::run(format!("{}: {error}", path.display())))?;
    }
    Ok(())
}

/// Most scans that a remark names; the lines of the pairs tell the others.
const MOST_NAMED: usize = 20;

/// Says where the trajectory is not to be trusted: its files have a pose a scan, and no more.
fn say_gaps(records: &[Record]) {
    let sequence::Gaps { still, doubtful } = sequence::gaps(records);
    for (scans, what) in [
        (still, "could not be tried, and the trajectory stands still there"),
        (doubtful, "did not register, and the trajectory is doubtful from there on"),
    ] {
        let named = scans.iter().take(MOST_NAMED).copied().collect::<Vec<_>>().join(", ");
        let more = match scans.len().saturating_sub(MOST_NAMED) {
            0 => String::new(),
            more => format!(" and {more} more"),
        };
        if !scans.is_empty() {
            say(format_args!("motion not known: the pairs of scans {named}{more} {what}"));
        }
    }
}
