//! `echoloop evaluate`.

use std::ffi::OsString;
use std::fmt::Display;
use std::path::PathBuf;

use clap::{Args, ValueHint};

use super::axis_flags::AxisFlags;
use super::common::{Setup, TableFormat, on_threads};
use super::evaluate_files;
use super::exit::{self, Failure};
use super::method_choice::MethodChoice;
use super::prepared::{connect, percent, require_recall, traced_for};
use super::progress::Progress;
use echoloop_closed_loop::config::RunConfig;
use echoloop_closed_loop::cost::CostKind;
use echoloop_closed_loop::dataset::Facts;
use echoloop_closed_loop::evaluation::summary::{Summary, evaluate_and_cost};
use echoloop_closed_loop::external_search::ExternalSearch;
use echoloop_closed_loop::parameters::{Values, read_candidate, values_json};
use echoloop_closed_loop::prepared::{PairSet, Prepared};
use echoloop_closed_loop::search::Observer;
use echoloop_report::pair_errors_csv;

/// Flags of `evaluate`.
#[derive(Clone, Debug, Args)]
pub(crate) struct EvaluateArgs {
    #[command(flatten)]
    pub(super) setup: Setup,
    #[command(flatten)]
    method: MethodChoice,
    /// JSON file with {"parameters": {"lidar.power": 50, "lidar.timing": "cfd", …}} laid over the
    /// configuration's; - is standard input.
    #[arg(long, value_name = "FILE")]
    candidate: Option<PathBuf>,
    /// Judge candidates of an outside search, each a line of JSON on standard input, answered by a
    /// line: {"parameters": {…}}, or {"point": […]} of the unit cube of the axes, which the first
    /// line out lists. The scenes are traced once.
    #[arg(long, conflicts_with_all = ["candidate", "require_recall", "format"])]
    pub(super) stream: bool,
    #[command(flatten)]
    axes: AxisFlags,
    /// A row for each pair instead of text.
    #[arg(long, value_enum, conflicts_with = "json")]
    pub(super) format: Option<TableFormat>,
    /// Set of pairs, train or test, or a path [default: test; with --candidate or --stream train: a
    /// search that sees the test pairs cannot be judged on them].
    ///
    /// A path is of clouds with their truth, which judge the registration alone: a folder of pairs,
    /// as `echoloop pairs` writes it; a table, CSV with columns target, source and truth; or a
    /// sequence of scans with poses, as KITTI has them, of which pairs are drawn data.baseline_m
    /// apart.
    #[arg(long, value_name = "train|test|PATH", value_hint = ValueHint::AnyPath)]
    pairs: Option<Judged>,
    /// Exit with 4 when the recall is below this, percent.
    #[arg(long, value_name = "PERCENT", value_parser = percent)]
    pub(super) require_recall: Option<f64>,
}

/// Pairs to judge on.
#[derive(Clone, Debug)]
enum Judged {
    /// Traced ones.
    Set(PairSet),
    /// Those of a folder, a table or a sequence.
    Files(PathBuf),
}

impl From<OsString> for Judged {
    /// A set's name is never a path.
    fn from(given: OsString) -> Self {
        let set = PairSet::ALL.into_iter().find(|set| set.name() == given);
        set.map_or_else(|| Self::Files(given.into()), Self::Set)
    }
}

pub(super) fn run(args: &EvaluateArgs) -> Result<(), Failure> {
    let own = args.method.overrides().into_iter().chain(args.axes.overrides()?);
    let config = args.setup.source.load(own.collect())?;
    let values = args.candidate.as_deref().map(read_candidate).transpose()?.unwrap_or_default();
    on_threads(args.setup.common.threads, || match &args.pairs {
        Some(Judged::Files(path)) => evaluate_files::run(args, path, &config, &values),
        _ => judge(args, config, &values),
    })?
}

