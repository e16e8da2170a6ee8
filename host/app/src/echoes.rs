//! `echoloop echoes`.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use echoloop_dsp::peak::MAX_CANDIDATES;
use echoloop_files::say;
use echoloop_instruments::finder::EchoFinder;

use super::common::{Common, on_threads};
use super::exit::{Failure, print};
use super::number::{ANY, number_as};
use super::response::{ResponseArgs, doubt_line, response_line};
use echoloop_instruments::{
    BadOption, Finder, Kind, Noise, Options, Polarity, Reason, Rows, Selection, Waveform, echoes,
    read_waveforms,
};

/// Flags of `echoes`.
#[derive(Clone, Debug, Args)]
#[command(allow_negative_numbers = true)]
pub(crate) struct EchoesArgs {
    /// Waveforms, one a row: CSV without header, rows of any length, a NumPy array (.npy) or HDF5
    /// (GEDI, LVIS). Or one below the other: a value a line, a time and values a line, the CSV of a
    /// LeCroy or Tektronix. Zeros that pad a row's end are ignored.
    waves: PathBuf,
    #[command(flatten)]
    common: Common,
    /// Time between samples, ns; not needed where the file has times in seconds.
    #[arg(long, value_name = "NS")]
    sample_ns: Option<f64>,
    /// Dataset of an HDF5 file, or the group that has it, such as a beam of GEDI [default: the only
    /// one].
    #[arg(long, value_name = "NAME")]
    dataset: Option<String>,
    /// Direction of echoes from the ambient [default: as most rows show it].
    #[arg(long, value_enum)]
    polarity: Option<PolarityArg>,
    /// The emitted pulse of each row, or one for all, in the same format. It gives the pulse's
    /// width, shape and time.
    #[arg(long, value_name = "FILE")]
    outgoing: Option<PathBuf>,
    /// Dataset of the emitted pulses [default: the one named so in the group of `--dataset`].
    #[arg(long, value_name = "NAME", requires = "outgoing")]
    outgoing_dataset: Option<String>,
    #[command(flatten)]
    response: ResponseArgs,
    /// Least height of an echo over the noise.
    #[arg(long, default_value_t = 5.0, value_name = "RATIO")]
    snr: f64,
    /// Least height of an echo over the strongest of its row: what is lower is the receiver's
    /// ringing as often as not.
    #[arg(long, default_value_t = 0.05, value_name = "FRACTION")]
    floor: f64,
    /// Echoes of a row at most; the strongest are kept. No more than 32 are found in any 2400
    /// samples.
    #[arg(long, default_value_t = MAX_CANDIDATES, value_name = "N",
          value_parser = number_as::<usize>(ANY))]
    max_echoes: usize,
    /// Row, from 0, whose tops that are no echoes are listed, with the reasons.
    #[arg(long, value_name = "ROW", conflicts_with = "json")]
    explain: Option<usize>,
    /// Least distance of two echoes, ns; the stronger stays.
    #[arg(long, default_value_t = 0.0, value_name = "NS")]
    min_separation_ns: f64,
}

/// `--polarity`.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum PolarityArg {
    /// They rise above it
    Positive,
    /// They fall below it; amplitudes are depths
    Negative,
}

impl From<PolarityArg> for Polarity {
    fn from(arg: PolarityArg) -> Self {
        match arg {
            PolarityArg::Positive => Self::Positive,
            PolarityArg::Negative => Self::Negative,
        }
    }
}

pub(super) fn run(args: &EchoesArgs) -> Result<(), Failure> {
    checked(args)?;
    let outputs = args.response.outputs()?;
    let received = Selection { name: args.dataset.clone(), kind: Kind::Received };
    let rows = waveforms(args, &args.waves, &received)?;
    if let Some(row) = args.explain.filter(|row| *row >= rows.len()) {
        let (path, count) = (args.waves.display(), rows.len());
        return Err(Failure::usage(format!("--explain {row}: {path} has {count} rows, from 0")));
    }
    let sample_ns = sample_ns(args.sample_ns, &args.waves, &rows)?;
    let finder = Finder::new(options(args, sample_ns));
    let outgoing = args.outgoing.as_ref();
    let outgoing =
        outgoing.map(|path| outgoing_rows(args, path, rows.len(), sample_ns)).transpose()?;
    on_threads(args.common.threads, || {
        let noise = Noise::of_rows(&rows);
        let response = args.response.find(
            &rows,
            outgoing.as_ref(),
            noise.clone(),
            sample_ns,
            args.common.quiet,
        )?;
        if let Some(response) = &response {
            outputs.write(response, &args.waves, sample_ns)?;
            if !args.common.quiet {
                say(response_line(response, sample_ns));
                doubt_line(response, sample_ns).into_iter().for_each(say);
            }
        }
        print_all(args, &finder.with_noise(noise).with_response(response), &rows, outgoing.as_ref())
    })?
}

