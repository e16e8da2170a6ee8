//! `echoloop reproduce`.

mod latex;
mod overlays;
mod runner;
mod written;

use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use clap::{Args, ValueEnum};

use super::common::{Common, on_threads};
use super::exit::{self, Failure, print};
use super::interrupt::stop_on_interrupt;
use super::number::{number_of, seed};
use super::progress::Progress;
use super::report::is_standard_output;
use echoloop_closed_loop::config::preset::{Preset, Strategy};
use echoloop_closed_loop::config::{Override, default_runs_folder};
use echoloop_closed_loop::run_folder::files::{Output, file_error};
use echoloop_closed_loop::search::Observer;
use echoloop_files::say;
use echoloop_report::write_figures;
use echoloop_study::{
    Base, ByHand, Cell, Cells, Figures, Folder, FolderError, FolderPlan, RealPair, RealRow,
    Selection, Table, figures, judge_real, name_of, page, read_real_pairs,
};
use overlays::overlays;
use runner::Runner;

/// Flags of `reproduce`.
#[derive(Clone, Debug, Args)]
pub(crate) struct ReproduceArgs {
    #[command(flatten)]
    selection: Selection,
    /// Few pairs, few generations, our search and ranges for outdoors: the table's shape in some
    /// minutes, which proves nothing.
    #[arg(long)]
    quick: bool,
    /// Run nothing: print the table of what is done.
    #[arg(long)]
    table: bool,
    /// Decides every random choice.
    #[arg(long, value_name = "N", value_parser = seed)]
    seed: Option<u64>,
    /// Held-out pairs of a cell [default: 100].
    #[arg(long, value_name = "N", value_parser = number_of::<u32>("data.test_pairs"))]
    pairs: Option<u32>,
    /// Pairs to tune on [default: the strategy's own: of the paper's 10, of ours 30, and 100 for
    /// FGR and MAC].
    #[arg(long, value_name = "N", value_parser = number_of::<u32>("data.train_pairs"))]
    train_pairs: Option<u32>,
    /// Generations of each search [default: 30].
    #[arg(long, value_name = "N", value_parser = number_of::<u32>("tune.generations"))]
    generations: Option<u32>,
    /// Set one value of every cell, as scanner.columns=384; may be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<Override>,
    /// Folder of the cells [default: runs/reproduce; with --quick runs/reproduce-quick].
    #[arg(long, value_name = "FOLDER")]
    runs: Option<PathBuf>,
    /// A list of pairs of real clouds with their true motions: a second table, of what was tuned
    /// on them.
    #[arg(long, value_name = "LIST")]
    real: Option<PathBuf>,
    /// Folder of the list's relative paths [default: the list's folder].
    #[arg(long, value_name = "FOLDER", requires = "real")]
    real_data: Option<PathBuf>,
    /// Format of the printed table.
    #[arg(long, value_enum, default_value_t = Format::Text, conflicts_with = "json")]
    format: Format,
    /// Write the page here as well; `-`: to standard output, instead of the table.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Write every figure of what is done as well, as SVG and as PNG.
    #[arg(long, value_name = "FOLDER", conflicts_with = "ablation")]
    figures: Option<PathBuf>,
    #[command(flatten)]
    common: Common,
}

/// Format of the printed table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Format {
    /// To read.
    Text,
    /// One document.
    Json,
    /// A line a cell.
    Csv,
    /// A `tabular` for a paper.
    Latex,
}

impl ReproduceArgs {
    /// Cells selected by the flags; with `--quick` or `--ablation`, of one range and one search.
    fn selection(&self) -> Selection {
        let mut selection = self.selection.clone();
        let is_narrow = self.quick || !selection.ablation.is_empty();
        if is_narrow && selection.ranges.is_empty() {
            selection.ranges.push(Preset::Outdoor);
        }
        if is_narrow && selection.strategy.is_empty() {
            selection.strategy.push(Strategy::Fast);
        }
        selection
    }

    /// Refuses an ablation that changes nothing.
    fn check_ablation(&self) -> Result<(), Failure> {
        let Selection { ablation, ranges, .. } = &self.selection;
        let switch = ablation.iter().find(|switch| switch.choice().sets("registration.preset"));
        match switch.filter(|_| ranges.contains(&Preset::Paper)) {
            Some(switch) => Err(Failure::usage(format!(
                "--ablation {}: with --ranges {} nothing is switched; expected --ranges {}",
                name_of(*switch),
                name_of(Preset::Paper),
                name_of(Preset::Outdoor)
            ))),
            None => Ok(()),
        }
    }