impl EvaluateArgs {
    /// The pairs asked for. A candidate gets the training pairs, for its search goes on with the
    /// answer, and the test pairs are to stay unseen.
    fn pairs(&self) -> PairSet {
        let usual =
            if self.candidate.is_some() || self.stream { PairSet::Train } else { PairSet::Test };
        match self.pairs {
            Some(Judged::Set(set)) => set,
            _ => usual,
        }
    }

    /// A refusal of the parameters, with the file they come from.
    pub(super) fn refused(&self, problem: impl Display) -> Failure {
        match &self.candidate {
            Some(path) => Failure::usage(format_args!("{}: {problem}", path.display())),
            None => Failure::usage(problem),
        }
    }
}

fn judge(args: &EvaluateArgs, config: RunConfig, values: &Values) -> Result<(), Failure> {
    let progress = Progress::new(args.setup.common.quiet);
    let preparation = connect(config, &args.setup.sensor, &progress)?;
    let laid = preparation.start.with_values(values, &preparation.config, &preparation.device);
    let parameters = laid.map_err(|problem| args.refused(problem))?;
    let prepared = traced_for(preparation, args.pairs(), &progress)?;
    if args.stream {
        return stream(&prepared, args.pairs(), &progress);
    }
    let noisy = prepared.pairs(args.pairs());
    progress.begin("judging", noisy.pairs.len() as u64);
    let bench = prepared.bench();
    let duration_s = prepared.config.motion.duration_s;
    let (scanner, done) =
        (bench.scanner(prepared.device.hardware, duration_s), || progress.evaluated());
    let data = &prepared.config.data;
    let summary = evaluate_and_cost(&bench, &parameters, &noisy, &scanner, data, &done)?;
    progress.end();
    print(args, &prepared, &parameters.values(&prepared.config), &summary)?;
    require_recall(args.require_recall, &summary)
}

/// Answers the candidates of an outside search, line by line, until standard input ends.
fn stream(prepared: &Prepared, which: PairSet, progress: &Progress) -> Result<(), Failure> {
    progress.begin("judging the start", prepared.pairs(which).pairs.len() as u64);
    let mut search = ExternalSearch::new(prepared, which, &|| progress.evaluated())?;
    progress.end();
    exit::print(&format!("{}\n", search.greeting()))?;
    let mut input = std::io::stdin().lock();
    while let Some(answer) = search.next(&mut input)? {
        exit::print(&format!("{answer}\n"))?;
    }
    Ok(())
}

fn print(
    args: &EvaluateArgs,
    prepared: &Prepared,
    values: &Values,
    summary: &Summary,
) -> Result<(), Failure> {
    if let Some(TableFormat::Csv) = args.format {
        let table = pair_errors_csv([(args.pairs().name(), summary)]);
        return exit::print(&table.map_err(Failure::run)?);
    }
    if args.setup.common.json {
        let document = serde_json::json!({
            "format": 1, "sensor": prepared.sensor, "parameters": values_json(values),
            "set": Facts::new(&prepared.dataset), "pairs": args.pairs().name(),
            "summary": summary,
        });
        return exit::print_json(&document);
    }
    print_text(summary, &format!("{} {} pairs", summary.pairs, args.pairs().name()));
    Ok(())
}

/// Prints a summary as lines. `of` says of how many and which pairs.
pub(super) fn print_text(summary: &Summary, of: &str) {
    println!("recall        {:.1} % of {of}", summary.recall_pct);
    if let (Some(translation), Some(rotation)) =
        (summary.mean_translation_m, summary.mean_rotation_deg)
    {
        println!("mean error    {:.2} cm, {rotation:.3}° over the successes", 100.0 * translation);
    }
    println!(
        "median error  {:.2} cm, {:.3}° over all",
        100.0 * summary.median_translation_m,
        summary.median_rotation_deg
    );
    println!("points        {:.0} a scan", summary.mean_points);
    for kind in CostKind::ALL {
        if let Some(cost) = &summary.cost {
            println!("{:<13} {}", kind.name(), kind.text(kind.of(cost)));
        }
    }
}