/// Finds and prints echoes part by part, in the order of the rows.
fn print_all(
    args: &EchoesArgs,
    finder: &Finder,
    rows: &Rows,
    outgoing: Option<&Rows>,
) -> Result<(), Failure> {
    let (json, mut echoes, mut false_alarms, mut levelled) = (args.common.json, 0, 0.0, 0);
    let mut dropped = BTreeMap::new();
    print(if json { "" } else { HEADING })?;
    for start in (0..rows.len()).step_by(AT_A_TIME) {
        let part = start..(start + AT_A_TIME).min(rows.len());
        let found = finder.find_some(rows, outgoing, part);
        print(&if json { lines(&found)? } else { table(&found) })?;
        for top in found.iter().flat_map(|waveform| &waveform.dropped) {
            *dropped.entry(top.reason).or_insert(0) += 1;
        }
        if let Some(row) = args.explain {
            print(&explained(&found, row))?;
        }
        levelled += found.iter().filter(|waveform| waveform.background != 0.0).count();
        false_alarms += found.iter().map(|waveform| waveform.false_alarms).sum::<f64>();
        echoes += found.iter().map(|waveform| waveform.echoes.len()).sum::<usize>();
    }
    if !args.common.quiet {
        if levelled > 0 {
            say(format_args!(
                "remark: the background changes in {levelled} of {} rows, and was taken out",
                rows.len()
            ));
        }
        if !dropped.is_empty() {
            say(dropped_line(&dropped));
        }
        say(format_args!("noise alone would make {} echoes", few(false_alarms)));
    }
    match json {
        true => Ok(()),
        false => print(&format!("{echoes} echoes in {} waveforms\n", rows.len())),
    }
}

/// Why a top is no echo.
fn why(reason: Reason) -> &'static str {
    match reason {
        Reason::Ringing => "ringing after an undershoot, or as in the emitted pulse",
        Reason::Cut => "at an end of the row, or not above the ambient",
        Reason::Near => "nearer than the least separation to a higher one",
        Reason::Surplus => "more than --max-echoes",
        Reason::Gap => "beside missing samples, or on a step of the background",
        Reason::Response => "explained by the response of other echoes",
        Reason::Floor => "below --floor",
    }
}

/// Number of tops that are no echoes, by reason.
fn dropped_line(dropped: &BTreeMap<Reason, usize>) -> String {
    let parts: Vec<String> =
        dropped.iter().map(|(reason, count)| format!("{count} {}", why(*reason))).collect();
    format!("tops that are no echoes: {} (--explain ROW lists a row's)", parts.join("; "))
}

/// A row's tops that are no echoes.
fn explained(found: &[Waveform], row: usize) -> String {
    let mut text = String::new();
    let waveform = found.iter().find(|waveform| waveform.waveform == row);
    for top in waveform.iter().flat_map(|waveform| &waveform.dropped) {
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "{row:>8} {:>12.3} {:>12.5}  no echo: {}",
            top.time_ns,
            top.amplitude,
            why(top.reason)
        );
    }
    text
}

/// A small expected number, to two digits.
fn few(expected: f64) -> String {
    match expected {
        0.01.. => format!("{expected:.2}"),
        _ => "less than 0.01".into(),
    }
}

/// Rows whose echoes are in memory at a time: a short row has a document many times its size.
const AT_A_TIME: usize = 4096;

/// Waveforms of a file, echoes upwards; what was taken otherwise than as rows of samples is said.
fn waveforms(args: &EchoesArgs, path: &Path, from: &Selection) -> Result<Rows, Failure> {
    let rows = read_waveforms(path, from).map_err(Failure::usage)?;
    let rows = rows.with_polarity(args.polarity.map(Polarity::from));
    for remark in rows.remarks().iter().filter(|_| !args.common.quiet) {
        say(format_args!("remark: {}: {remark}", path.display()));
    }
    Ok(rows)
}

/// Steps of a time axis that is not known to be in seconds may be in any of these, ns.
const UNITS_NS: [f64; 5] = [1e9, 1e6, 1e3, 1.0, 1e-3];

