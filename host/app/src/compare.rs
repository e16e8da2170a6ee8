//! `echoloop compare`.

use std::path::PathBuf;

use clap::Args;

use super::common::TableFormat;
use super::exit::{self, Failure, print};
use super::report::is_standard_output;
use echoloop_closed_loop::run_folder::files::Output;
use echoloop_report::finished_runs::{FinishedRun, compared};

/// Flags of `compare`.
#[derive(Clone, Debug, Args)]
pub(crate) struct CompareArgs {
    /// Folders of runs that came to their end, two or more; the first is what the others are
    /// compared with.
    #[arg(value_name = "RUN", required = true)]
    runs: Vec<PathBuf>,
    /// Print one JSON document to standard output instead of text.
    #[arg(long, conflicts_with = "format")]
    json: bool,
    /// Format of the table: a line a run.
    #[arg(long, value_name = "FORMAT")]
    format: Option<TableFormat>,
    /// Write a page as well; `-`: to standard output, instead of the table.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
}

pub(super) fn run(args: &CompareArgs) -> Result<(), Failure> {
    if args.runs.len() < 2 {
        return Err(Failure::usage(
            "compare takes two runs or more: the first is what the others are compared with",
        ));
    }
    let runs = args.runs.iter().map(|path| FinishedRun::read(path));
    let compared = compared(&runs.collect::<Result<Vec<_>, _>>()?);
    if let Some(path) = &args.output {
        let html = compared.to_html();
        if is_standard_output(path) {
            return print(&html);
        }
        Output::at(path)?.write(html.as_bytes())?;
    }
    print(&match (args.json, args.format) {
        (true, _) => exit::json(&compared)?,
        (false, None) => compared.text(),
        (false, Some(TableFormat::Csv)) => compared.csv().map_err(Failure::run)?,
    })
}