    /// Refuses `--by-hand` without the method of its cases.
    fn check_by_hand(&self) -> Result<(), Failure> {
        let Selection { method, by_hand, .. } = &self.selection;
        let has_method = method.is_empty() || method.contains(&ByHand::METHOD);
        match *by_hand && !has_method {
            true => Err(Failure::usage(format!(
                "--by-hand: its cases are of {0}, as the paper's Fig. 1, and --method leaves {0} \
                 out",
                name_of(ByHand::METHOD)
            ))),
            false => Ok(()),
        }
    }

    /// Settings that all cells share.
    fn base(&self) -> Result<Base, Failure> {
        let quick = Base::quick().into_iter().filter(|_| self.quick);
        let seed = self.seed.map(|seed| i64::try_from(seed).unwrap_or(i64::MAX)); // larger: refused
        let own = [
            ("seed", seed),
            ("data.test_pairs", self.pairs.map(i64::from)),
            ("data.train_pairs", self.train_pairs.map(i64::from)),
            ("tune.generations", self.generations.map(i64::from)),
        ];
        let own = own.into_iter().filter_map(|(key, value)| Some(Override::flag(key, value?)));
        let base = Base::paper(quick.chain(self.set.iter().cloned()).chain(own).collect());
        match base.sets_an_axis() {
            Some((key, axis)) => Err(Failure::usage(format!(
                "--set {key}: the cells set it themselves; --{axis} says which cells there are"
            ))),
            None => Ok(base),
        }
    }

    fn folder(&self) -> PathBuf {
        let name = if self.quick { "reproduce-quick" } else { "reproduce" };
        self.runs.clone().unwrap_or_else(|| default_runs_folder().join(name))
    }
}

impl From<FolderError> for Failure {
    fn from(error: FolderError) -> Self {
        Self::usage(error)
    }
}

pub(super) fn run(args: &ReproduceArgs) -> Result<(), Failure> {
    args.check_by_hand()?;
    args.check_ablation()?;
    let (base, cells) = (args.base()?, args.selection().cells());
    let plan = FolderPlan::new(&base.config().map_err(Failure::usage)?, args.quick);
    let real = args.real.as_deref().map(|list| real_pairs(args, list)).transpose()?;
    let output = args.output.as_deref().filter(|path| !is_standard_output(path));
    let output = output.map(Output::at).transpose()?;
    args.figures.as_deref().map(check_folder).transpose()?;
    let folder = match args.table {
        true => Folder::look(&args.folder())?,
        false => Folder::open(&args.folder(), plan)?,
    };
    let ended = match args.table {
        true => Ok(()),
        false => {
            let stop = stop_on_interrupt();
            on_threads(args.common.threads, || run_cells(args, &base, &folder, &cells, &stop))?
        }
    };
    let mut table = Table::new(&folder, &with_plain(&folder, &cells))?;
    if let Some(pairs) = &real {
        let judged = || real_rows(args, &base, &folder, &cells, pairs);
        table.real = on_threads(args.common.threads, judged)??;
    }
    if ended.is_err() {
        // Interrupted: saves the table so far, without figures, as some need new scans.
        folder.save_table(&table, &page(&table, Figures::default()).to_html())?;
        return ended;
    }
    let (html, paths) = written_pages(args, &folder, &table)?;
    output.map(|output| output.write(html.as_bytes())).transpose()?;
    match args.output.as_deref() {
        Some(path) if is_standard_output(path) => print(&html)?,
        _ => print_table(args, &table, &paths)?,
    }
    outcome(&table)
}