/// Greatest difference of the steps of a time axis from `--sample-ns`, as a share.
const SAME: f64 = 0.01;

/// Time between samples, ns: as given, or by the file's time axis. The two have to agree.
fn sample_ns(given: Option<f64>, path: &Path, rows: &Rows) -> Result<f64, Failure> {
    let path = path.display();
    let (ns, axis) = match (given, rows.axis()) {
        (Some(ns), None) => return Ok(ns),
        (None, None) => {
            return Err(Failure::usage(format!(
                "--sample-ns is missing: {path} has no time axis in seconds"
            )));
        }
        (None, Some(axis)) if axis.is_in_seconds => return Ok(1e9 * axis.step),
        (None, Some(axis)) => {
            return Err(Failure::usage(format!(
                "--sample-ns is missing: the time axis of {path} has steps of {}, in an unknown \
                 unit",
                axis.step
            )));
        }
        (Some(ns), Some(axis)) => (ns, axis),
    };
    let units = if axis.is_in_seconds { &UNITS_NS[..1] } else { &UNITS_NS };
    match units.iter().any(|unit| (unit * axis.step / ns - 1.0).abs() <= SAME) {
        true => Ok(ns),
        false => Err(Failure::usage(format!(
            "--sample-ns {ns} is not what {path} says: its time axis has steps of {}{}",
            axis.step,
            if axis.is_in_seconds { " s" } else { "" }
        ))),
    }
}

/// Refuses what is out of range.
fn checked(args: &EchoesArgs) -> Result<(), Failure> {
    options(args, args.sample_ns.unwrap_or(1.0)).check().map_err(
        |BadOption { name, value, expected }| {
            Failure::usage(format!("--{} {value} must be {expected}", name.replace('_', "-")))
        },
    )
}

fn options(args: &EchoesArgs, sample_ns: f64) -> Options {
    Options {
        sample_ns,
        snr: args.snr,
        floor: args.floor,
        max_echoes: args.max_echoes,
        min_separation_ns: args.min_separation_ns,
    }
}

/// Emitted pulses of an HDF5 file: as named, or beside the waveforms.
fn emitted(args: &EchoesArgs, path: &Path) -> Selection {
    let beside = args.dataset.clone().filter(|_| path == args.waves);
    match (&args.outgoing_dataset, beside) {
        (None, Some(name)) => Selection { name: Some(name), kind: Kind::EmittedBeside },
        (name, _) => Selection { name: name.clone(), kind: Kind::Emitted },
    }
}

/// Reads the emitted pulses: as many as rows, or one. A row that shows no pulse is warned of and
/// left out.
fn outgoing_rows(args: &EchoesArgs, path: &Path, rows: usize, ns: f64) -> Result<Rows, Failure> {
    let outgoing = waveforms(args, path, &emitted(args, path))?;
    sample_ns(Some(ns), path, &outgoing)?;
    if outgoing.len() != rows && outgoing.len() != 1 {
        let (path, waves) = (path.display(), args.waves.display());
        let found = outgoing.len();
        return Err(Failure::usage(format!(
            "{path}: expected 1 row or {rows}, as {waves} has, found {found}"
        )));
    }
    let mut finder_memory = Box::new(EchoFinder::new());
    for row in (0..outgoing.len()).filter(|_| !args.common.quiet) {
        if !echoes::shows_pulse(&mut finder_memory, &outgoing, row) {
            let number = row + 1;
            say(format_args!(
                "warning: {}: row {number} shows no pulse and is left out",
                path.display()
            ));
        }
    }
    Ok(outgoing)
}

/// One JSON document a waveform.
fn lines(found: &[Waveform]) -> Result<String, Failure> {
    let mut text = String::new();
    for waveform in found {
        text += &serde_json::to_string(waveform).map_err(Failure::run)?;
        text.push('\n');
    }
    Ok(text)
}

const HEADING: &str = "waveform      time ns    amplitude   width ns       snr  flags\n";

fn table(found: &[Waveform]) -> String {
    let mut text = String::new();
    for waveform in found {
        for echo in &waveform.echoes {
            let flags = echo.flags.join(" ");
            // Writing to a String cannot fail.
            let _ = writeln!(
                text,
                "{:>8} {:>12.3} {:>12.5} {:>10.3} {:>9.1}  {flags}",
                waveform.waveform, echo.time_ns, echo.amplitude, echo.width_ns, echo.snr
            );
        }
    }
    text
}
