//! `echoloop evaluate --pairs PATH`: the registration alone, on clouds that are there.

use std::path::Path;

use serde_json::json;

use super::common::TableFormat;
use super::evaluate::{EvaluateArgs, print_text};
use super::exit::{self, Failure};
use super::interrupt::{INTERRUPTED, stop_on_interrupt};
use super::prepared::require_recall;
use super::progress::Progress;
use echoloop_closed_loop::config::RunConfig;
use echoloop_closed_loop::evaluation::objective::register_clouds;
use echoloop_closed_loop::evaluation::summary::Summary;
use echoloop_closed_loop::parameters::{Parameters, Values, values_json};
use echoloop_closed_loop::search::Observer;
use echoloop_files::say;
use echoloop_folders::{KnownPair, KnownPairs, Tried};
use echoloop_registration::pair::RequestError;
use echoloop_report::named_pair_errors_csv;

/// Judges the configuration's registration, with a candidate's values laid over it.
pub(super) fn run(
    args: &EvaluateArgs,
    path: &Path,
    config: &RunConfig,
    values: &Values,
) -> Result<(), Failure> {
    check(args, path, values)?;
    let laid = Parameters::registration_of(config, values);
    let registration = laid.map_err(|problem| args.refused(problem))?;
    let pairs = KnownPairs::list(path, config.data.hard_baseline_m()).map_err(Failure::usage)?;
    let method = registration.method.method();
    if pairs.have_initial() && method.is_rough() {
        let error = RequestError::Initial(method);
        return Err(Failure::usage(format!("{}: {error}", path.display())));
    }
    let stop = stop_on_interrupt();
    let progress = Progress::new(args.setup.common.quiet);
    progress.begin("judging", pairs.len() as u64);
    let judge = |index: usize, KnownPair { clouds, initial, truth }: &KnownPair| {
        register_clouds(&registration, index, clouds, initial, truth).0
    };
    let Tried { done, untried } = pairs.each(&judge, &stop, &|| progress.evaluated());
    progress.end();
    let (names, errors): (Vec<String>, Vec<_>) = done.into_iter().unzip();
    if names.len() + untried.len() < pairs.len() {
        let done = names.len();
        return Err(Failure::new(INTERRUPTED, format!("interrupted; {done} pairs are done")));
    }
    let mut judged = Ok(());
    if !errors.is_empty() {
        let summary = Summary::from_errors(errors, &config.data);
        print(args, path, &registration.values(config), (&names, &summary))?;
        judged = require_recall(args.require_recall, &summary);
    }
    untried.iter().for_each(|why| say(format_args!("not tried: {why}")));
    match untried.len() {
        0 => judged,
        all if all == pairs.len() => Err(Failure::usage("no pair could be tried")),
        some => Err(Failure::usage(format!("{some} pairs could not be tried"))),
    }
}

/// Prefix of the sensor's parameters.
const SENSOR: &str = "lidar.";

/// Refuses what is no path, and what goes with traced pairs.
fn check(args: &EvaluateArgs, path: &Path, values: &Values) -> Result<(), Failure> {
    let pairs = path.display();
    if !path.exists() {
        return Err(Failure::usage(format!(
            "invalid value '{pairs}' for '--pairs': expected train, test, or the path of a folder \
             of pairs, of a table of them (.csv), or of a sequence of scans"
        )));
    }
    let made = format!("the scans of --pairs {pairs} are made already");
    if args.stream {
        let expected = "--stream goes with --pairs train or test";
        return Err(Failure::usage(format!("{expected}: {made}")));
    }
    if !args.setup.sensor.is_in_process() {
        return Err(Failure::usage(format!("--sensor goes with --pairs train or test: {made}")));
    }
    match values.keys().find(|name| name.starts_with(SENSOR)) {
        Some(name) => Err(args.refused(format!("{name} is of the sensor, and {made}"))),
        None => Ok(()),
    }
}

fn print(
    args: &EvaluateArgs,
    path: &Path,
    values: &Values,
    (names, summary): (&[String], &Summary),
) -> Result<(), Failure> {
    let path = path.display().to_string();
    if let Some(TableFormat::Csv) = args.format {
        let table = named_pair_errors_csv(&path, names, summary);
        return exit::print(&table.map_err(Failure::run)?);
    }
    if args.setup.common.json {
        return exit::print_json(&json!({
            "format": 1, "parameters": values_json(values), "pairs": path, "names": names,
            "summary": summary,
        }));
    }
    print_text(summary, &format!("{} pairs of {path}", summary.pairs));
    Ok(())
}
