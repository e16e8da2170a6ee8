//! `echoloop report`.

use std::path::{Path, PathBuf};

use clap::Args;

use super::exit::{Failure, print};
use echoloop_closed_loop::run_folder::files::Output;
use echoloop_closed_loop::run_folder::run::{REPORT, RunFolder};
use echoloop_report::finished_runs::FinishedRun;
use echoloop_report::{Report, write_figures};

/// Flags of `report`.
#[derive(Clone, Debug, Args)]
pub(crate) struct ReportArgs {
    /// Folder of a run that came to its end.
    #[arg(value_name = "RUN")]
    run: PathBuf,
    /// File of the page; `-`: standard output [default: report.html in RUN].
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Write every chart as well, as SVG and as PNG.
    #[arg(long, value_name = "FOLDER")]
    figures: Option<PathBuf>,
    /// No remarks.
    #[arg(short, long)]
    quiet: bool,
}

pub(super) fn run(args: &ReportArgs) -> Result<(), Failure> {
    let report = Report::of(FinishedRun::read(&args.run)?)?;
    let html = report.to_html();
    let figures = args.figures.as_deref().map(|folder| charts(&report, folder)).transpose()?;
    let written = match args.output.as_deref() {
        Some(path) if is_standard_output(path) => return print(&html),
        Some(path) => {
            Output::at(path)?.write(html.as_bytes())?;
            path.to_owned()
        }
        None => {
            RunFolder::open(&args.run)?.write(REPORT, &html)?;
            args.run.join(REPORT)
        }
    };
    if !args.quiet {
        println!("report   {}", written.display());
        if let Some((folder, count)) = args.figures.as_ref().zip(figures) {
            println!("figures  {count} charts, each .svg and .png, in {}", folder.display());
        }
    }
    Ok(())
}

/// True of `-`.
pub(super) fn is_standard_output(path: &Path) -> bool {
    path == Path::new("-")
}

/// Writes the page of a run into its folder, from that folder alone.
pub(super) fn write_page(folder: &RunFolder) -> Result<(), Failure> {
    let html = Report::of(FinishedRun::read(folder.path())?)?.to_html();
    Ok(folder.write(REPORT, html)?)
}

/// Writes every chart and counts them.
fn charts(report: &Report, folder: &Path) -> Result<usize, Failure> {
    let figures = report.figures().map_err(Failure::run)?;
    write_figures(&figures, folder)?;
    Ok(figures.len())
}