/// Draws the page and the figures, and writes them where the flags say. Returns the page's HTML,
/// empty where none is needed, and lines that name the files written.
fn written_pages(
    args: &ReproduceArgs,
    folder: &Folder,
    table: &Table,
) -> Result<(String, String), Failure> {
    if args.table && args.output.is_none() && args.figures.is_none() {
        return Ok(Default::default());
    }
    // The paper has no figure of an ablation.
    let drawn = || match args.selection.ablation.is_empty() {
        true => {
            let cells = Cells::read(folder, table);
            figures(&cells, &overlays(folder, &cells))
        }
        false => Figures::default(),
    };
    let drawn = on_threads(args.common.threads, drawn)?;
    if args.figures.is_some() && drawn.plates.is_empty() {
        let left_out = drawn.left_out.join(" ");
        let place = args.folder();
        return Err(Failure::usage(format!(
            "{}: no cell of the selection is done, so there is nothing to draw. {left_out}",
            place.display()
        )));
    }
    let left_out = drawn.left_out.clone();
    let page = page(table, drawn);
    let html = page.to_html();
    let mut paths = String::new();
    if !args.table {
        let place = folder.save_table(table, &html)?;
        paths += &format!("\nreport   {}\n", place.display());
    }
    if let Some(at) = &args.figures {
        let figures = page.figures().map_err(Failure::run)?;
        write_figures(&figures, at)?;
        paths += &format!(
            "{}figures  {}, each .svg and .png, in {}\n",
            if paths.is_empty() { "\n" } else { "" },
            figures.len(),
            at.display()
        );
        left_out.iter().for_each(|why| paths += &format!("{why}\n"));
    }
    Ok((html, paths))
}

/// Refuses a folder that figures cannot be written to, before any work.
///
/// # Errors
///
/// A file in the way, or a folder that takes none.
fn check_folder(folder: &Path) -> Result<(), Failure> {
    let is_there = |path: &&Path| path.as_os_str().is_empty() || path.symlink_metadata().is_ok();
    let nearest = folder.ancestors().find(is_there).unwrap_or(Path::new(""));
    let nearest = if nearest.as_os_str().is_empty() { Path::new(".") } else { nearest };
    let fail = |kind: ErrorKind| file_error("write figures in", folder)(kind.into());
    if !nearest.is_dir() {
        return Err(fail(ErrorKind::NotADirectory).into());
    }
    Output::at(&nearest.join("figure.svg.probe")).map_err(|error| fail(error.source.kind()))?;
    Ok(())
}

fn run_cells(
    args: &ReproduceArgs,
    base: &Base,
    folder: &Folder,
    cells: &[Cell],
    stop: &AtomicBool,
) -> Result<(), Failure> {
    let progress = Progress::new(args.common.quiet);
    let ended = Runner::new(base, folder, &progress, stop)?.run(cells);
    progress.end();
    ended
}

/// Reads `--real`, before any cell is run.
fn real_pairs(args: &ReproduceArgs, list: &Path) -> Result<Vec<RealPair>, Failure> {
    let own = list.parent().unwrap_or(Path::new(""));
    let folder = args.real_data.as_deref().unwrap_or(own);
    read_real_pairs(list, folder).map_err(Failure::usage)
}

fn real_rows(
    args: &ReproduceArgs,
    base: &Base,
    folder: &Folder,
    cells: &[Cell],
    pairs: &[RealPair],
) -> Result<Vec<RealRow>, Failure> {
    let progress = Progress::new(args.common.quiet);
    let begun = |registrations| progress.begin("real clouds", registrations as u64);
    let rows = judge_real(pairs, base, folder, cells, &begun, &|| progress.evaluated());
    progress.end();
    rows.map_err(Failure::usage)
}

/// The cells, then the finished cells without ablation that they are compared with.
fn with_plain(folder: &Folder, cells: &[Cell]) -> Vec<Cell> {
    let mut all = cells.to_vec();
    for plain in cells.iter().filter(|cell| cell.ablation.is_some()).map(Cell::plain) {
        if !all.contains(&plain) && matches!(folder.record(&plain), Ok(Some(_))) {
            all.push(plain);
        }
    }
    all
}

fn print_table(args: &ReproduceArgs, table: &Table, paths: &str) -> Result<(), Failure> {
    match args.format {
        _ if args.common.json => print(&exit::json(table)?),
        Format::Json => print(&exit::json(table)?),
        Format::Csv => print(&written::csv(table)?),
        Format::Latex => print(&latex::latex(table)),
        Format::Text => print(&(written::text(table) + paths)),
    }
}

/// Failure that counts the failed cells. The next run retries those without a record.
fn outcome(table: &Table) -> Result<(), Failure> {
    let failed: Vec<String> = table.failed().map(|(cell, why)| format!("{cell}: {why}")).collect();
    match failed.as_slice() {
        [] => Ok(()),
        _ => {
            failed.iter().for_each(|line| say(format_args!("failed: {line}")));
            Err(Failure::run(format!(
                "{} of {} cells failed; the same command tries those again that have no record",
                failed.len(),
                table.rows.len()
            )))
        }
    }
}
